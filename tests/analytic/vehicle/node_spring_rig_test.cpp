// The node-spring ground under the rig: books of energy, touchdown, the drawbar curve in one run, effects on nodes.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "effects/effect.h"
#include "terrain/node_spring.h"
#include "vehicle/machines.h"
#include "vehicle/rig.h"
#include "vehicle/slip_sweep.h"
#include "vehicle/vehicle.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {
namespace {

constexpr double radius = 0.13, width = 0.16, load = 115.0, omega = 0.2967;

std::shared_ptr<const wheel::Body> paper_wheel() {
  return std::make_shared<wheel::Wheel>(wheel::WheelShape{radius, width, 0.0, {}});
}

terrain::NodeSpringParams coarse() {
  terrain::NodeSpringParams p;
  p.spacing = 0.01;
  return p;
}

Rig make_rig(const RigMotion& motion, const RigSpec& spec = {}) {
  return Rig(spec, motion, paper_wheel(), std::make_unique<terrain::NodeSpringTerrain>(coarse()));
}

struct Means {
  double pull = 0, torque = 0, sinkage = 0;
};

Means last_part(Rig& rig, double seconds) {
  rig.touch_down();
  std::vector<RigSample> samples;
  while (!rig.finished()) {
    rig.step();
    samples.push_back(rig.last());
  }
  Means m;
  int n = 0;
  for (const RigSample& s : samples) {
    if (s.time < samples.back().time - seconds) continue;
    m.pull += s.drawbar_pull;
    m.torque += s.driving_torque;
    m.sinkage += s.sinkage;
    ++n;
  }
  m.pull /= n;
  m.torque /= n;
  m.sinkage /= n;
  return m;
}

TEST(NodeSpringRig, MeetsTheSteadyWheelThroughTheMultipliers) {
  for (const double slip : {0.1, 0.5}) {
    RigMotion motion;
    motion.slip = slip;
    motion.angular_velocity = omega;
    motion.duration = 5.0;
    Rig rig = make_rig(motion);
    const Means m = last_part(rig, 1.0);
    bekker::Operating op;
    op.slip = slip;
    op.angular_velocity = omega;
    op.normal_load = load;
    const auto s = bekker::SteadyWheel({radius, width}, {}, {}).solve(op);
    constexpr double close = 0.02;
    EXPECT_NEAR(m.pull, s.drawbar_pull, close * s.drawbar_pull);
    EXPECT_NEAR(m.torque, s.driving_torque, close * s.driving_torque);
    EXPECT_NEAR(m.sinkage, s.sinkage, close * s.sinkage);
  }
}

TEST(NodeSpringRig, BooksOfEnergyClose) {
  for (const double slip : {-0.3, 0.0, 0.3, 0.7}) {
    RigMotion motion;
    motion.slip = slip;
    motion.angular_velocity = omega;
    motion.duration = 4.0;
    Rig rig = make_rig(motion);
    last_part(rig, 1.0);
    const RigEnergy e = rig.energy();
    constexpr double audit = 1e-3;  // of the work put in
    EXPECT_NEAR(e.machine_residual(), 0.0, audit * e.drive) << slip;
    EXPECT_NEAR(e.ground_residual(), 0.0, audit * e.ground) << slip;
    EXPECT_GT(e.plastic, 0.0);
    EXPECT_GT(e.slip, 0.0);
  }
}

TEST(NodeSpringRig, PlasticWorkIsThatOfTheRut) {
  // Where pressure is that of depth alone, the work of the normal stress is what it takes to press the rut, node by node:
  // the integral of p dz over its area. The books come from forces and speeds, this from what the ground remembers.
  terrain::NodeSpringParams params = coarse();
  params.spacing = 0.005;
  params.distribution = terrain::PressureDistribution::sinkage;
  constexpr double odd = 0.155;  // m: the rim covers whole cells
  RigMotion motion;
  motion.slip = 0.3;
  motion.angular_velocity = omega;
  motion.duration = 8.0;
  auto ground = std::make_unique<terrain::NodeSpringTerrain>(params);
  const terrain::NodeSpringTerrain* nodes = ground.get();
  Rig rig(RigSpec{}, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{radius, odd, 0.0, {}}), std::move(ground));
  rig.touch_down();
  const auto pressed = [&] {
    double work = 0.0;
    for (const terrain::Tile* tile : nodes->grid().sorted_tiles())
      for (const terrain::Node& n : tile->nodes) {
        const double z = std::max(n.plastic, n.reached);
        if (z > 0) work += params.spacing * params.spacing * params.soil.k * z / (params.soil.n + 1) * std::pow(z / params.soil.plate_width, params.soil.n);
      }
    return work;
  };
  while (rig.last().time < 3.0) rig.step();
  const RigEnergy before = rig.energy();
  const double rut = pressed();
  while (!rig.finished()) rig.step();
  const RigEnergy after = rig.energy();
  const double booked = after.plastic + after.stored - before.plastic - before.stored;
  constexpr double close = 0.01;
  EXPECT_NEAR(booked, pressed() - rut, close * booked);
  EXPECT_LT(std::abs(after.audit()), 1e-3);
  EXPECT_GT(after.work_in(), after.plastic);
}

