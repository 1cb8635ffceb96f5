// What a laboratory recorded, or a simulation computed: one type for both.
//
// SI units and radians throughout. Drawbar pull is positive when the wheel pulls its carriage forward, torque when it
// drives, sinkage downwards from the undisturbed surface to the lowest point of the rim.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/problem.h"

namespace terrode::recording {

// Names of the channels with a meaning of their own; others are kept under the name they came with.
namespace channel {
inline constexpr const char* drawbar_pull = "drawbar_pull";          // N
inline constexpr const char* driving_torque = "driving_torque";      // N m
inline constexpr const char* sinkage = "sinkage";                    // m
inline constexpr const char* normal_load = "normal_load";            // N
inline constexpr const char* angular_velocity = "angular_velocity";  // rad/s
inline constexpr const char* forward_velocity = "forward_velocity";  // m/s

// SI unit of these and of "time" and "slip"; nothing for a name without a meaning of its own.
std::optional<std::string> unit_of(const std::string& name);
// Their names, without "time".
const std::vector<std::string>& names();
}  // namespace channel

// One measured quantity over the time base of its run; missing samples are NaN and counted as gaps.
struct Channel {
  std::string name;
  std::string unit;  // SI unit text, "" where unknown or dimensionless
  std::vector<double> values;
};

// Mean and scatter of a channel where only a table of steady values was recorded.
struct SteadyValue {
  double mean = 0.0;
  std::optional<double> std;  // deviation within the run, as recorded
};

// What was commanded in a run. `slip` is s = 1 - v/(omega r) at either sign, whatever convention the file used.
// Where slip and one velocity are known, the other is filled in: v = omega r (1 - slip).
struct Condition {
  double slip = 0.0;                        // -; -infinity for a locked wheel (omega = 0)
  std::optional<double> normal_load;        // N
  std::optional<double> angular_velocity;   // rad/s
  std::optional<double> forward_velocity;   // m/s
  int pass = 1;
  int repeat = 1;
  std::map<std::string, std::string> extra; // further keys, as text
};

struct Run {
  std::string id;
  std::string file;             // relative to the recording's folder; empty for a row of a table
  Condition condition;
  std::vector<double> time;     // s, increasing; empty for a row of a table
  std::vector<Channel> channels;
  std::vector<int> lines;       // line of each sample in `file`, from 1; empty where the file is no text
  std::map<std::string, SteadyValue> steady;  // by channel name; filled for rows of a table only

  const Channel* find(const std::string& name) const;
};

// Pressure under a plate against sinkage.
struct PressureSinkageTest {
  std::string file;
  double plate_width = 0.0;      // m, short side or diameter
  double plate_length = 0.0;     // m, long side; 0 for a circle
  bool circular = false;
  std::optional<double> rate;    // m/s
  std::vector<double> sinkage;   // m
  std::vector<double> pressure;  // Pa
};

// Shear stress against displacement under a constant normal stress.
struct DirectShearTest {
  std::string file;
  double normal_stress = 0.0;               // Pa
  std::optional<double> rate;               // m/s
  std::vector<double> shear_displacement;   // m
  std::vector<double> shear_stress;         // Pa
};

struct WheelInfo {
  double radius = 0.0;            // m, of the rim without lugs
  double width = 0.0;             // m
  std::optional<double> mass;     // kg
  std::string surface;
  std::optional<int> grouser_count;
  std::optional<double> grouser_height;  // m
};

// What the laboratory believes of its soil; single values may be missing.
struct SoilBelief {
  std::string name;
  std::optional<double> bulk_density;                       // kg/m3
  std::optional<double> cohesion, friction_angle, shear_modulus;  // Pa, rad, m
  std::optional<double> n;                                  // -
  std::optional<double> k, plate_width;                     // Pa, m: sigma = k (z/plate_width)^n
  std::optional<double> kc, kphi;                           // Pa m^(1-n), Pa m^-n
  std::optional<double> a0, a1, theta_r;                    // -, -, rad
};

struct Recording {
  std::string title, source, licence, notes;
  std::string folder;                    // where recording.yaml lies
  WheelInfo wheel;
  SoilBelief soil;
  std::string slip_convention;           // the text of the file
  std::vector<Run> runs;
  std::vector<PressureSinkageTest> pressure_sinkage;
  std::vector<DirectShearTest> direct_shear;
  std::vector<std::string> remarks;      // notes for the user: unknown keys kept, defaults assumed
  std::map<std::string, std::string> extra;  // keys that are not known, with their path ("wheel.camber"), as text
};

}  // namespace terrode::recording
