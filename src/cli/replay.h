// Held-out conditions of a diagnosis, simulated in time: the wheel on ODE over the node-spring ground, once by the plain
// model and once by the corrected one, both fitted without those conditions.
#pragma once

#include <array>
#include <vector>

#include "cli/commands.h"
#include "diagnosis/diagnose.h"
#include "recording/recording.h"
#include "scenario/scenario.h"

namespace terrode::cli {

struct ReplayPoint {
  diagnosis::Condition condition;
  std::array<double, diagnosis::kChannels> measured{}, before{}, after{};  // N, N m, m; means over repeats
  std::array<bool, diagnosis::kChannels> has{};
};

struct ReplayResult {
  std::vector<ReplayPoint> points;
  std::array<double, diagnosis::kChannels> rmse_before{}, rmse_after{};
  int failed = 0;  // conditions that one of the two models could not run
};

// The recording's scenario with this soil and these effects in it.
scenario::Scenario corrected_scenario(const recording::Recording& recording, const bekker::Soil& soil, const bekker::ContactAngles& angles,
                                      const std::map<std::string, std::map<std::string, double>>& effects);

// Simulates d.replay; empty where the diagnosis held nothing out.
ReplayResult replay(const recording::Recording& recording, const diagnosis::Diagnosis& d, const Common& common);

}  // namespace terrode::cli
