#include "scenario/pieces.h"

#include "wheel/convex.h"

namespace terrode::scenario {

Pieces read_pieces(MapReader& map, const std::string& name) {
  Source& source = map.source();
  const std::size_t before = source.problems.size();
  Pieces out;
  for (const auto& [key, item] : map.items(name)) {
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < item->items.size(); ++i) {
      const std::string at = key + "[" + std::to_string(i) + "]";
      const std::vector<double> p = read_numbers(item->items[i], at, "m", any_number(), source);
      if (p.size() == 3)
        points.emplace_back(p[0], p[1], p[2]);
      else
        source.problem(item->items[i], at, "has " + std::to_string(p.size()) + " numbers", "three: x, y, z");
    }
    out.push_back(std::move(points));
  }
  if (source.problems.size() > before) return {};
  if (out.empty()) return out;
  try {
    wheel::ConvexPieces{out};
  } catch (const InputError& e) {
    for (const Problem& p : e.problems()) source.problem(*map.find(name), map.key(name), p.message, p.expected);
    return {};
  }
  return out;
}

std::optional<Node> write_pieces(const Pieces& pieces) {
  if (pieces.empty()) return std::nullopt;
  Node out = Node::sequence();
  for (const std::vector<Vec3>& points : pieces) {
    Node piece = Node::sequence();
    for (const Vec3& p : points) {
      Node point = Node::sequence();
      for (const double v : p) point.items.push_back(quantity_node(v, "m"));
      piece.items.push_back(std::move(point));
    }
    out.items.push_back(std::move(piece));
  }
  return out;
}

Json pieces_schema(const std::string& text) {
  const Json point = {{"type", "array"}, {"items", quantity_schema("m", any_number(), "")}, {"minItems", 3}, {"maxItems", 3}};
  const Json piece = {{"type", "array"}, {"items", point}, {"minItems", 4}};
  return {{"type", "array"}, {"description", text}, {"items", piece}};
}

}  // namespace terrode::scenario
