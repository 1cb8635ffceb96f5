#include "terrain/node_grid.h"

#include <algorithm>

namespace terrode::terrain {

static_assert(Tile::size == 32, "floor_div shifts by 5");

Node& NodeGrid::touch(NodeIndex i) {
  Tile* tile = tile_of(i);
  if (!tile) {
    tiles_.push_back(std::make_unique<Tile>());
    tile = tiles_.back().get();
    tile->tx = floor_div(i.ix);
    tile->ty = floor_div(i.iy);
    by_key_.emplace(key(tile->tx, tile->ty), tile);
    last_ = Last{};
  }
  return tile->nodes[slot(i)];
}

const NodeSurface* NodeGrid::surface_tile(NodeIndex i) const {
  const std::int32_t tx = floor_div(i.ix), ty = floor_div(i.iy);
  const std::uint64_t k = key(tx, ty);
  if (last_surface_ && last_surface_key_ == k) return last_surface_;
  auto& tile = surfaces_[k];
  if (!tile) {
    tile = std::make_unique<NodeSurface[]>(Tile::size * Tile::size);
    for (int j = 0; j < Tile::size * Tile::size; ++j) {
      const int ix = tx * Tile::size + j % Tile::size, iy = ty * Tile::size + j / Tile::size;
      const double x = ix * spacing_, y = iy * spacing_;
      const Eigen::Vector2d g = surface_->gradient(x, y);
      tile[static_cast<std::size_t>(j)] = {surface_->height(x, y), g.x(), g.y()};
    }
  }
  last_surface_key_ = k;
  return last_surface_ = tile.get();
}

double NodeGrid::base(double x, double y) const {
  if (level_) return *level_;
  const double u = x / spacing_, v = y / spacing_, fu = std::floor(u), fv = std::floor(v), a = u - fu, b = v - fv;
  const auto at = [&](int dx, int dy) {
    return surface_at({static_cast<std::int32_t>(fu) + dx, static_cast<std::int32_t>(fv) + dy}).z;
  };
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

double NodeGrid::change(double x, double y) const {
  if (tiles_.empty()) return 0.0;
  const double u = x / spacing_, v = y / spacing_;
  const double fu = std::floor(u), fv = std::floor(v);
  const NodeIndex i{static_cast<std::int32_t>(fu), static_cast<std::int32_t>(fv)};
  const double a = u - fu, b = v - fv;
  const auto at = [&](std::int32_t dx, std::int32_t dy) {
    const Node* n = find({i.ix + dx, i.iy + dy});
    return n ? n->raised - n->entry : 0.0;
  };
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

std::vector<const Tile*> NodeGrid::sorted_tiles() const {
  std::vector<const Tile*> out;
  out.reserve(tiles_.size());
  for (const auto& tile : tiles_) out.push_back(tile.get());
  std::sort(out.begin(), out.end(), [](const Tile* a, const Tile* b) { return a->tx != b->tx ? a->tx < b->tx : a->ty < b->ty; });
  return out;
}

void NodeGrid::clear() {
  tiles_.clear();
  by_key_.clear();
  last_ = Last{};
}

}  // namespace terrode::terrain
