// Recordings that contradict themselves before any physics.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/campaign.h"

namespace terrode::diagnosis {

// What is wrong with signs, units or energy, one sentence each: T omega - DP v cannot be negative, a wheel under more slip pulls
// more and not less, and a channel that is zero throughout was not measured.
std::vector<std::string> contradictions(const Campaign& campaign);

}  // namespace terrode::diagnosis
