// What may be wrong with the samples of a run: clocks, gaps, outliers, saturated and frozen channels, and balances that no
// wheel can have.
#pragma once

#include <string>
#include <vector>

#include "recording/recording.h"

namespace terrode::analysis {

struct QualityFinding {
  // "jitter", "missing samples", "gaps", "outliers", "saturated", "frozen", "constant", "second clock", "slip",
  // "energy"
  std::string kind;
  std::string channel;   // empty for the time base
  std::string message;   // "is stuck at 12.3 N for 40 samples from 3.20 s"
  int line = 0;          // in the run's file, 0 where it has no lines
  double time = 0.0;     // s, where it begins
  std::size_t count = 0; // samples concerned
};

// Checks one run. `wheel_radius` [m] > 0 adds two checks of the whole: the slip that the measured velocities give
// against the one commanded, and the power balance: the drive's power T omega less the carriage's DP v is lost in the
// soil and cannot be negative.
std::vector<QualityFinding> check_quality(const recording::Run& run, double wheel_radius = 0.0);

}  // namespace terrode::analysis
