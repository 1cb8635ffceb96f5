// Our contact law in the words of LIGGGHTS 3.8 (gran model hertz tangential history rolling_friction ...).
#pragma once

#include <string>
#include <vector>

#include "dem/particle_ground.h"

namespace terrode::liggghts {

// Departures from the law that LIGGGHTS makes and that are taken only where they are named:
//   unprojected_rolling  the torque of the rolling spring (epsd, epsd2) is not projected on the tangent plane
//   constant_rolling     rolling_rate (Eq. 23) gives way to its limit for whatever moves, the constant rolling_friction
//   spring_cdt           cdt takes the spring's part of the normal force and the whole relative spin
//   wheel_rolling        rolling resistance on the wheel acts on the grain's own spin instead of that relative to the
//                        wheel, and the wheel does not feel its couple
//   floor_rolling        rolling resistance on a rough floor takes another share of the spin (LIGGGHTS' on walls)
const std::vector<std::string>& approximations();

// What of these parameters LIGGGHTS cannot express, each with its key, apart from the approximations named.
Problems law_problems(const dem::DemTerrainParams& params, const std::vector<std::string>& approximate);

// Types of particles and walls in these commands.
inline constexpr int soil_type = 1, floor_type = 2, wheel_type = 3;

// "hertz tangential history rolling_friction epsd2": the words after `model`, for pairs and walls alike.
std::string law_model(const dem::DemTerrainParams& params);

// The commands that give the three types their properties and the pairs their law.
std::vector<std::string> law_commands(const dem::DemTerrainParams& params);

}  // namespace terrode::liggghts
