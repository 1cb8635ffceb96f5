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

}  // namespace terrode::scenario
