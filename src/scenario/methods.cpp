#include "scenario/methods.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "wheel/wheel.h"

namespace terrode::scenario {

effects::EffectSet effect_set(const Scenario& scenario) {
  std::map<std::string, std::map<std::string, double>> chosen;
  for (const EffectSpec& e : scenario.effects) chosen[e.id] = e.parameters;
  try {
    return effects::EffectSet(chosen);
  } catch (const InputError& e) {
    Problems problems = e.problems();
    for (Problem& p : problems)
      if (p.file.empty()) p.file = scenario.file;
    throw InputError(std::move(problems));
  }
}

vehicle::RigSpec rig_spec(const Scenario& s) {
  vehicle::RigSpec out;
  if (!s.rig.normal_load) throw InputError({s.file, 0, 0, "rig.normal_load", "is missing", {}});
  out.normal_load = *s.rig.normal_load;
  // Without a mass the wheel is light against the load that presses it down.
  out.wheel_mass = s.wheel.mass.value_or(std::min(out.wheel_mass, 0.5 * out.normal_load / s.rig.gravity));
  out.lifted_mass = s.rig.lifted_mass;
  out.carriage_mass = s.rig.carriage_mass;
  out.gravity = s.rig.gravity;
  out.slope = s.rig.slope;
  out.time_step = s.rig.time_step;
  out.sample_interval = s.rig.sample_interval;
  out.ramp_time = s.rig.ramp;
  return out;
}

vehicle::RigMotion rig_motion(const Scenario& s) {
  vehicle::RigMotion out;
  const bool towed = s.rig.mode == "towed";
  out.mode = towed                            ? vehicle::RigMode::towed
             : s.rig.mode == "imposed_pull"   ? vehicle::RigMode::force_controlled
             : s.rig.mode == "pull_ramp"      ? vehicle::RigMode::pull_ramp
                                              : vehicle::RigMode::imposed_slip;
  out.slip = bekker::to_wong_reece(s.rig.slip, s.slip_convention());
  out.angular_velocity = s.rig.angular_velocity;
  const bool locked = out.mode == vehicle::RigMode::imposed_slip && std::isinf(out.slip);
  if (towed || locked) out.forward_velocity = s.rig.angular_velocity * s.wheel.radius;
  if (locked) out.angular_velocity = 0.0;
  out.pull = s.rig.pull;
  out.final_pull = s.rig.final_pull;
  out.distance = s.rig.travel;
  return out;
}

recording::Condition condition_of(const OperatingPoint& at, double radius) {
  recording::Condition c = vehicle::conditions_at({at.slip}, at.normal_load, at.angular_velocity, radius).front();
  c.pass = at.pass;
  return c;
}

std::unique_ptr<terrain::Terrain> make_ground(const std::string& method, const Scenario& scenario,
                                              const recording::Condition&, const MethodSettings&) {
  throw InputError({scenario.file, 0, 0, "method", fmt::format("is '{}', which cannot be computed yet", method), "steady"});
}

vehicle::SweepMethod make_method(const std::string& name, const Scenario& scenario, const MethodSettings& settings) {
  if (name == "steady")
    return vehicle::steady_method(scenario.wheel_size(), scenario.bekker_soil(), scenario.contact_angles(), effect_set(scenario));
  recording::Condition any;
  any.normal_load = scenario.rig.normal_load.value_or(100.0);
  any.angular_velocity = scenario.rig.angular_velocity;
  make_ground(name, scenario, any, settings);  // what is wrong with the ground is said before the first point
  vehicle::RigSpec spec = rig_spec(scenario);
  return vehicle::rig_method(
      name, spec, rig_motion(scenario), std::make_shared<terrode::wheel::Wheel>(scenario.wheel_shape()),
      [name, scenario, settings](const recording::Condition& c) { return make_ground(name, scenario, c, settings); },
      effect_set(scenario));
}

std::optional<double> averaging_period(const std::string& method, const Scenario& scenario, const OperatingPoint& at) {
  if (method == "steady") return std::nullopt;
  const bool locked = std::isinf(at.slip);
  if (scenario.wheel.grouser_count > 0 && !locked)
    return 2.0 * std::numbers::pi / (at.angular_velocity * scenario.wheel.grouser_count);
  const double speed = at.angular_velocity * scenario.wheel.radius * (locked ? 1.0 : 1.0 - at.slip);
  if (method == "node-spring" && speed > 0.0) return scenario.terrain.node_spacing / speed;
  return std::nullopt;
}

}  // namespace terrode::scenario
