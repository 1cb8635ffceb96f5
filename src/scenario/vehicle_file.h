// A machine that drives over soft ground, from a YAML file: the machine (ready-made by name, from a file of its own, or
// described in place), the ground, and what it is to do. docs/formats-vehicle.md lists the keys.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/progress.h"
#include "effects/effect.h"
#include "recording/recording.h"
#include "scenario/scenario.h"
#include "terrain/surface.h"
#include "vehicle/controllers.h"
#include "vehicle/vehicle.h"

namespace terrode::scenario {

struct DriveScenario {
  std::string file, text;
  Scenario base;                                    // soil, terrain settings, effects
  std::string ground = "node-spring";               // or rigid
  std::shared_ptr<const terrain::Surface> surface;  // null: level
  vehicle::VehicleSpec machine;
  vehicle::VehicleOptions options;
  std::vector<vehicle::Manoeuvre> script;  // one of script and waypoints
  std::vector<Eigen::Vector2d> waypoints;  // m
  vehicle::PathFollower::Options path;
  double duration = 60.0;  // s at most

  std::unique_ptr<terrain::Terrain> make_ground(const effects::EffectSet& effects) const;
  std::unique_ptr<vehicle::Controller> make_controller() const;
};

// True where a YAML file has a `vehicle` key: it is a drive, not a rig.
bool is_drive(const std::string& path);

// Throw InputError with every problem and its place.
DriveScenario load_drive(const std::string& path);
DriveScenario parse_drive(const std::string& text, const std::string& file);

// A machine alone: the map below the key `vehicle`, or a file that holds one.
vehicle::VehicleSpec parse_machine(const std::string& text, const std::string& file);

struct DriveResult {
  recording::Run run;
  std::vector<std::string> events;
  double simulated_seconds = 0.0;
  double energy_per_metre = 0.0;  // J/m of the drives over the path; 0 without a path
  vehicle::VehicleEnergy energy;
};

// Sees the machine after every sample of a drive, between steps; it must change nothing.
using DriveObserver = std::function<void(vehicle::Vehicle&, const vehicle::Controller&)>;

// Runs it, from its beginning or from a checkpoint (Vehicle::checkpoint). Throws RunError when the machine is lost,
// Interrupted when asked to stop.
DriveResult run_drive(const DriveScenario& drive, const Progress& progress = {}, const DriveObserver& observe = {},
                      const recording::Checkpoint* resume = nullptr);

}  // namespace terrode::scenario
