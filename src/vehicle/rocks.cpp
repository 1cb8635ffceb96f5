#include "vehicle/rocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/random.h"

namespace terrode::vehicle {

using multibody::ShapeKind;

double RockSpec::height() const { return shape == ShapeKind::sphere ? 2.0 * radius : size.z(); }

double RockSpec::reach() const { return shape == ShapeKind::sphere ? radius : 0.5 * std::hypot(size.x(), size.y()); }

double RockSpec::mass() const {
  return density * (shape == ShapeKind::sphere ? 4.0 / 3.0 * std::numbers::pi * radius * radius * radius : size.prod());
}

double RockSpec::distance(double px, double py) const {
  const double dx = px - x, dy = py - y;
  if (shape == ShapeKind::sphere) return std::max(0.0, std::hypot(dx, dy) - radius);
  const double c = std::cos(heading), s = std::sin(heading);
  return std::hypot(std::max(0.0, std::abs(c * dx + s * dy) - 0.5 * size.x()),
                    std::max(0.0, std::abs(c * dy - s * dx) - 0.5 * size.y()));
}

Problems RockSpec::validate(const std::string& key) const {
  Problems p;
  if (name.empty()) p.push_back({{}, 0, 0, key + ".name", "is empty", "a name"});
  if (shape == ShapeKind::sphere)
    require(p, key + ".radius", radius, "m", radius > 0.0, "a length above 0");
  else if (!(size.allFinite() && size.minCoeff() > 0.0))
    p.push_back({{}, 0, 0, key + ".size", "has an edge of 0 or less", "three lengths above 0"});
  require(p, key + ".x", x, "m", true, "a finite position");
  require(p, key + ".y", y, "m", true, "a finite position");
  require(p, key + ".heading", heading, "rad", true, "a finite angle");
  require(p, key + ".density", density, "kg/m3", density > 0.0, "above 0");
  require(p, key + ".buried", buried, "m", buried >= 0.0 && (fixed || buried == 0.0),
          "0 or more, and 0 for a loose rock, which settles by its weight");
  return p;
}

Problems RockField::validate(const std::string& key) const {
  Problems p;
  if (count < 0 || count > 2000)
    p.push_back({{}, 0, 0, key + ".count", fmt::format("is {}", count), "0 to 2000 rocks"});
  require(p, key + ".x1", x1, "m", x1 > x0, "above x0");
  require(p, key + ".y1", y1, "m", y1 > y0, "above y0");
  require(p, key + ".smallest", smallest, "m", smallest > 0.0, "above 0");
  require(p, key + ".largest", largest, "m", largest >= smallest, "at least the smallest");
  require(p, key + ".exponent", exponent, "-", exponent > 0.0, "above 0");
  require(p, key + ".density", density, "kg/m3", density > 0.0, "above 0");
  require(p, key + ".buried_share", buried_share, "-", buried_share >= 0.0 && buried_share < 1.0, "0 to below 1");
  return p;
}

std::vector<RockSpec> scatter(const RockField& f) {
  throw_if_any(f.validate("rock_field"));
  Random random(f.seed);
  std::vector<RockSpec> out;
  const double big = std::pow(f.largest / f.smallest, -f.exponent);
  constexpr int most_tries = 1000;
  for (int i = 0; i < f.count; ++i) {
    RockSpec r;
    r.name = fmt::format("rock_{}", i + 1);
    // Inverse of the distribution function 1 - (D/smallest)^-exponent cut off at the largest.
    r.radius = 0.5 * f.smallest * std::pow(1.0 - random.uniform() * (1.0 - big), -1.0 / f.exponent);
    r.density = f.density;
    r.fixed = f.fixed;
    r.buried = f.fixed ? 2.0 * r.radius * f.buried_share : 0.0;
    int tries = 0;
    for (bool placed = false; !placed;) {
      if (++tries > most_tries)
        throw InputError({{}, 0, 0, "rock_field.count", fmt::format("is {}, of which {} fit", f.count, i),
                          "fewer or smaller rocks, or a larger rectangle"});
      r.x = random.uniform(f.x0, f.x1);
      r.y = random.uniform(f.y0, f.y1);
      placed = std::hypot(r.x - f.clear_x, r.y - f.clear_y) >= f.clear_radius + r.radius;
      for (const RockSpec& o : out) placed = placed && std::hypot(r.x - o.x, r.y - o.y) > r.radius + o.radius;
    }
    out.push_back(r);
  }
  return out;
}

}  // namespace terrode::vehicle
