// From a scenario to what computes it: effects, rig, ground, and the methods of a slip sweep by name.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "effects/effect.h"
#include "scenario/scenario.h"
#include "terrain/node_spring.h"
#include "terrain/terrain.h"
#include "vehicle/rig.h"
#include "vehicle/slip_sweep.h"

namespace terrode::scenario {

// The effects that the scenario switches on. Throws InputError (an unknown effect or parameter, a value out of bounds).
effects::EffectSet effect_set(const Scenario& scenario);

// The rig and its motion as the simulation takes them; load, speed and slip are those of single runs (rig.slip).
vehicle::RigSpec rig_spec(const Scenario& scenario);
vehicle::RigMotion rig_motion(const Scenario& scenario);

struct MethodSettings {
  int threads = 1;  // that one point may use itself
  vehicle::RunMemory memory;  // where unfinished runs are kept
  Progress progress;  // of what is made ready once, such as a settled bed
  std::function<void(vehicle::Rig&)> observe_touchdown;  // Rig::set_touchdown_observer
  std::function<void(vehicle::Rig&)> observe;  // sees a run at time zero and after every sample; where points run in
                                               // parallel it is called from several threads
  std::shared_ptr<const recording::Checkpoint> resume;  // of a run that was cut off: the run begins there
};

// A method made ready for this scenario. Throws InputError where the scenario lacks what the method needs, or the
// method is not known.
vehicle::SweepMethod make_method(const std::string& name, const Scenario& scenario, const MethodSettings& settings = {});

// The node-spring ground's settings with the scenario's soil in them.
terrain::NodeSpringParams node_spring_params(const Scenario& scenario);

// The node-spring ground of a scenario: soil and how it varies, laws, shape; `effects` must outlive it.
std::unique_ptr<terrain::NodeSpringTerrain> node_spring_ground(const Scenario& scenario, const effects::EffectSet& effects);

// A fresh ground for a method that simulates in time ("node-spring", ...). What `effects` changes of soil and bed is
// built in; it must outlive the ground.
std::unique_ptr<terrain::Terrain> make_ground(const std::string& method, const Scenario& scenario,
                                              const effects::EffectSet& effects, const MethodSettings& settings = {});

// The period over whose multiples a run's means are best taken [s]: the passing of a lug or of a ground node, or
// nothing where the method has neither.
std::optional<double> averaging_period(const std::string& method, const Scenario& scenario, const OperatingPoint& at);

// As the sweep of the vehicle room takes it.
recording::Condition condition_of(const OperatingPoint& at, double radius);

}  // namespace terrode::scenario
