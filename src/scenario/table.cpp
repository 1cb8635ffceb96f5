#include "scenario/table.h"

#include <cmath>

namespace terrode::scenario {

Json quantity_schema(const std::string& unit, const Range& range, const std::string& description) {
  Json number = {{"type", "number"}};
  if (std::isfinite(range.lo)) number[range.lo_open ? "exclusiveMinimum" : "minimum"] = range.lo;
  if (std::isfinite(range.hi)) number[range.hi_open ? "exclusiveMaximum" : "maximum"] = range.hi;
  const bool dimensionless = unit.empty() || unit == "-";
  Json out = Json::object();
  const std::string suffix = dimensionless ? "" : " [" + unit + "]";
  if (!description.empty() || !suffix.empty()) out["description"] = description + suffix;
  out["anyOf"] = Json::array({number, Json{{"type", "string"}, {"pattern", "^[ ]*[-+]?[0-9.]"}}});
  return out;
}

Node quantity_node(double value, const std::string& unit) {
  const bool dimensionless = unit.empty() || unit == "-";
  return Node::scalar(dimensionless ? fmt::format("{}", value) : fmt::format("{} {}", value, unit));
}

std::optional<Vec3> read_vector(MapReader& map, const std::string& key, const std::string& unit, const Range& range) {
  const std::size_t before = map.source().problems.size();
  const std::vector<double> v = map.numbers(key, unit, range);
  if (v.size() == 3) return Vec3(v[0], v[1], v[2]);
  if (map.source().problems.size() == before)
    map.source().problem(*map.find(key), map.key(key), fmt::format("has {} numbers", v.size()), "three: x, y, z");
  return std::nullopt;
}

}  // namespace terrode::scenario
