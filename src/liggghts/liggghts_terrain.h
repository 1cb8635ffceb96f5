// The same particles as dem/dem_terrain.h, carried by LIGGGHTS (C. Kloss et al. 2012) on one or many processes, behind
// the same callback.
//
// Grains, window, frozen and fixed grains, time step and the motion of bodies within a step are those of DemTerrain; the
// bed is laid as far as the bodies may come, at once. Wheels are triangle meshes whose facets depart from the rim by at
// most 2 % of the smallest grain's radius. One wrench a body and step: a second trial with another motion is refused, for
// LIGGGHTS has no way back. A snapshot goes on with all grains and contacts, but not to the same bits: what is set up anew
// takes its first half step with wheels at rest. Results depend on the number of processes in the last digits, and grow apart from there as
// grains do.
//
// LIGGGHTS lives once in a process: while a ground of one thread has begun, those of other threads wait.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dem/particle_ground.h"
#include "terrain/terrain.h"

namespace terrode::liggghts {

struct LiggghtsParams {
  dem::DemTerrainParams bed;
  double reach_behind = 0.2, reach_ahead = 1.0;  // m along x from 0 that the centres of bodies may travel; not for a full bed
  std::vector<std::string> approximate;          // departures from the law that are taken: liggghts/law.h
  Problems validate() const;
};

// Throws InputError with every problem of the parameters (what LIGGGHTS cannot express is one), and where this build has
// no LIGGGHTS.
std::unique_ptr<terrain::Terrain> make_terrain(LiggghtsParams params);

}  // namespace terrode::liggghts
