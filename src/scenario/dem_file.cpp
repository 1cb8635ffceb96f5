#include "scenario/dem_file.h"

#include <algorithm>
#include <cmath>

namespace terrode::scenario {

dem::DemTerrainParams particle_params(const Scenario& s, int threads) {
  const double r = s.wheel.radius;
  dem::BedRecipe recipe;
  recipe.sizes.smallest = 0.077 * r;
  recipe.sizes.largest = 0.108 * r;
  recipe.width = recipe.length = 0.46 * r;
  recipe.height = 0.77 * r;
  recipe.contact.rolling = "epsd2";
  recipe.gravity = s.rig.gravity;
  recipe.viscous = 0.2;  // grains are heavier than the paper's
  recipe.seed = static_cast<std::uint64_t>(std::max(0, s.seed));
  if (s.soil.bulk_density) recipe.bulk_density = *s.soil.bulk_density;
  dem::DemTerrainParams out;
  out.prism = dem::cached_bed(recipe, {}, threads);
  out.tiles_y = std::max(2, static_cast<int>(std::ceil((s.wheel.width + 0.6 * r) / recipe.length)));
  out.soil = out.wheel = recipe.contact;
  out.floor = recipe.floor;
  out.window_ahead = 1.2 * r;
  out.window_behind = 0.9 * r;
  out.gravity = recipe.gravity;
  out.threads = threads;
  constexpr double fraction = 0.12;  // of the Rayleigh time
  out.time_step = fraction * dem::rayleigh_time(0.5 * recipe.sizes.smallest, out.prism.grain_density, recipe.grain);
  return out;
}

std::unique_ptr<terrain::Terrain> particle_ground(const Scenario& s, const effects::EffectSet& effects, int threads) {
  if (effects.has_bed())
    throw InputError({s.file, 0, 0, "effects", "shape the bed, which the method dem does not know",
                      "effects of rig and instruments, or another method"});
  return std::make_unique<dem::DemTerrain>(particle_params(s, threads));
}

}  // namespace terrode::scenario
