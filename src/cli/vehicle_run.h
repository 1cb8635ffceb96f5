// What `run` and `drive` do with vehicle scenarios.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/kept_run.h"

namespace terrode::cli {

struct VehicleArguments {
  KeptRunOptions kept;  // of several scenarios the output is the folder for theirs
  std::string csv, state, resume;
  std::optional<double> until;  // s
  int frames = 0;
};

// One scenario. Throws InputError, RunError, Interrupted.
void run_vehicle(const std::string& file, const VehicleArguments& arguments, Common& common);

// Several scenarios, one on each thread; results as FOLDER/<scenario>.h5. A machine that fails is said and the others go
// on (exit status 1).
void run_vehicles(const std::vector<std::string>& files, const VehicleArguments& arguments, Common& common);

}  // namespace terrode::cli
