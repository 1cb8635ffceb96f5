#include "scenario/vehicle_ground.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scenario/section.h"
#include "terrain/surfaces.h"

namespace terrode::scenario {

namespace {

using terrain::Surface;

void set_if(double& out, const std::optional<double>& value) {
  if (value) out = *value;
}

// The file that the key `file` names; empty where it is wrong.
std::string file_of(MapReader& map) {
  map.need("file");
  const auto name = map.text("file");
  return name ? named_path(*name, *map.find("file"), map.key("file"), map.source()) : std::string();
}

class Sum final : public Surface {
 public:
  explicit Sum(std::vector<std::shared_ptr<const Surface>> parts) : parts_(std::move(parts)) {}
  double height(double x, double y) const override {
    double z = 0.0;
    for (const auto& s : parts_) z += s->height(x, y);
    return z;
  }
  Eigen::Vector2d gradient(double x, double y) const override {
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    for (const auto& s : parts_) g += s->gradient(x, y);
    return g;
  }

 private:
  std::vector<std::shared_ptr<const Surface>> parts_;
};

// Rises from 0 to `height` over `run` where x cos(azimuth) + y sin(azimuth) passes `at`.
class Step final : public Surface {
 public:
  Step(double at, double height, double run, double azimuth)
      : at_(at), height_(height), run_(run), c_(std::cos(azimuth)), s_(std::sin(azimuth)) {}
  double height(double x, double y) const override { return height_ * std::clamp(share(x, y), 0.0, 1.0); }
  Eigen::Vector2d gradient(double x, double y) const override {
    const double u = share(x, y);
    return u > 0.0 && u < 1.0 ? Eigen::Vector2d(height_ / run_ * c_, height_ / run_ * s_) : Eigen::Vector2d::Zero();
  }

 private:
  double share(double x, double y) const { return (x * c_ + y * s_ - at_) / run_; }
  double at_, height_, run_, c_, s_;
};

class Bed final : public Surface {
 public:
  explicit Bed(effects::EffectSet effects) : effects_(std::move(effects)) {}
  double height(double x, double) const override { return effects_.bed_height(x); }
  Eigen::Vector2d gradient(double x, double) const override {
    constexpr double step = 1e-5;  // m: short against any wave of a bed, long against rounding
    return {(effects_.bed_height(x + step) - effects_.bed_height(x - step)) / (2.0 * step), 0.0};
  }

