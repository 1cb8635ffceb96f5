// A machine that drives over soft ground, from a YAML file: the machine (ready-made by name, from a file of its own, or
// described in place), the ground, and what it is to do. docs/formats-vehicle.md lists the keys.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/progress.h"
#include "effects/effect.h"
#include "recording/hdf5_file.h"
#include "recording/recording.h"
#include "scenario/machine_file.h"
#include "scenario/scenario.h"
#include "scenario/rocks_file.h"
#include "vehicle/controllers.h"
#include "vehicle/vehicle.h"

namespace terrode::scenario {

struct DriveScenario {
  std::string file, text;
  Scenario base;                                    // soil, laws, terrain settings, surface, effects
  std::string ground = "node-spring";               // or rigid, dem, mpi
  vehicle::VehicleSpec machine;
  vehicle::VehicleOptions options;
  std::vector<vehicle::Manoeuvre> script;  // one of script and waypoints
  std::vector<Eigen::Vector2d> waypoints;  // m
  vehicle::PathFollower::Options path;
  double duration = 60.0;  // s at most

  bool on_particles() const { return ground == "dem" || ground == "mpi"; }
  // Throws InputError for what particles do not know and the engine cannot express; before a bed is settled for nothing.
  void require_particles(const effects::EffectSet& effects) const;
  // A bed of particles is settled first unless it lies in the cache; throws Interrupted when `progress` asks to stop.
  std::unique_ptr<terrain::Terrain> make_ground(const effects::EffectSet& effects, int threads = 1, const Progress& progress = {}) const;
  std::unique_ptr<vehicle::Controller> make_controller() const;
  // Every file that the scenario and its machine name, with a digest of its bytes: with `text`, all that decides a run.
  std::string named_files() const;
  // Where the machine's origin is meant to go [m]: script or waypoints without slip.
  std::vector<Eigen::Vector2d> planned_path() const;
};

// True where a YAML file has a `vehicle` key: it is a drive, not a rig.
bool is_drive(const std::string& path);

// True where it has none but describes a machine (`wheels` or `urdf`).
bool is_machine(const std::string& path);

// Throw InputError with every problem and its place.
DriveScenario load_drive(const std::string& path);
DriveScenario parse_drive(const std::string& text, const std::string& file);

// JSON Schema of such a file.
std::string vehicle_schema();

struct DriveResult {
  recording::Run run;
  std::vector<recording::Run> bodies;  // motion of every body, by id
  std::vector<std::string> events;
  std::vector<vehicle::MarginSample> margins;
  vehicle::RunEnd end = vehicle::RunEnd::none;
  double simulated_seconds = 0.0;
  double energy_per_metre = 0.0;  // J/m of the drives over the path; 0 without a path
  vehicle::VehicleEnergy energy;
};

// A machine on its ground, between the beginning and the end of its scenario.
class DriveRun {
 public:
  // Throws InputError. `drive` must outlive it; `threads` are those of a particle ground.
  explicit DriveRun(const DriveScenario& drive, int threads = 1, const Progress& progress = {});

  // Goes on until `until` [s] or the scenario's end. Throws RunError when the machine is lost, Interrupted when asked
  // to stop; result() then has what there is.
  void run(double until, const Progress& progress = {});
  DriveResult result() const;
  vehicle::Vehicle& vehicle() { return vehicle_; }

  // State between steps as a group of a file, and back: the run goes on bit by bit as if it had never stopped. resume()
  // throws InputError for the state of another scenario.
  void save(recording::Hdf5File& file) const;
  void resume(const recording::Hdf5File& file);
  // As resume(), with the samples taken until then (Vehicle::checkpoint).
  void take_up(const recording::Checkpoint& checkpoint);
  const vehicle::Controller& controller() const { return *controller_; }

 private:
  const DriveScenario& drive_;
  effects::EffectSet effects_;
  vehicle::Vehicle vehicle_;
  std::unique_ptr<vehicle::Controller> controller_;
};

// The whole of it.
DriveResult run_drive(const DriveScenario& drive, const Progress& progress = {});

}  // namespace terrode::scenario
