// The particle ground of a scenario.
#pragma once

#include <memory>

#include "core/progress.h"
#include "dem/dem_terrain.h"
#include "effects/effect.h"
#include "liggghts/liggghts_terrain.h"
#include "scenario/scenario.h"

namespace terrode::scenario {

// Grains, bed, window and law as the scenario's section `particles` gives them. Lengths that it leaves out are coarse
// enough for a sweep within minutes: diameters of 0.077 to 0.108 of the wheel's radius (10 to 14 mm for the paper's
// wheel, whose grains are 2.5 to 10 mm), a bed 0.77 radii deep, as wide as the wheel and 0.6 radii. The law is by default
// the paper's with constant mu_r = 1 and epsd2. The soil parameters of Bekker's models do not enter: particles have their
// own; of the soil the bulk density counts. Settles the prism where the cache does not have it.
dem::DemTerrainParams particle_params(const Scenario& scenario, int threads = 1, const Progress& progress = {});

// Two of them by themselves, defaults filled in.
dem::DemWindow particle_window(const Scenario& scenario);
dem::SizeDistribution particle_sizes(const Scenario& scenario);

// Throws InputError for what of the scenario's law LIGGGHTS cannot express, apart from the approximations that it names.
void require_liggghts_law(const Scenario& scenario);

// The same for the engine of the method mpi, with the approximations that the scenario names, and as much bed as the rig
// may travel. Problems are those of the scenario's keys.
liggghts::LiggghtsParams liggghts_params(const Scenario& scenario, int threads = 1, const Progress& progress = {});

// A fresh particle ground. Throws InputError for effects that shape the bed, which particles do not know.
std::unique_ptr<terrain::Terrain> particle_ground(const Scenario& scenario, const effects::EffectSet& effects, int threads = 1,
                                                  const Progress& progress = {});
// A fresh one on LIGGGHTS. Throws InputError also for what of the law it cannot express, and in a build without it.
std::unique_ptr<terrain::Terrain> liggghts_ground(const Scenario& scenario, const effects::EffectSet& effects, int threads = 1,
                                                  const Progress& progress = {});
// The same with parameters of its own (liggghts_params, more bed); problems are those of the scenario's keys.
std::unique_ptr<terrain::Terrain> liggghts_ground(const Scenario& scenario, liggghts::LiggghtsParams params);

}  // namespace terrode::scenario
