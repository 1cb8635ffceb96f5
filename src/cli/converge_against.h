// The node-spring rig at the settings of a scenario against what it must agree with: `terrode converge --against`.
#pragma once

#include <vector>

#include "cli/commands.h"
#include "scenario/scenario.h"

namespace terrode::cli {

// Slip by slip against the steady wheel: pull, torque and sinkage by both, by how much they part, and, where that is more
// than `tolerance`, why. Empty `slips`: those of the scenario.
void against_steady(const scenario::Scenario& scenario, const std::vector<double>& slips, double tolerance, Common& common);

// The drawbar-slip curve of one run whose resisting pull rises slowly against runs at each slip, and how gently the
// wheel was set down. A difference counts by the load.
void against_pull_ramp(const scenario::Scenario& scenario, const std::vector<double>& slips, double tolerance, Common& common);

}  // namespace terrode::cli
