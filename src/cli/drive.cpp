#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/vehicle_run.h"

namespace terrode::cli {
namespace {

struct DriveArguments {
  std::vector<std::string> files;
  VehicleArguments rest;
};

}  // namespace

void add_drive(Command& app, Common& common) {
  Command* command = app.add_subcommand("drive", "whole machines over soft ground: as run, and several scenarios at once (-o then names a folder)");
  const auto a = std::make_shared<DriveArguments>();
  command->add_option("SCENARIO", a->files, "vehicle scenarios (YAML with a key `vehicle`)")->required()->type_name("");
  add_kept_run(*command, a->rest.kept);
  command->add_option("--csv", a->rest.csv, "write the time series to this file")->type_name("FILE.csv");
  command->add_option("--frames", a->rest.frames, "keep about N pictures in the result file, for view and export --to vtk")
      ->check(range(1, 100000))
      ->type_name("N");
  command->add_option("--until", a->rest.until, "stop at this time [s], before the scenario's end")->check(positive_number())->type_name("T");
  command->add_option("--state", a->rest.state, "write the state at the end to this file, for --resume")->type_name("FILE.h5");
  command->add_option("--resume", a->rest.resume, "go on from a state, to the bit as if never stopped")->type_name("FILE.h5");
  add_common(*command, common, true);
  command->callback([a, &common] {
    if (a->files.size() == 1)
      run_vehicle(a->files.front(), a->rest, common);
    else
      run_vehicles(a->files, a->rest, common);
  });
}

}  // namespace terrode::cli
