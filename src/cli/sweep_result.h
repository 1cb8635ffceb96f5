// The points of a sweep as commands write, resume and show them: in a result file one group for each method with a
// column for each quantity.
#pragma once

#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "recording/result_file.h"
#include "scenario/methods.h"
#include "scenario/scenario.h"

namespace terrode::cli {

using Json = nlohmann::ordered_json;

// What one method gives for one operating point, in SI; NaN where the method does not know a value.
struct SweepPoint {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  scenario::OperatingPoint at;
  double drawbar_pull = kUnknown;         // N
  double driving_torque = kUnknown;       // N m
  double sinkage = kUnknown;              // m
  double normal_load = kUnknown;          // N, on the soil
  double entry_angle = kUnknown;          // rad, steady alone
  // Deviation over the averaging window and standard error of the mean, of simulations in time.
  double drawbar_pull_std = kUnknown, driving_torque_std = kUnknown, sinkage_std = kUnknown;
  double drawbar_pull_sem = kUnknown, driving_torque_sem = kUnknown, sinkage_sem = kUnknown;
  double averaged_from = kUnknown, averaged_to = kUnknown;  // s, the averaging window
  // Books of energy of the last pass, touchdown included [J], and what is left over [-]: see vehicle::RigEnergy.
  double work_in = kUnknown, work_out = kUnknown, energy_plastic = kUnknown, energy_slip = kUnknown, energy_damping = kUnknown;
  double energy_stored = kUnknown, energy_step = kUnknown, energy_audit = kUnknown;
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

// True for the same slip, load, speed and pass.
bool same_point(const scenario::OperatingPoint& a, const scenario::OperatingPoint& b);

// A point as the engine gives it, a time series averaged over its steady part (whole periods where there are any).
SweepPoint summarise(const vehicle::SweepPoint& point, const scenario::OperatingPoint& at, std::optional<double> period);

// Puts the books of a run into the point.
void put_energy(const vehicle::RigEnergy& energy, SweepPoint& point);
// Their names and values.
std::vector<std::pair<std::string, double>> energy_fields(const SweepPoint& point);
// Where the work of these points went, in one line; empty where none of them has books.
std::string energy_text(const std::vector<SweepPoint>& points);

// What decides whether two pieces of work belong together: everything of a scenario but which points and methods are
// asked for.
std::string physics_of(scenario::Scenario s);

// The points of a method as columns and back.
recording::ResultTable to_table(const std::vector<SweepPoint>& points);
std::vector<SweepPoint> from_table(const recording::ResultTable& table);

// The document of `sweep --json` (docs of the command line).
Json sweep_json(const std::string& scenario_file, const std::string& slip_convention,
                const std::vector<MethodResult>& results, const std::vector<SweepPoint>& measured = {});

// One row a method and slip, units in the header, '.' as decimal point, digits that read back to the same values.
std::string sweep_csv(const std::vector<MethodResult>& results);

// The table that a person sees.
std::string sweep_text(const std::vector<MethodResult>& results);

}  // namespace terrode::cli
