// Where a recording and a model part.
#pragma once

#include <vector>

#include "diagnosis/hypotheses.h"

namespace terrode::diagnosis {

// Where run means depart from a fit by more than 3.5 deviations, by channel: over all slips, stretches of them, each load, speed
// and pass; and a trend along the travel that all runs share. At most the three most significant of a channel.
std::vector<Located> located(const Model& model, const Tried& plain);

}  // namespace terrode::diagnosis
