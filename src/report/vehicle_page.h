// The report of a vehicle's run: where it went, how its wheels slipped, sank and pulled, and what that cost.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "recording/recording.h"
#include "report/page.h"

namespace terrode::report {

struct VehicleMargin {
  double time = 0.0, travel = 0.0;  // s, m
  double pull = 0.0;                // N
  bool at_least = false;
};

struct VehicleReport {
  std::string title, command;
  std::string scenario_name, scenario_text;
  std::string machine;
  std::vector<std::string> wheels;       // names; channels are <wheel>_<channel>
  recording::Run run;                    // of Vehicle::run
  std::vector<std::pair<double, double>> planned;  // m, path that was meant
  std::vector<VehicleMargin> margins;
  std::vector<std::string> events, notes;
  bool ended_early = false;              // immobilised, overturned
  double energy_per_metre = 0.0;         // J/m
  std::vector<std::pair<std::string, double>> energy;  // J, where it went
};

Page vehicle_page(const VehicleReport& report);

// Energy of all drives per metre [J/m] over successive stretches of `stretch` [m] of path; x is the stretch's middle.
std::pair<std::vector<double>, std::vector<double>> energy_along_path(const VehicleReport& report, double stretch);

}  // namespace terrode::report
