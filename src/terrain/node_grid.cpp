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