 private:
  effects::EffectSet effects_;
};

std::shared_ptr<const Surface> read_part(const Node& node, const std::string& key, Source& source) {
  MapReader map(node, key, source);
  const std::string kind =
      map.choice("kind", {"level", "slope", "step", "fractal", "png", "ascii"}).value_or("level");
  std::shared_ptr<const Surface> out;
  const std::size_t before = source.problems.size();
  try {
    if (kind == "slope") {
      const double angle = map.number("angle", "rad", between(-1.2, 1.2)).value_or(0.0);
      out = std::make_shared<terrain::SlopeSurface>(angle, map.number("azimuth", "rad").value_or(0.0));
    } else if (kind == "step") {
      map.need("at");
      map.need("height");
      const double at = map.number("at", "m").value_or(0.0), height = map.number("height", "m").value_or(0.0);
      const double run = map.number("run", "m", above(0)).value_or(0.02);
      out = std::make_shared<Step>(at, height, run, map.number("azimuth", "rad").value_or(0.0));
    } else if (kind == "fractal") {
      terrain::FractalParams p;
      set_if(p.rms_height, map.number("rms_height", "m", at_least(0)));
      set_if(p.hurst, map.number("hurst", "-", {0, 1, true, false}));
      set_if(p.longest, map.number("longest", "m", above(0)));
      set_if(p.shortest, map.number("shortest", "m", above(0)));
      if (const auto seed = map.integer("seed", 0, 1L << 40)) p.seed = static_cast<std::uint64_t>(*seed);
      out = std::make_shared<terrain::FractalSurface>(p);
    } else if (kind == "png") {
      const std::string image = file_of(map);
      map.need("cell");
      map.need("white");
      const double cell = map.number("cell", "m", above(0)).value_or(1.0);
      const double black = map.number("black", "m").value_or(0.0), white = map.number("white", "m").value_or(0.0);
      const double x0 = map.number("x0", "m").value_or(0.0), y0 = map.number("y0", "m").value_or(0.0);
      if (source.problems.size() > before) return nullptr;
      out = std::make_shared<terrain::GridSurface>(terrain::read_png_heights(image, cell, black, white, x0, y0));
    } else if (kind == "ascii") {
      const std::string grid = file_of(map);
      if (source.problems.size() > before) return nullptr;
      out = std::make_shared<terrain::GridSurface>(terrain::read_ascii_heights(grid));
    }
  } catch (const InputError& e) {
    for (const Problem& p : e.problems()) source.problem(map.node(), map.key(p.key), p.message, p.expected);
  }
  map.finish();
  return out;
}

}  // namespace

std::shared_ptr<const Surface> read_surface(const Node& node, const std::string& key, Source& source) {
  if (node.kind != Node::Kind::sequence) return read_part(node, key, source);
  std::vector<std::shared_ptr<const Surface>> parts;
  for (std::size_t i = 0; i < node.items.size(); ++i)
    if (auto part = read_part(node.items[i], fmt::format("{}[{}]", key, i), source)) parts.push_back(std::move(part));
  if (parts.empty()) return nullptr;
  return parts.size() == 1 ? parts.front() : std::make_shared<Sum>(std::move(parts));
}

std::shared_ptr<const Surface> with_bed(std::shared_ptr<const Surface> surface, const effects::EffectSet& effects) {
  if (!effects.has_bed()) return surface;
  auto bed = std::make_shared<Bed>(effects);
  if (surface == nullptr) return bed;
  return std::make_shared<Sum>(std::vector<std::shared_ptr<const Surface>>{std::move(surface), std::move(bed)});
}

std::vector<terrain::SoilPatch> read_soil_map(MapReader& map, const Scenario& base) {
  std::vector<terrain::SoilPatch> out;
  Source& source = map.source();
  for (const auto& [key, item] : map.items("soil_map")) {
    MapReader m(*item, key, source);
    terrain::SoilPatch patch;
    for (const auto& [name, value] : {std::pair{"x0", &patch.x0}, {"y0", &patch.y0}, {"x1", &patch.x1}, {"y1", &patch.y1}}) {
      m.need(name);
      set_if(*value, m.number(name, "m"));
    }
    if (!(patch.x1 > patch.x0 && patch.y1 > patch.y0))
      source.problem(*item, key, "is empty", "x1 above x0 and y1 above y0");
    Scenario own = base;
    const std::size_t before = source.problems.size();
    if (const Node* soil = m.need("soil")) {
      inline_or_file(*soil, key + ".soil", source, [&](const Node& n, const std::string& k, Source& s) {
        MapReader soil_map(n, k, s);
        // k stands in one form alone: of the two, what the patch gives.
        if (n.at("bekker.k") != nullptr) own.soil.kc = own.soil.kphi = std::nullopt;
        if (n.at("bekker.kphi") != nullptr) own.soil.k = own.soil.plate_width = std::nullopt;
        soil_table().read(soil_map, own.soil);
      });
    }
    m.finish();
    if (source.problems.size() > before) continue;
    try {
      patch.soil = own.bekker_soil();
      out.push_back(patch);
    } catch (const InputError& e) {
      for (const Problem& p : e.problems()) source.problem(*item, key + "." + p.key, p.message, p.expected);
    }
  }
  return out;
}

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
    if (const auto fixed = m.flag("fixed")) r.fixed = *fixed;
    set_if(r.buried, m.number("buried", "m", at_least(0)));
    m.finish();
    for (const Problem& p : r.validate(key)) source.problem(*item, p.key, p.message, p.expected);
    out.push_back(r);
  }
  if (auto field = map.section("rock_field")) {
    RockField f;
    field->need("count");
    if (const auto count = field->integer("count", 1, 2000)) f.count = static_cast<int>(*count);
    for (const auto& [name, value] : {std::pair{"x0", &f.x0}, {"y0", &f.y0}, {"x1", &f.x1}, {"y1", &f.y1}}) {
      field->need(name);
      set_if(*value, field->number(name, "m"));
    }
    set_if(f.smallest, field->number("smallest", "m", above(0)));
    set_if(f.largest, field->number("largest", "m", above(0)));
    set_if(f.exponent, field->number("exponent", "-", above(0)));
    set_if(f.density, field->number("density", "kg/m^3", above(0)));
    if (const auto fixed = field->flag("fixed")) f.fixed = *fixed;
    set_if(f.buried_share, field->number("buried_share", "-", {0, 1, false, true}));
    if (const auto seed = field->integer("seed", 0, 1L << 40)) f.seed = static_cast<std::uint64_t>(*seed);
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
