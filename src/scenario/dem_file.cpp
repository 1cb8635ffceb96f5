#include "scenario/dem_file.h"

#include <algorithm>
#include <cmath>

namespace terrode::scenario {

dem::DemWindow particle_window(const Scenario& s) {
  return {s.particles.window_ahead.value_or(1.2 * s.wheel.radius), s.particles.window_behind.value_or(0.9 * s.wheel.radius)};
}

dem::SizeDistribution particle_sizes(const Scenario& s) {
  const double r = s.wheel.radius;
  const ParticleSpec& p = s.particles;
  dem::SizeDistribution out;
  out.shape = p.distribution;
  out.by = p.by;
  out.largest = p.largest.value_or(std::max(0.108 * r, p.smallest.value_or(0.0)));
  out.smallest = p.smallest.value_or(std::min(0.077 * r, out.largest));
  return out;
}

dem::DemTerrainParams particle_params(const Scenario& s, int threads, const Progress& progress) {
  const double r = s.wheel.radius;
  const ParticleSpec& p = s.particles;
  dem::BedRecipe recipe;
  recipe.sizes = particle_sizes(s);
  recipe.width = p.prism.value_or(0.46 * r);
  recipe.length = p.prism_across.value_or(recipe.width);
  recipe.height = p.depth.value_or(0.77 * r);
  recipe.grain.young_modulus = p.young_modulus;
  recipe.grain.poisson_ratio = p.poisson_ratio;
  recipe.contact.tangential = p.tangential;
  recipe.contact.rolling = p.rolling;
  recipe.contact.restitution = p.restitution;
  recipe.contact.friction = p.friction;
  recipe.contact.rolling_friction = p.rolling_friction;
  recipe.contact.rolling_rate = p.rolling_rate;
  recipe.settling_friction = p.settling_friction;
  recipe.settling_rolling_friction = p.settling_rolling_friction;
  recipe.gravity = s.rig.gravity;
  // The recipe's damping suits the paper's grains; the time in which it acts goes with mass over damping.
  constexpr double paper_diameter = 6.25e-3;
  const double ratio = 0.5 * (recipe.sizes.smallest + recipe.sizes.largest) / paper_diameter;
  recipe.viscous *= ratio * ratio;
  recipe.seed = static_cast<std::uint64_t>(std::max(0, s.seed));
  if (s.soil.bulk_density) recipe.bulk_density = *s.soil.bulk_density;
  dem::DemTerrainParams out;
  out.prism = dem::cached_bed(recipe, {}, threads, progress);
  const double width = p.width.value_or(s.wheel.width + 0.6 * r);
  out.tiles_y = std::max(p.width ? 1 : 2, static_cast<int>(std::ceil(width / recipe.length - 1e-9)));
  out.soil = out.wheel = recipe.contact;
  out.wheel.friction = p.wheel_friction.value_or(p.friction);
  out.wheel.rolling_friction = p.wheel_rolling_friction.value_or(p.rolling_friction);
  out.floor = recipe.floor;
  out.settling_friction = p.settling_friction;
  out.settling_rolling_friction = p.settling_rolling_friction;
  out.surface = p.wheel_surface == "spheres" ? dem::WheelSurface::spheres : dem::WheelSurface::shape;
  out.shell_diameter = p.sphere_diameter;
  out.shell_spacing = p.sphere_spacing;
  const dem::DemWindow window = particle_window(s);
  out.window_ahead = window.ahead;
  out.window_behind = window.behind;
  if (p.bed == "full") {
    out.full_length = p.length;
    out.full_behind = p.behind;
    out.border = p.border;
  }
  out.gravity = recipe.gravity;
  out.threads = threads;
  out.time_step = p.time_step.value_or(p.time_step_fraction *
                                       dem::rayleigh_time(0.5 * recipe.sizes.smallest, out.prism.grain_density, recipe.grain));
  return out;
}

std::unique_ptr<terrain::Terrain> particle_ground(const Scenario& s, const effects::EffectSet& effects, int threads,
                                                  const Progress& progress) {
  if (effects.has_bed())
    throw InputError({s.file, 0, 0, "effects", "shape the bed, which the method dem does not know",
                      "effects of rig and instruments, or another method"});
  return std::make_unique<dem::DemTerrain>(particle_params(s, threads, progress));
}

}  // namespace terrode::scenario