TEST(NodeSpringRig, LongStepsOnStiffReleaseGainNoEnergy) {
  // A car's wheel: h^2 K/m of the release is 3 at 2e-3 s, three times what an explicit step bears.
  RigSpec spec;
  spec.normal_load = 2900.0;
  spec.wheel_mass = 20.0;
  spec.lifted_mass = 60.0;
  spec.time_step = 2e-3;
  RigMotion motion;
  motion.slip = 0.2;
  motion.angular_velocity = omega;
  motion.duration = 2.0;
  terrain::NodeSpringParams params = coarse();
  params.spacing = 0.02;
  Rig rig(spec, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{0.32, 0.22, 0.0, {}}),
          std::make_unique<terrain::NodeSpringTerrain>(params));
  rig.touch_down();
  double lowest = 1e300, highest = 0.0;
  while (!rig.finished()) {
    rig.step();
    if (rig.last().time < 1.0) continue;
    lowest = std::min(lowest, rig.last().normal_load);
    highest = std::max(highest, rig.last().normal_load);
  }
  constexpr double ripple = 0.01;  // of the load
  EXPECT_LT(0.5 * (highest - lowest), ripple * spec.normal_load);
  const RigEnergy e = rig.energy();
  constexpr double audit = 1e-3;   // of the work put in
  EXPECT_NEAR(e.machine_residual(), 0.0, audit * e.drive);
  EXPECT_GT(e.numerical, 0.0);     // taken, not given
  constexpr double taken = 0.03;   // of the work on the ground, touchdown included
  EXPECT_LT(e.numerical, taken * e.ground);
}

struct Loads {
  double wandering = 0.0;  // standard deviation of a wheel's load over its mean, the worst wheel
  double sides = 0.0;      // largest difference of the means of left and right over their mean
  double drift = 0.0;      // m across the heading
};

// A machine that stands or drives straight on over level soft ground at the default step.
Loads level_travel(const std::string& name, double heading, double speed, double before, double seconds) {
  VehicleOptions options;
  options.start_heading = heading;
  options.start_y = 0.0033;
  Vehicle v(machine(name), options, std::make_unique<terrain::NodeSpringTerrain>(coarse()));
  v.settle();
  const auto& contacts = v.simulation().contacts();
  std::vector<double> mean(contacts.size()), square(contacts.size());
  const auto steps = [&](double t) { return static_cast<int>(std::lround(t / options.time_step)); };
  for (int i = 0; i < steps(before + seconds); ++i) {
    v.drive_path(speed, 0.0);
    v.step();
    if (i < steps(before)) continue;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      const double F = contacts[k].wrench.F_W.z();
      mean[k] += F / steps(seconds);
      square[k] += F * F / steps(seconds);
    }
  }
  Loads out;
  std::map<std::string, double> by_name;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    out.wandering = std::max(out.wandering, std::sqrt(std::max(0.0, square[k] - mean[k] * mean[k])) / mean[k]);
    by_name[v.spec().wheels[k].name] = mean[k];
  }
  for (const auto& [wheel, load_here] : by_name) {
    const auto at = wheel.find("left");
    if (at == std::string::npos) continue;
    const double other = by_name.at(std::string(wheel).replace(at, 4, "right"));
    out.sides = std::max(out.sides, 2 * std::abs(load_here - other) / (load_here + other));
  }
  const Vec3 p = v.last().pose.p_W;
  out.drift = -p.x() * std::sin(heading) + (p.y() - options.start_y) * std::cos(heading);
  return out;
}

TEST(NodeSpringVehicle, StandsStill) {
  for (const char* name : {"skid-steer-robot", "two-axle-car"})
    for (const double heading : {0.0, 0.3}) {
      const Loads l = level_travel(name, heading, 0.0, 0.2, 0.5);
      constexpr double still = 0.01;  // no wheel chatters
      EXPECT_LT(l.wandering, still) << name << " " << heading;
    }
}

TEST(NodeSpringVehicle, ASymmetricMachineTravelsSymmetrically) {
  for (const char* name : {"rocker-bogie-rover", "skid-steer-robot"}) {
    // Along the lattice both sides meet the same nodes: what rounding starts does not grow.
    const Loads along = level_travel(name, 0.0, 0.1, 1.0, 1.0);
    EXPECT_LT(along.sides, 1e-5) << name;
    EXPECT_LT(std::abs(along.drift), 1e-7) << name;
    // Turned, each side has its own nodes. The six driven wheels of the rover share its pull by differences of slip far
    // below what a lattice resolves, so that only its way is held to the mirror there.
    const Loads turned = level_travel(name, 0.3, 0.1, 1.0, 1.0);
    constexpr double ripple = 0.01;  // of a wheel's load, as for one wheel
    if (std::string(name) == "skid-steer-robot") {
      EXPECT_LT(turned.sides, ripple);
    }
    EXPECT_LT(std::abs(turned.drift), 1e-3) << name;
  }
}

