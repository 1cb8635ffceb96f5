// A recording reduced to what the diagnosis compares: conditions, bins of each run's channels, curves of soil tests.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "bekker/soil.h"
#include "bekker/steady_wheel.h"
#include "recording/recording.h"

namespace terrode::diagnosis {

inline constexpr int kChannels = 3;  // drawbar pull [N], driving torque [N m], sinkage [m], in this order
const char* channel_name(int channel);
const char* channel_unit(int channel);

// What was asked of the rig; runs that repeat it share one.
struct Condition {
  double slip = 0.0;              // s = 1 - v/(omega r); -infinity for a locked wheel
  double normal_load = 0.0;       // N
  double angular_velocity = 0.0;  // rad/s
  double forward_velocity = 0.0;  // m/s
  int pass = 1;
  int runs = 0;

  bool operator==(const Condition&) const = default;
};

// One asked of the rig twice: slips and passes the same, loads within 2 %, for loads measured run by run differ a little, speeds
// within a thousandth.
bool same_condition(const Condition& a, const Condition& b);

// Mean of a stretch of a run. A row of a table of steady values is one bin with steady = true.
struct Bin {
  double time = 0.0;   // middle, s
  double width = 0.0;  // s
  int samples = 0;
};

struct RunData {
  std::string id;
  int condition = 0;                               // index
  bool steady = false;                             // a mean only: no start-up in it
  std::vector<Bin> bins;
  std::array<bool, kChannels> has{};
  std::array<std::vector<double>, kChannels> mean;  // by bin; empty where a channel is missing
  std::array<double, kChannels> table_std{};        // of a table's row, 0 where none
  // The series themselves, for the search for ripples; empty for a table.
  std::vector<double> time;
  std::array<std::vector<double>, kChannels> series;
};

// Means of a settled run, recorded and predicted: of a series without its first 0.3, by samples. `predicted` as Model::predict
// gives it.
std::array<double, 2> settled_means(const RunData& run, const std::array<std::vector<double>, kChannels>& predicted, std::size_t channel);

struct Curve {
  bool shear = false;        // else pressure against sinkage
  double normal_stress = 0;  // Pa, of a shear test
  double plate_width = 0;    // m, of a plate
  double rate = 0;           // m/s; 0 unknown
  std::vector<double> x;     // m: shear displacement or sinkage
  std::vector<double> y;     // Pa
};

struct Campaign {
  std::string title;
  bekker::WheelSize wheel;
  bekker::Soil believed;               // what the laboratory believes; gaps filled as `remarks` says
  bekker::ContactAngles believed_angles;
  bool complete_belief = false;        // nothing of the soil had to be filled in
  bool known_soil = false;             // the belief comes from the same soil under another wheel, and holds but for its preparation
  std::vector<Condition> conditions;
  std::vector<RunData> runs;
  std::vector<Curve> curves;
  double travel_length = 0.0;          // m, the longest travel of any run
  int replicated_conditions = 0;
  int known_grousers = 0;              // count the laboratory gives; 0: none given
  std::vector<std::string> remarks;    // what was assumed, left out or doubted
};

// Reduces a recording. Throws InputError when nothing in it can be compared: no run with a drawbar, torque or sinkage
// channel, no load, no wheel.
Campaign reduce(const recording::Recording& recording);

}  // namespace terrode::diagnosis
