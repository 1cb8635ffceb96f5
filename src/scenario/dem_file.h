// The particle ground of a scenario.
#pragma once

#include <memory>

#include "dem/dem_terrain.h"
#include "effects/effect.h"
#include "scenario/scenario.h"

namespace terrode::scenario {

// Grains and bed for this wheel, coarse enough for a sweep within minutes: diameters of 0.077 to 0.108 of the wheel's
// radius (10 to 14 mm for the paper's wheel, whose grains are 2.5 to 10 mm), a bed 0.77 radii deep, as wide as the wheel
// and 0.6 radii. The contact law is the paper's with constant mu_r = 1 and epsd2. The soil parameters of Bekker's models
// do not enter: particles have their own.
dem::DemTerrainParams particle_params(const Scenario& scenario, int threads = 1);

// A fresh particle ground. Throws InputError for effects that shape the bed, which particles do not know.
std::unique_ptr<terrain::Terrain> particle_ground(const Scenario& scenario, const effects::EffectSet& effects, int threads = 1);

}  // namespace terrode::scenario