TEST(NodeSpringRig, TouchesDownWithoutAJolt) {
  RigMotion motion;
  Rig rig = make_rig(motion);
  rig.touch_down();
  double highest = 0.0;
  for (int n = 0; n < 300; ++n) {
    rig.step();
    highest = std::max(highest, rig.last().normal_load);
  }
  constexpr double jolt = 0.05;  // of the load
  EXPECT_LT(highest, (1 + jolt) * load);
}

TEST(NodeSpringRig, ARampOfPullDrawsTheCurveOfTheSweep) {
  RigMotion motion;
  motion.mode = RigMode::pull_ramp;
  motion.angular_velocity = omega;
  motion.pull = 0.0;
  motion.final_pull = 56.5;
  motion.duration = 60.0;
  Rig rig = make_rig(motion);
  rig.touch_down();
  std::vector<RigSample> curve;
  while (!rig.finished()) {
    rig.step();
    if (rig.last().time > 8.0) curve.push_back(rig.last());
  }
  ASSERT_GT(curve.size(), 1000u);
  int compared = 0;
  for (const double slip : {-0.002, 0.0, 0.02}) {
    double pull = 0, n = 0;
    for (const RigSample& s : curve)
      if (std::abs(s.slip - slip) < 0.002) {
        pull += s.drawbar_pull;
        ++n;
      }
    if (n < 20) continue;
    ++compared;
    RigMotion one;
    one.slip = slip;
    one.angular_velocity = omega;
    one.duration = 5.0;
    Rig single = make_rig(one);
    constexpr double close = 0.05;  // of the load: the ramp passes through, the sweep stays
    EXPECT_NEAR(pull / n, last_part(single, 1.0).pull, close * load) << slip;
  }
  EXPECT_GE(compared, 1);
}

TEST(NodeSpringRig, EffectsOfSoilAndWheelActOnTheNodesAsOnTheSteadyWheel) {
  // Effects that vary along the travel, with time or with the wheel's angle are compared by their own tests.
  const std::set<std::string> varying = {"density_gradient", "run_in", "wall_effect", "periodic_failure", "grousers", "bed_drift",
                                         "undulation",
                                         "penetration_rate"};  // no wheel comes to rest on it: the slower, the softer
  int compared = 0;
  for (const auto& type : effects::all_effects()) {
    const std::string id(type.info->id);
    const auto cls = type.info->cls;
    if (varying.contains(id) || cls == effects::Class::rig || cls == effects::Class::numerics || cls == effects::Class::bed) continue;
    // The typical rebound would lift the ground above its own surface, which nodes do not do.
    std::map<std::string, double> parameters;
    if (id == "unloading") parameters["k0"] = 2e7;
    const effects::EffectSet set(std::map<std::string, std::map<std::string, double>>{{id, parameters}});
    if (set.modifiers().empty()) continue;
    unsigned hooks = 0;
    for (const auto* m : set.modifiers()) hooks |= m->hooks();
    if (hooks == 0) continue;
    ++compared;
    bekker::PointLaw law;
    law.modifiers = set.modifiers();
    bekker::Operating op;
    op.slip = 0.3;
    op.angular_velocity = omega;
    op.normal_load = load;
    const auto s = bekker::SteadyWheel({radius, width}, {}, {}, law).solve(op);
    const auto plain = bekker::SteadyWheel({radius, width}, {}, {}).solve(op);
    RigMotion motion;
    motion.slip = 0.3;
    motion.angular_velocity = omega;
    motion.duration = 6.0;
    Rig rig(RigSpec{}, motion, paper_wheel(), std::make_unique<terrain::NodeSpringTerrain>(coarse(), law));
    const Means m = last_part(rig, 1.0);
    constexpr double close = 0.03;  // of the load, the load times radius, and the sinkage
    EXPECT_NEAR(m.pull, s.drawbar_pull, close * load) << id << " (without: " << plain.drawbar_pull << ")";
    EXPECT_NEAR(m.torque, s.driving_torque, close * load * radius) << id << " (without: " << plain.driving_torque << ")";
    EXPECT_NEAR(m.sinkage, s.sinkage, close * s.sinkage) << id << " (without: " << plain.sinkage << ")";
  }
  EXPECT_GE(compared, 12);
}

TEST(NodeSpringRig, ASweepOnTwoThreadsIsTheSweepOnOne) {
  RigMotion motion;
  motion.duration = 0.6;
  const auto method = rig_method("node-spring", {}, motion, paper_wheel(),
                                 [](const recording::Condition&) { return std::make_unique<terrain::NodeSpringTerrain>(coarse()); });
  SweepOptions one, two;
  one.threads = 1;
  two.threads = 2;
  const auto conditions = conditions_at({0.0, 0.2, 0.4}, load, omega, radius);
  const auto a = sweep({method}, conditions, one), b = sweep({method}, conditions, two);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_TRUE(a[i].error.empty()) << a[i].error;
    const auto &x = a[i].result.run.channels, &y = b[i].result.run.channels;
    ASSERT_EQ(x.size(), y.size());
    for (std::size_t k = 0; k < x.size(); ++k) EXPECT_EQ(x[k].values, y[k].values);
  }
}

}  // namespace
}  // namespace terrode::vehicle
