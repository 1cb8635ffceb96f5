#include "scenario/rocks_file.h"

#include <fmt/format.h>

namespace terrode::scenario {

namespace {

using vehicle::RockField;
using vehicle::RockSpec;

Table<RockSpec> rock_table() {
  Table<RockSpec> t;
  t.text("name", &RockSpec::name, "absent: rock_1, rock_2, ...")
      .choice<multibody::ShapeKind>("shape", {{"sphere", multibody::ShapeKind::sphere}, {"box", multibody::ShapeKind::box}}, &RockSpec::shape,
                                    "of the rock")
      .number("radius", "m", above(0), &RockSpec::radius, "of a sphere, which needs it")
      .vector("size", "m", above(0), &RockSpec::size, "edges of a box, which needs them: x, y, z")
      .number("x", "m", any_number(), &RockSpec::x, "of its centre")
      .required()
      .number("y", "m", any_number(), &RockSpec::y, "of its centre")
      .number("heading", "rad", any_number(), &RockSpec::heading, "about the vertical")
      .number("density", "kg/m^3", above(0), &RockSpec::density, "of the rock")
      .flag("fixed", &RockSpec::fixed, "whether it is part of the ground")
      .number("buried", "m", at_least(0), &RockSpec::buried, "depth of a fixed rock's lowest point");
  return t;
}

Table<RockField> rock_field_table() {
  Table<RockField> t;
  t.integer("count", 1, 2000, &RockField::count, "spheres").required();
  for (const auto& [name, member] : {std::pair{"x0", &RockField::x0}, {"y0", &RockField::y0}, {"x1", &RockField::x1}, {"y1", &RockField::y1}})
    t.number(name, "m", any_number(), member, "of the rectangle over which they are strewn").required();
  t.number("smallest", "m", above(0), &RockField::smallest, "diameter")
      .number("largest", "m", above(0), &RockField::largest, "diameter")
      .number("exponent", "-", above(0), &RockField::exponent, "of N(>D) ~ D^-exponent")
      .number("density", "kg/m^3", above(0), &RockField::density, "of the rocks")
      .flag("fixed", &RockField::fixed, "whether they are part of the ground")
      .number("buried_share", "-", {0, 1, false, true}, &RockField::buried_share, "of the diameter of fixed rocks")
      .add({"seed", false, {{"type", "integer"}, {"minimum", 0}, {"default", RockField{}.seed}},
            [](MapReader& map, RockField& out) { set_if(out.seed, map.integer("seed", 0, 1L << 40)); },
            [](const RockField& in) -> std::optional<Node> { return Node::scalar(std::to_string(in.seed)); }});
  return t;
}

}  // namespace

Json rocks_schema() { return {{"type", "array"}, {"items", rock_table().schema()}}; }
Json rock_field_schema() { return rock_field_table().schema(); }

std::vector<vehicle::RockSpec> read_rocks(MapReader& map, double clear_x, double clear_y, double clear_radius) {
  std::vector<RockSpec> out;
  Source& source = map.source();
  for (const auto& [key, item] : map.items("rocks")) {
    MapReader m(*item, key, source);
    RockSpec r;
    r.name = fmt::format("rock_{}", out.size() + 1);
    rock_table().read(m, r);
    const bool box = r.shape == multibody::ShapeKind::box;
    const char* const needed = box ? "size" : "radius";
    const char* const other = box ? "radius" : "size";
    if (item->find(needed) == nullptr) source.problem(*item, key + "." + needed, "is missing");
    if (const Node* at = item->find(other)) source.problem(*at, key + "." + other, "does not go with this shape", needed);
    for (const Problem& p : r.validate(key)) source.problem(*item, p.key, p.message, p.expected);
    out.push_back(r);
  }
  if (auto field = map.section("rock_field")) {
    RockField f;
    rock_field_table().read(*field, f);
    f.clear_x = clear_x;
    f.clear_y = clear_y;
    f.clear_radius = clear_radius;
    if (source.problems.empty()) {
      try {
        for (RockSpec& r : scatter(f)) {
          r.name = fmt::format("rock_{}", out.size() + 1);
          out.push_back(r);
        }
      } catch (const InputError& e) {
        for (const Problem& p : e.problems()) source.problem(field->node(), p.key, p.message, p.expected);
      }
    }
  }
  return out;
}

}  // namespace terrode::scenario
