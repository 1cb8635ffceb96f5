#include "dem/material.h"

#include <cmath>
#include <numbers>

#include "dem/law/parts.h"

namespace terrode::dem {

namespace {

template <class Family>
int part_index(const std::string& name) {
  for (int k = 0; k < Family::count; ++k)
    if (name == Family::names[k]) return k;
  return -1;
}

template <class Family>
void require_part(Problems& problems, const std::string& key, const std::string& name) {
  if (part_index<Family>(name) >= 0) return;
  std::string known;
  for (const char* n : Family::names) known += (known.empty() ? "" : ", ") + std::string(n);
  problems.push_back({{}, 0, 0, key, "is \"" + name + "\"", "one of " + known});
}

}  // namespace

Problems Material::validate() const {
  Problems problems;
  require(problems, "young_modulus", young_modulus, "Pa", young_modulus > 0.0, "above 0");
  require(problems, "poisson_ratio", poisson_ratio, "-", poisson_ratio >= 0.0 && poisson_ratio <= 0.5, "0 to 0.5");
  return problems;
}

Problems Interaction::validate() const {
  Problems problems;
  require_part<NormalParts>(problems, "normal", normal);
  require_part<TangentialParts>(problems, "tangential", tangential);
  require_part<RollingParts>(problems, "rolling", rolling);
  require_part<CohesionParts>(problems, "cohesion", cohesion);
  require(problems, "restitution", restitution, "-", restitution > 0.0 && restitution <= 1.0, "above 0, at most 1");
  require(problems, "friction", friction, "-", friction >= 0.0, "0 or more");
  require(problems, "rolling_friction", rolling_friction, "-", rolling_friction >= 0.0, "0 or more");
  require(problems, "rolling_rate", rolling_rate, "s2/m2", rolling_rate >= 0.0, "0 or more");
  require(problems, "rolling_damping", rolling_damping, "-", rolling_damping >= 0.0, "0 or more");
  require(problems, "cohesion_energy_density", cohesion_energy_density, "Pa", cohesion_energy_density >= 0.0,
          "0 or more");
  return problems;
}

Interaction Interaction::smooth_wall() {
  Interaction wall;
  wall.rolling = "none";
  wall.restitution = 0.06;
  wall.friction = 0.0;
  wall.rolling_friction = 0.0;
  return wall;
}

double damping_ratio(double restitution) {
  const double l = std::log(restitution);
  return l / std::sqrt(l * l + std::numbers::pi * std::numbers::pi);
}

PairLaw make_pair_law(const Material& a, const Material& b, const Interaction& interaction) {
  Problems problems = interaction.validate();
  for (const Material* m : {&a, &b})
    for (Problem& p : m->validate()) problems.push_back(p);
  throw_if_any(problems);
  PairLaw law;
  law.normal = part_index<NormalParts>(interaction.normal);
  law.tangential = part_index<TangentialParts>(interaction.tangential);
  law.rolling = part_index<RollingParts>(interaction.rolling);
  law.cohesion = part_index<CohesionParts>(interaction.cohesion);
  const auto square = [](double x) { return x * x; };
  law.young_eff =
      1.0 / ((1.0 - square(a.poisson_ratio)) / a.young_modulus + (1.0 - square(b.poisson_ratio)) / b.young_modulus);
  const auto shear_compliance = [&](const Material& m) {
    const double nu = m.poisson_ratio;
    const double form = interaction.printed_shear_modulus ? (2.0 + nu) * (1.0 - nu) : (2.0 - nu) * (1.0 + nu);
    return 2.0 * form / m.young_modulus;
  };
  law.shear_eff = 1.0 / (shear_compliance(a) + shear_compliance(b));
  law.damping = -2.0 * std::sqrt(5.0 / 6.0) * damping_ratio(interaction.restitution);
  law.friction = interaction.friction;
  law.rolling_friction = interaction.rolling_friction;
  law.rolling_rate = interaction.rolling_rate;
  law.rolling_damping = interaction.rolling_damping;
  law.attraction = interaction.cohesion_energy_density;
  return law;
}

double rayleigh_time(double radius, double density, const Material& material) {
  const double shear_modulus = material.young_modulus / (2.0 * (1.0 + material.poisson_ratio));
  return std::numbers::pi * radius * std::sqrt(density / shear_modulus) / (0.1631 * material.poisson_ratio + 0.8766);
}

}  // namespace terrode::dem
