#include "scenario/section.h"

namespace terrode::scenario {
namespace {

// A recording keeps keys it does not know, so the schema lets them pass, at every level.
void allow_more(Json& schema) {
  if (schema.is_object()) {
    if (schema.contains("additionalProperties")) schema["additionalProperties"] = true;
    for (auto& [key, value] : schema.items()) allow_more(value);
  } else if (schema.is_array()) {
    for (Json& value : schema) allow_more(value);
  }
}

Json text(const char* description) { return {{"type", "string"}, {"description", description}}; }

Json object(const Json& properties, const Json& required) {
  return {{"type", "object"}, {"additionalProperties", true}, {"properties", properties}, {"required", required}};
}

}  // namespace

std::string recording_schema() {
  using bekker::SlipConvention;
  const auto quantity = [](const char* unit, Range range, const char* description) { return quantity_schema(unit, range, description); };
  const Json run_keys = {{"id", {{"type", Json::array({"string", "number"})}, {"description", "name of the run"}}},
                         {"file", text("its table: CSV, HDF5 or .mat, beside recording.yaml")},
                         {"slip", quantity("-", any_number(), "commanded slip, by slip_convention")},
                         {"normal_load", quantity("N", above(0), "vertical load")},
                         {"angular_velocity", quantity("rad/s", at_least(0), "of the wheel")},
                         {"forward_velocity", quantity("m/s", at_least(0), "of the axle")},
                         {"pass", {{"type", "integer"}, {"minimum", 1}, {"description", "absent: 1"}}},
                         {"repeat", {{"type", "integer"}, {"minimum", 1}}}};
  const Json plate = {{"kind", {{"const", "pressure_sinkage"}}},
                      {"file", text("columns sinkage [m], pressure [Pa]")},
                      {"plate_width", quantity("m", above(0), "short side")},
                      {"plate_length", quantity("m", above(0), "long side")},
                      {"plate_shape", {{"enum", {"rectangle", "circle"}}}},
                      {"plate_diameter", quantity("m", above(0), "of a circular plate")},
                      {"rate", quantity("m/s", above(0), "of penetration")}};
  const Json shear = {{"kind", {{"const", "direct_shear"}}},
                      {"file", text("columns shear_displacement [m], shear_stress [Pa]")},
                      {"normal_stress", quantity("Pa", above(0), "held constant")},
                      {"rate", quantity("m/s", above(0), "of shearing")}};
  Json wheel = {{"radius", quantity("m", above(0), "of the rim without lugs")},
                {"width", quantity("m", above(0), "of the rim")},
                {"mass", quantity("kg", above(0), "absent: the load alone counts")},
                {"surface", text("such as soil-coated, aluminium")},
                {"grousers", object({{"count", {{"type", "integer"}, {"minimum", 1}}}, {"height", quantity("m", above(0), "above the rim")}},
                                    Json::array())}};
  Json soil = soil_table().schema();
  allow_more(soil);
  Json schema = object(
      {{"format", {{"const", "recording/1"}}},
       {"title", text("what was recorded")},
       {"source", text("who recorded it, where it is published")},
       {"licence", text("of the data")},
       {"notes", text("anything else")},
       {"wheel", object(wheel, Json::array({"radius", "width"}))},
       {"slip_convention",
        {{"enum", {bekker::slip_convention_text(SlipConvention::wong_reece), bekker::slip_convention_text(SlipConvention::driving_braking),
                   bekker::slip_convention_text(SlipConvention::printed)}}}},
       {"soil", soil},
       {"runs", {{"type", "array"}, {"items", object(run_keys, Json::array({"file"}))}}},
       {"runs_table", text("a table of steady values in place of runs")},
       {"soil_tests", {{"type", "array"}, {"items", {{"anyOf", Json::array({object(plate, {"kind", "file"}), object(shear, {"kind", "file"})})}}}}}},
      Json::array({"format", "wheel"}));
  schema["anyOf"] = Json::array({Json{{"required", Json::array({"runs"})}}, Json{{"required", Json::array({"runs_table"})}}});
  Json out = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "Terrode recording"}};
  out.update(schema);
  return out.dump(2) + "\n";
}

}  // namespace terrode::scenario
