// A slip sweep of a scenario: each operating point by each method asked for.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/progress.h"
#include "recording/recording.h"
#include "scenario/scenario.h"

namespace terrode::scenario {

// What one method gives for one operating point, in SI; NaN where the method does not know a value.
struct SweepPoint {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  OperatingPoint at;
  double drawbar_pull = kUnknown;         // N
  double driving_torque = kUnknown;       // N m
  double sinkage = kUnknown;              // m
  double normal_load = kUnknown;          // N, on the soil
  double entry_angle = kUnknown;          // rad, steady alone
  // Deviation over the averaging window and standard error of the mean, of simulations in time.
  double drawbar_pull_std = kUnknown, driving_torque_std = kUnknown, sinkage_std = kUnknown;
  double drawbar_pull_sem = kUnknown, driving_torque_sem = kUnknown, sinkage_sem = kUnknown;
  double cpu_seconds = kUnknown;
  double simulated_seconds = kUnknown;
  bool steady = true;                     // false: the run had not settled when it ended
  std::string error;                      // why there are no numbers; empty otherwise
  std::vector<std::string> remarks;       // such as: the peak angle was clamped
  std::shared_ptr<const recording::Run> series;  // time series, of simulations in time

  bool failed() const { return !error.empty(); }
};

struct MethodResult {
  std::string method;
  std::vector<SweepPoint> points;         // in the order asked for
};

struct SweepTask {
  std::vector<std::string> methods;
  std::vector<OperatingPoint> points;
  int threads = 0;
  std::uint64_t seed = 1;
  Progress progress;
  // A point that was computed before and need not be again; null: none. Called before anything is computed.
  std::function<const SweepPoint*(const std::string& method, const OperatingPoint&)> known;
  // Called as points are finished, one at a time, from any thread.
  std::function<void(std::size_t method, std::size_t point, const SweepPoint&)> finished;
};

// Computes every point that is not known, on up to `threads` threads; the numbers do not depend on how many. A point
// that fails carries its error and the others go on. Throws InputError where the scenario cannot be simulated by a
// method, Interrupted where the progress asked to stop (finished points were handed out).
std::vector<MethodResult> run_sweep(const Scenario& scenario, const SweepTask& task);

// True for the same slip, load, speed and pass.
bool same_point(const OperatingPoint& a, const OperatingPoint& b);

}  // namespace terrode::scenario
