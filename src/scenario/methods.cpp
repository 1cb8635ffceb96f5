#include "scenario/methods.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "scenario/dem_file.h"
#include "scenario/ground.h"
#include "terrain/node_spring.h"
#include "wheel/wheel.h"

namespace terrode::scenario {
namespace {

bekker::SkidShear skid_shear(const Scenario& s) {
  return s.terrain.skid_shear == "along_displacement" ? bekker::SkidShear::along_displacement : bekker::SkidShear::as_printed;
}

}  // namespace

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

terrain::NodeSpringParams node_spring_params(const Scenario& s) {
  using namespace terrain;
  NodeSpringParams out;
  out.spacing = s.terrain.node_spacing;
  out.soil = s.bekker_soil();
  out.angles = s.contact_angles();
  out.distribution = s.terrain.distribution == "sinkage" ? PressureDistribution::sinkage : PressureDistribution::wong_reece;
  out.unloading = s.terrain.unloading == "elastic"           ? Unloading::elastic
                  : s.terrain.unloading == "elastic_plastic" ? Unloading::elastic_plastic
                                                             : Unloading::rigid_plastic;
  out.area = s.terrain.area == "projected" ? NodeArea::projected : NodeArea::arc;
  out.shear_history = s.terrain.shear_history == "ground"        ? ShearHistory::ground
                      : s.terrain.shear_history == "closed_form" ? ShearHistory::closed_form
                                                                 : ShearHistory::rim;
  out.skid_shear = skid_shear(s);
  out.springback = s.terrain.springback;
  out.unloading_k0 = s.terrain.unloading_k0;
  out.unloading_au = s.terrain.unloading_au;
  out.damping = s.terrain.damping;
  out.damping_time = s.terrain.damping_time;
  out.side_wall = s.terrain.side_wall == "hegedus" ? SideWall::hegedus : SideWall::none;
  out.heap_fraction = s.terrain.heap_fraction;
  out.repose_angle = s.terrain.repose_angle;
  out.travel_length = s.rig.travel;
  return out;
}

std::unique_ptr<terrain::NodeSpringTerrain> node_spring_ground(const Scenario& scenario, const effects::EffectSet& effects) {
  GroundLaw law = point_law(scenario);
  law.law.modifiers = effects.modifiers();
  return std::make_unique<terrain::NodeSpringTerrain>(node_spring_params(scenario), law.law, with_bed(scenario.surface, effects),
                                                      soil_field(scenario), std::move(law.owner));
}

std::unique_ptr<terrain::Terrain> make_ground(const std::string& method, const Scenario& scenario,
                                              const effects::EffectSet& effects, const MethodSettings& settings) {
  if (method == "dem" || method == "mpi") refuse_for_particles(scenario, method);
  if (method == "dem") return particle_ground(scenario, effects, settings.threads, settings.progress);
  if (method == "mpi") return liggghts_ground(scenario, effects, settings.threads, settings.progress);
  if (method == "node-spring") return node_spring_ground(scenario, effects);
  throw InputError({scenario.file, 0, 0, "method", fmt::format("is '{}', which has no ground", method), "node-spring, dem or mpi"});
}

vehicle::SweepMethod make_method(const std::string& name, const Scenario& scenario, const MethodSettings& settings) {
  const auto effects = std::make_shared<const effects::EffectSet>(effect_set(scenario));
  if (name == "steady") {
    bekker::SteadyOptions options;
    options.skid_shear = skid_shear(scenario);
    GroundLaw law = placeless_law(scenario);
    return vehicle::steady_method(scenario.wheel_size(), scenario.bekker_soil(), scenario.contact_angles(), *effects, law.law, options,
                                  scenario.rig.travel, std::move(law.owner));
  }
  const auto in_ground = std::make_shared<const effects::EffectSet>(effects->for_ground());
  make_ground(name, scenario, *in_ground, settings);  // what is wrong with the ground is said before the first point
  return vehicle::rig_method(
      name, rig_spec(scenario), rig_motion(scenario), scenario.wheel_body(),
      [name, scenario, settings, in_ground](const recording::Condition&) { return make_ground(name, scenario, *in_ground, settings); },
      *effects, {settings.observe, settings.observe_touchdown}, settings.resume, settings.memory);
}

std::optional<double> averaging_period(const std::string& method, const Scenario& scenario, const OperatingPoint& at) {
  if (method == "steady") return std::nullopt;
  const bool locked = std::isinf(at.slip);
  const int lugs = scenario.wheel.pieces.empty() ? scenario.wheel.grouser_count : scenario.wheel.piece_count;
  if (lugs > 0 && !locked && (scenario.wheel.pieces.empty() || lugs > 1)) return 2.0 * std::numbers::pi / (at.angular_velocity * lugs);
  const double speed = at.angular_velocity * scenario.wheel.radius * (locked ? 1.0 : 1.0 - at.slip);
  if (method == "node-spring" && speed > 0.0) return scenario.terrain.node_spacing / speed;
  return std::nullopt;
}

}  // namespace terrode::scenario
