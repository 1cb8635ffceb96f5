#include "scenario/dem_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "liggghts/law.h"

namespace terrode::scenario {

dem::DemWindow particle_window(const Scenario& s) {
  return {s.particles.window_ahead.value_or(1.6 * s.wheel.radius), s.particles.window_behind.value_or(1.3 * s.wheel.radius)};
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

namespace {

dem::BedRecipe bed_recipe(const Scenario& s) {
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
  return recipe;
}

// Who touches whom, and how; no bed.
dem::DemTerrainParams particle_law(const Scenario& s) {
  const ParticleSpec& p = s.particles;
  const dem::BedRecipe recipe = bed_recipe(s);
  dem::DemTerrainParams out;
  out.soil = out.wheel = recipe.contact;
  out.wheel.friction = p.wheel_friction.value_or(p.friction);
  out.wheel.rolling_friction = p.wheel_rolling_friction.value_or(p.rolling_friction);
  out.floor = p.floor == "rough" ? recipe.contact : recipe.floor;
  out.settling_friction = p.settling_friction;
  out.settling_rolling_friction = p.settling_rolling_friction;
  out.surface = p.wheel_surface == "spheres" ? dem::WheelSurface::spheres : dem::WheelSurface::shape;
  return out;
}

}  // namespace

dem::DemTerrainParams particle_params(const Scenario& s, int threads, const Progress& progress) {
  const ParticleSpec& p = s.particles;
  const dem::BedRecipe recipe = bed_recipe(s);
  dem::DemTerrainParams out = particle_law(s);
  out.prism = dem::cached_bed(recipe, {}, threads, progress);
  const double width = p.width.value_or(s.wheel.width + 0.6 * s.wheel.radius);
  out.tiles_y = std::max(p.width ? 1 : 2, static_cast<int>(std::ceil(width / recipe.length - 1e-9)));
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

namespace {

void refuse_bed_effects(const Scenario& s, const effects::EffectSet& effects, const char* method) {
  if (!effects.has_bed()) return;
  throw InputError({s.file, 0, 0, "effects", fmt::format("shape the bed, which the method {} does not know", method),
                    "effects of rig and instruments, or another method"});
}

// Problems of the engine's parameters by the scenario's keys.
void throw_of_particles(const Scenario& s, Problems problems) {
  for (Problem& p : problems) {
    if (p.file.empty()) p.file = s.file;
    if (p.key != "method") p.key = "particles." + p.key;
  }
  throw_if_any(problems);
}

}  // namespace

void require_liggghts_law(const Scenario& s) {
  throw_of_particles(s, liggghts::law_problems(particle_law(s), s.particles.approximate));
}

liggghts::LiggghtsParams liggghts_params(const Scenario& s, int threads, const Progress& progress) {
  liggghts::LiggghtsParams out;
  out.approximate = s.particles.approximate;
  require_liggghts_law(s);  // before a bed is settled for nothing
  out.bed = particle_params(s, threads, progress);
  // A wheel that is pulled may go either way; one whose slip is imposed goes ahead, and as it is set down a little back.
  const double r = s.wheel.radius;
  const bool pulled = s.rig.mode == "imposed_pull" || s.rig.mode == "pull_ramp";
  out.reach_ahead = s.rig.travel + r;
  out.reach_behind = (pulled ? s.rig.travel : 0.0) + r;
  return out;
}

std::unique_ptr<terrain::Terrain> liggghts_ground(const Scenario& s, const effects::EffectSet& effects, int threads,
                                                  const Progress& progress) {
  refuse_bed_effects(s, effects, "mpi");
  return liggghts_ground(s, liggghts_params(s, threads, progress));
}

std::unique_ptr<terrain::Terrain> liggghts_ground(const Scenario& s, liggghts::LiggghtsParams params) {
  try {
    return liggghts::make_terrain(std::move(params));
  } catch (const InputError& e) {
    throw_of_particles(s, e.problems());
    throw;
  }
}

std::unique_ptr<terrain::Terrain> particle_ground(const Scenario& s, const effects::EffectSet& effects, int threads,
                                                  const Progress& progress) {
  refuse_bed_effects(s, effects, "dem");
  return std::make_unique<dem::DemTerrain>(particle_params(s, threads, progress));
}

}  // namespace terrode::scenario
