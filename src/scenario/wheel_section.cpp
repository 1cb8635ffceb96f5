#include "scenario/pieces.h"
#include "scenario/section.h"

namespace terrode::scenario {

Table<WheelSpec> grouser_table() {
  Table<WheelSpec> grousers;
  grousers.integer("count", 0, 500, &WheelSpec::grouser_count, "number of lugs around the rim")
      .number("height", "m", at_least(0), &WheelSpec::grouser_height, "of the lugs above the rim")
      .number("thickness", "m", at_least(0), &WheelSpec::grouser_thickness, "of a lug along the rim, at its root")
      .number("tip_thickness", "m", at_least(0), &WheelSpec::grouser_tip_thickness, "of a tapered lug at its tip")
      .choice("shape", {"straight", "tapered", "triangular"}, &WheelSpec::grouser_shape, "of a lug")
      .number("phase", "rad", any_number(), &WheelSpec::grouser_phase, "of the first lug, from straight down");
  return grousers;
}

Table<WheelSpec> wheel_table() {
  Table<WheelSpec>::Key grouser_key = Table<WheelSpec>().group("grousers", grouser_table(), "lugs").keys().front();
  const auto write = grouser_key.write;
  grouser_key.write = [write](const WheelSpec& w) { return w.grouser_count > 0 ? write(w) : std::nullopt; };

  Table<WheelSpec> t;
  t.number("radius", "m", above(0), &WheelSpec::radius, "of the rim without lugs; slip and sinkage refer to it")
      .required()
      .number("width", "m", above(0), &WheelSpec::width, "of the rim")
      .required()
      .number("mass", "kg", above(0), &WheelSpec::mass, "absent: the load alone counts")
      .number("crown_radius", "m", at_least(0), &WheelSpec::crown_radius, "of the rim's profile across the width; 0: flat")
      .text("surface", &WheelSpec::surface, "such as soil-coated, aluminium")
      .add(std::move(grouser_key))
      .add(pieces_key("pieces", &WheelSpec::pieces, "points whose convex hulls touch the soil in place of rim and lugs: x forward, y along the axle, z up"))
      .integer("piece_count", 1, 360, &WheelSpec::piece_count, "how often the pieces stand around the axle");
  return t;
}

Section wheel_section() {
  Section section;
  section.name = "wheel";
  section.required = true;
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    inline_or_file(node, key, source, [&out](const Node& n, const std::string& k, Source& s) {
      MapReader map(n, k, s);
      wheel_table().read(map, out.wheel);
      const char* const other = out.wheel.grouser_count > 0 ? "grousers" : out.wheel.crown_radius > 0 ? "crown_radius" : nullptr;
      if (!out.wheel.pieces.empty() && other) s.problem(n, map.key(other), "stands beside pieces, which touch in its place", "one of the two");
    });
  };
  section.write = [](const Scenario& in) { return wheel_table().write(in.wheel); };
  section.schema = [] {
    return Json{{"description", "the wheel, or the path of a file that holds it"},
                {"anyOf", Json::array({Json{{"type", "string"}}, wheel_table().schema()})}};
  };
  return section;
}

}  // namespace terrode::scenario
