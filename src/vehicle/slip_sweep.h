// A slip sweep: one wheel at several slips by one or several methods, points spread over threads.
//
// What a point returns is a recording::Run: a time series for the rig (node-spring, dem, any ground), steady values for
// the steady Bekker / Wong-Reece wheel. Averaging a series over whole periods after its transient, with a standard
// error, is analysis::steady_state, which the caller applies: this room knows no statistics. Every point is computed
// from its own inputs alone, so that numbers do not depend on the number of threads or on which other points are asked
// for.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bekker/steady_wheel.h"
#include "core/progress.h"
#include "effects/effect.h"
#include "recording/recording.h"
#include "vehicle/rig.h"

namespace terrode::vehicle {

struct PointResult {
  recording::Run run;
  std::vector<std::string> events;    // what the run has to say, e.g. why it ended early
  std::optional<RigEnergy> energy;    // books of a rig's run, its last pass, touchdown included
  double simulated_seconds = 0.0;     // touchdown included; 0 for a method without time
  std::optional<double> cpu_seconds;  // where the method uses threads of its own; absent: measured by the sweep
};

// A method by name: `steady`, `node-spring`, `dem`, ... `run` is called from several threads at once and throws
// InputError or RunError when a point fails.
struct SweepMethod {
  std::string name;
  std::function<PointResult(const recording::Condition&, const Progress&)> run;
};

struct SweepPoint {
  std::string method;
  recording::Condition condition;
  PointResult result;
  std::string error;         // empty where the point went well
  double cpu_seconds = 0.0;  // processor time that the point took
  double wall_seconds = 0.0;
};

struct SweepOptions {
  int threads = 0;  // 0: all cores
  // Called once for each point as it ends, one at a time but in any order: write it there, and an interrupted sweep can
  // be resumed. What it throws ends the sweep.
  std::function<void(const SweepPoint&)> on_point;
  // False: a point's time series is dropped after on_point, so that memory does not grow with the number of points.
  bool keep_series = true;
  // Points for which this is true are left out (they are there already).
  std::function<bool(const std::string& method, const recording::Condition&)> skip;
};

// Runs every condition by every method. Points come back in order: conditions of the first method, of the second, ...
// A failed point carries its error and the sweep goes on. Throws InputError without methods or conditions, Interrupted
// when asked to stop: points that had ended were given to on_point.
std::vector<SweepPoint> sweep(const std::vector<SweepMethod>& methods,
                              const std::vector<recording::Condition>& conditions, const SweepOptions& options = {},
                              const Progress& progress = {});

// Conditions of one wheel at these slips; a slip of -infinity is a locked wheel dragged at omega r.
std::vector<recording::Condition> conditions_at(const std::vector<double>& slips, double normal_load,
                                                double angular_velocity, double radius);

// The steady wheel as a method named `steady`. Steady values: drawbar_pull, driving_torque, sinkage, normal_load,
// entry_angle, peak_angle, compaction_resistance. `effects` act on soil, wheel, bed and instruments; what varies along
// the bed or in time is taken half way along `travel` [m]. What else `law` points to must outlive the method, or
// `owner` keeps it alive.
SweepMethod steady_method(const bekker::WheelSize& wheel, const bekker::Soil& soil, const bekker::ContactAngles& angles,
                          const effects::EffectSet& effects = {}, const bekker::PointLaw& law = {},
                          const bekker::SteadyOptions& options = {}, double travel = 0.0,
                          std::shared_ptr<const void> owner = nullptr);

// What the laboratory would have recorded of a rig's samples: the believed slip, then what instruments make of it.
// `condition` is what was asked for, `wheel_load` [N] the rig's own where that names none.
void read_instruments(recording::Run& run, const recording::Condition& condition, double wheel_load,
                      const effects::EffectSet& effects, const wheel::Rolling& rim);

// Where unfinished runs are kept, by the condition they are of; earlier passes over the same ground are not kept. Each
// function is called from several threads at once, for different conditions.
struct RunMemory {
  double interval = 30.0;  // s of wall time between two savings
  std::function<std::shared_ptr<const recording::Checkpoint>(const recording::Condition&)> load;  // nothing: not there
  std::function<void(const recording::Condition&, const recording::Checkpoint&)> save;
  std::function<void(const recording::Condition&)> forget;
};

// What may look at a rig while it runs; see Rig::set_observer and Rig::set_touchdown_observer.
struct RigObservers {
  std::function<void(Rig&)> sample, touchdown;
};

// The rig on a ground as a method. `ground` makes a fresh one for each point (called from several threads); load, speed
// and slip of spec and motion are replaced by the condition's. Of `effects` the rig takes what acts on load, slip and
// instruments; those of soil, wheel and bed (EffectSet::for_ground) are for `ground` to build in. A condition's pass
// above 1 runs the earlier passes first, on the same ground from the same start. `observe` sees the last pass;
// with `resume`, a checkpoint of the last pass, a point begins there; with a `memory` the points of a sweep are kept while
// they run and gone on with.
SweepMethod rig_method(const std::string& name, const RigSpec& spec, const RigMotion& motion,
                       std::shared_ptr<const wheel::Body> shape,
                       std::function<std::unique_ptr<terrain::Terrain>(const recording::Condition&)> ground,
                       const effects::EffectSet& effects = {}, const RigObservers& observe = {},
                       std::shared_ptr<const recording::Checkpoint> resume = {}, const RunMemory& memory = {});

}  // namespace terrode::vehicle
