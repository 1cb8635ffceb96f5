// The nodes of the ground: a square lattice in sparse tiles. Untouched ground has no tile and costs nothing.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "terrain/surface.h"

namespace terrode::terrain {

// Lattice index; the node's place is (ix spacing, iy spacing).
struct NodeIndex {
  std::int32_t ix = 0, iy = 0;
  bool operator==(const NodeIndex&) const = default;
};

// What a node remembers. Sinkages are vertical, from the undisturbed surface, positive down [m].
struct Node {
  double plastic = 0.0;    // deepest sinkage of finished contacts
  double entry = 0.0;      // of the surface where the present or next contact begins (springback taken off)
  double reached = 0.0;    // deepest sinkage within the present contact
  double raised = 0.0;     // soil heaped on the node [m]
  double shear_x = 0.0;    // shear displacement of the present contact [m], for shear that is kept in the ground
  double shear_y = 0.0;
  std::int32_t passes = 0; // finished contacts
  std::int32_t body = -1;  // in contact with this body, or none
  std::uint32_t stamp = 0; // last step of contact
  std::uint32_t removed = 0;  // 1: the node carries nothing any more
};

struct Tile {
  static constexpr int size = 32;
  std::int32_t tx = 0, ty = 0;
  Node nodes[size * size];
};

// The undisturbed surface at a node: height [m] and slopes.
struct NodeSurface {
  double z = 0.0, gx = 0.0, gy = 0.0;
};

class NodeGrid {
 public:
  NodeGrid(double spacing, std::shared_ptr<const Surface> surface) : spacing_(spacing), surface_(std::move(surface)) {
    level_ = surface_->level();
  }

  double spacing() const { return spacing_; }
  const Surface& surface() const { return *surface_; }
  const std::optional<double>& level() const { return level_; }

  // The node, or nullptr where its tile was never touched.
  const Node* find(NodeIndex i) const {
    const Tile* tile = tile_of(i);
    return tile ? &tile->nodes[slot(i)] : nullptr;
  }
  // The node; makes its tile when there is none.
  Node& touch(NodeIndex i);

  // Bilinear interpolation of (raised - entry), the change of the surface by finished and present contacts [m].
  double change(double x, double y) const;
  // The surface as it lies, where bodies meet it: the undisturbed one bilinear between nodes, plus its change [m].
  double height(double x, double y) const { return base(x, y) + change(x, y); }

  // The undisturbed surface at a node. Uneven ground keeps what it was asked for, tile by tile.
  NodeSurface surface_at(NodeIndex i) const {
    if (level_) return {*level_, 0.0, 0.0};
    return surface_tile(i)[slot(i)];
  }
  double base(double x, double y) const;

  std::size_t tile_count() const { return tiles_.size(); }
  // Tiles in the order of their indices.
  std::vector<const Tile*> sorted_tiles() const;
  void clear();

  NodeIndex nearest(double x, double y) const {
    return {static_cast<std::int32_t>(std::lround(x / spacing_)), static_cast<std::int32_t>(std::lround(y / spacing_))};
  }

 private:
  static std::int32_t floor_div(std::int32_t a) { return a >> 5; }
  static int slot(NodeIndex i) { return (i.iy & (Tile::size - 1)) * Tile::size + (i.ix & (Tile::size - 1)); }
  static std::uint64_t key(std::int32_t tx, std::int32_t ty) {
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(tx)) << 32) | static_cast<std::uint32_t>(ty);
  }
  Tile* tile_of(NodeIndex i) const {
    const std::int32_t tx = floor_div(i.ix), ty = floor_div(i.iy);
    if (last_ && last_key_ == key(tx, ty)) return *last_;
    const auto it = by_key_.find(key(tx, ty));
    Tile* tile = it == by_key_.end() ? nullptr : it->second;
    last_key_ = key(tx, ty);
    last_ = tile;
    return tile;
  }

  // The tile looked up last, which may be "none".
  struct Last {
    bool known = false;
    Tile* tile = nullptr;
    explicit operator bool() const { return known; }
    Tile* operator*() const { return tile; }
    Last& operator=(Tile* t) {
      known = true;
      tile = t;
      return *this;
    }
  };

  const NodeSurface* surface_tile(NodeIndex i) const;

  double spacing_;
  std::shared_ptr<const Surface> surface_;
  std::optional<double> level_;
  std::vector<std::unique_ptr<Tile>> tiles_;
  std::unordered_map<std::uint64_t, Tile*> by_key_;
  mutable std::uint64_t last_key_ = 0;
  mutable Last last_;

  // No history: what surface_ answers, kept because it may be slow.
  mutable std::unordered_map<std::uint64_t, std::unique_ptr<NodeSurface[]>> surfaces_;
  mutable std::uint64_t last_surface_key_ = 0;
  mutable const NodeSurface* last_surface_ = nullptr;
};

}  // namespace terrode::terrain
