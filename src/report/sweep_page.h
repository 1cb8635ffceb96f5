// The report of a slip sweep: drawbar pull, torque and sinkage against slip for each method beside measured points.
#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "report/page.h"

namespace terrode::report {

// One slip of one method, in SI; NaN where not known.
struct SweepPoint {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  double slip = 0.0;                                   // -, by the convention of the report
  double drawbar_pull = kUnknown;                      // N
  double driving_torque = kUnknown;                    // N m
  double sinkage = kUnknown;                           // m
  double drawbar_pull_sem = kUnknown;                  // standard error of the mean (measured points: scatter)
  double driving_torque_sem = kUnknown;
  double sinkage_sem = kUnknown;
  double drawbar_pull_std = kUnknown;                  // deviation over the averaging window
  double driving_torque_std = kUnknown;
  double sinkage_std = kUnknown;
  double cpu_seconds = kUnknown;
  double simulated_seconds = kUnknown;
  bool steady = true;                                  // false: the run had not settled
  std::string error;                                   // why there are no numbers; empty otherwise
};

struct SweepCurve {
  std::string name;              // "steady", "node-spring", "measured (Ding et al. 2011)"
  std::vector<SweepPoint> points;
  bool measured = false;         // drawn as points with error bars in ink
};

struct SweepReport {
  std::string title;
  std::string command;
  std::string scenario_name, scenario_text;   // file name and its text, kept in the page
  std::string slip_convention;
  std::vector<std::pair<std::string, std::string>> facts;  // wheel radius, load, soil
  std::vector<SweepCurve> curves;
  std::vector<std::string> notes;
};

// The page; it compares every method with the measured points (linear in slip between its own points) in a table and
// in the sentence at the top.
Page sweep_page(const SweepReport& report);

// The three figures alone (drawbar pull, torque, sinkage).
std::vector<Figure> sweep_figures(const SweepReport& report);

}  // namespace terrode::report
