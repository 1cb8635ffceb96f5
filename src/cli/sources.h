// Whatever holds runs, as recordings: a recording's folder or YAML file, one of its tables, a result file, a bare table.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "recording/recording.h"

namespace terrode::cli {

// What a bare table does not say about its run.
struct TableHelp {
  std::string columns;                       // YAML file with `csv`, `columns`, ... as in recording.yaml
  std::optional<double> radius;              // m
  std::optional<double> angular_velocity;    // rad/s
  std::optional<double> forward_velocity;    // m/s
  std::optional<double> slip;                // s = 1 - v/(omega r)
  std::optional<int> grousers;
};

// Loads a file. A table that lies beside a recording.yaml that names it brings its wheel and condition from there, unless
// `help` has a column map. `method` picks one of a result file's. Throws InputError with every problem.
recording::Recording load_runs(const std::string& path, const std::string& method, const TableHelp& help, int threads);

// A wheel on the contact of a result's soil, as a mass on a spring: what an undamped simulated bed rings at.
struct ContactRinging {
  double stiffness = 0.0;        // N/m, dW/dz of the steady wheel at the run's slip and load
  double mass = 0.0;             // kg that moves up and down
  double eigenfrequency = 0.0;   // Hz
};
// For runs of a result file that carries its scenario; nothing for other files, or where the steady wheel has no answer.
std::optional<ContactRinging> contact_ringing(const std::string& path, const recording::Run& run);

// Methods of a result file, {""} for anything else.
std::vector<std::string> methods_of(const std::string& path);

}  // namespace terrode::cli
