#include "scenario/rocks_file.h"

#include <fmt/format.h>

namespace terrode::scenario {

std::vector<vehicle::RockSpec> read_rocks(MapReader& map, double clear_x, double clear_y, double clear_radius) {
  using namespace vehicle;
  std::vector<RockSpec> out;
  Source& source = map.source();
  for (const auto& [key, item] : map.items("rocks")) {
    MapReader m(*item, key, source);
    RockSpec r;
    r.name = m.text("name").value_or(fmt::format("rock_{}", out.size() + 1));
    const bool box = m.choice("shape", {"sphere", "box"}).value_or("sphere") == "box";
    if (box) {
      r.shape = multibody::ShapeKind::box;
      m.need("size");
      const std::vector<double> size = m.numbers("size", "m", above(0));
      if (size.size() == 3)
        r.size = Vec3(size[0], size[1], size[2]);
      else
        source.problem(*item, key + ".size", fmt::format("has {} numbers", size.size()), "three: x, y, z");
    } else {
      m.need("radius");
      set_if(r.radius, m.number("radius", "m", above(0)));
    }
    m.need("x");
    set_if(r.x, m.number("x", "m"));
    set_if(r.y, m.number("y", "m"));
    set_if(r.heading, m.number("heading", "rad"));
    set_if(r.density, m.number("density", "kg/m^3", above(0)));
    set_if(r.fixed, m.flag("fixed"));
    set_if(r.buried, m.number("buried", "m", at_least(0)));
    m.finish();
    for (const Problem& p : r.validate(key)) source.problem(*item, p.key, p.message, p.expected);
    out.push_back(r);
  }
  if (auto field = map.section("rock_field")) {
    RockField f;
    field->need("count");
    set_if(f.count, field->integer("count", 1, 2000));
    for (const auto& [name, value] : {std::pair{"x0", &f.x0}, {"y0", &f.y0}, {"x1", &f.x1}, {"y1", &f.y1}}) {
      field->need(name);
      set_if(*value, field->number(name, "m"));
    }
    set_if(f.smallest, field->number("smallest", "m", above(0)));
    set_if(f.largest, field->number("largest", "m", above(0)));
    set_if(f.exponent, field->number("exponent", "-", above(0)));
    set_if(f.density, field->number("density", "kg/m^3", above(0)));
    set_if(f.fixed, field->flag("fixed"));
    set_if(f.buried_share, field->number("buried_share", "-", {0, 1, false, true}));
    set_if(f.seed, field->integer("seed", 0, 1L << 40));
    field->finish();
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
