#include "liggghts/law.h"

#include <fmt/format.h>

#include <algorithm>

namespace terrode::liggghts {
namespace {

using dem::DemTerrainParams;
using dem::Interaction;

// LIGGGHTS's name of a rolling part; empty: none.
std::string rolling_name(const std::string& part) {
  if (part == "epsd" || part == "epsd_unprojected") return "epsd";
  if (part == "epsd2" || part == "epsd2_unprojected") return "epsd2";
  return part == "cdt" ? "cdt" : "";
}

bool rolls(const Interaction& i) { return i.rolling != "none" && (i.rolling_friction > 0.0 || i.rolling_rate > 0.0); }

}  // namespace

const std::vector<std::string>& approximations() {
  static const std::vector<std::string> names = {"unprojected_rolling", "constant_rolling", "spring_cdt", "wheel_rolling", "floor_rolling"};
  return names;
}

Problems law_problems(const DemTerrainParams& p, const std::vector<std::string>& approximate) {
  Problems problems;
  const auto named = [&](const char* name) { return std::find(approximate.begin(), approximate.end(), name) != approximate.end(); };
  const auto refuse = [&](const std::string& key, const std::string& what, const std::string& instead) {
    problems.push_back({{}, 0, 0, key, what + ", which LIGGGHTS cannot express", instead});
  };
  const auto approximable = [&](const std::string& key, const std::string& what, const char* name, const std::string& instead) {
    if (!named(name)) refuse(key, what, fmt::format("{}, or approximate: [{}]", instead, name));
  };
  const Interaction& soil = p.soil;
  if (soil.normal != "hertz") refuse("normal", "is " + soil.normal, "hertz");
  if (soil.tangential != "mindlin") refuse("tangential", "is " + soil.tangential, "mindlin");
  if (soil.rolling == "epsd_capped_sum") refuse("rolling", "is epsd_capped_sum", "epsd_unprojected, epsd2_unprojected or none");
  if (soil.rolling == "epsd" || soil.rolling == "epsd2")
    approximable("rolling", fmt::format("is {}, whose spring is projected on the tangent plane", soil.rolling), "unprojected_rolling",
                 soil.rolling + "_unprojected");
  if (soil.rolling == "cdt") approximable("rolling", "is cdt of the whole normal force", "spring_cdt", "another part");
  if (soil.rolling != "none" && (soil.rolling_rate > 0.0 || p.wheel.rolling_rate > 0.0 || p.floor.rolling_rate > 0.0))
    approximable("rolling_rate", fmt::format("is {:.6g} s^2/m^2, a rolling coefficient that depends on the rate", soil.rolling_rate),
                 "constant_rolling", "0");
  if (p.surface == dem::WheelSurface::shape && rolls(p.wheel))
    approximable("wheel_rolling_friction",
                 fmt::format("is {:.6g}: rolling resistance relative to the turning wheel, with its couple on it", p.wheel.rolling_friction),
                 "wheel_rolling", "0");
  if (rolls(p.floor))
    approximable("floor", fmt::format("resists rolling by {:.6g}", p.floor.rolling_friction), "floor_rolling", "smooth");
  if (p.surface == dem::WheelSurface::spheres) refuse("wheel_surface", "is spheres", "shape");
  for (const auto& [name, i] : {std::pair{"soil", &soil}, {"wheel", &p.wheel}, {"floor", &p.floor}}) {
    if (i->cohesion != "none") refuse(fmt::format("{}.cohesion", name), "is " + i->cohesion, "none");
    if (i->printed_shear_modulus) refuse(fmt::format("{}.printed_shear_modulus", name), "is the form of Eq. 17 as printed", "Mindlin's");
    if (i->restitution <= 0.05) refuse("restitution", fmt::format("is {:.6g}", i->restitution), "above 0.05");
    if (i->normal != soil.normal || i->tangential != soil.tangential || (rolls(*i) && i->rolling != soil.rolling))
      refuse(fmt::format("{}", name), "acts by other parts of the law than grain on grain", "the same parts");
  }
  return problems;
}

std::string law_model(const DemTerrainParams& p) {
  const std::string rolling = rolling_name(p.soil.rolling);
  return "hertz tangential history" + (rolling.empty() ? "" : " rolling_friction " + rolling);
}

std::vector<std::string> law_commands(const DemTerrainParams& p) {
  // Walls are of the grains' material; pairs that never meet (floor and wheel) have the floor's numbers.
  const Interaction *s = &p.soil, *f = &p.floor, *w = &p.wheel;
  const Interaction* pairs[9] = {s, f, w, f, f, f, w, f, w};
  const auto matrix = [&](const char* id, const char* property, auto value) {
    std::string line = fmt::format("fix {} all property/global {} peratomtypepair 3", id, property);
    for (const Interaction* i : pairs) line += fmt::format(" {:.17g}", value(*i));
    return line;
  };
  const auto each = [](const char* id, const char* property, double value) {
    return fmt::format("fix {0} all property/global {1} peratomtype {2:.17g} {2:.17g} {2:.17g}", id, property, value);
  };
  const double young = p.prism.grain.young_modulus;
  std::vector<std::string> out;
  if (young < 5e6) out.push_back("soft_particles yes");  // bounds of plausible stiffness in SI units that it holds input to
  if (young > 1e9) out.push_back("hard_particles yes");
  out.push_back(each("young", "youngsModulus", young));
  out.push_back(each("poisson", "poissonsRatio", p.prism.grain.poisson_ratio));
  out.push_back(matrix("restitution", "coefficientRestitution", [](const Interaction& i) { return i.restitution; }));
  out.push_back(matrix("friction", "coefficientFriction", [](const Interaction& i) { return i.friction; }));
  const std::string rolling = rolling_name(p.soil.rolling);
  if (!rolling.empty())
    out.push_back(matrix("rolling", "coefficientRollingFriction",
                         [](const Interaction& i) { return i.rolling == "none" ? 0.0 : i.rolling_friction; }));
  if (rolling == "epsd")
    out.push_back(matrix("rolling_damping", "coefficientRollingViscousDamping", [](const Interaction& i) { return i.rolling_damping; }));
  out.push_back("pair_style gran model " + law_model(p));
  out.push_back("pair_coeff * *");
  return out;
}

}  // namespace terrode::liggghts
