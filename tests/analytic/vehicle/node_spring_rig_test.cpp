// The node-spring ground under the rig: books of energy, touchdown, the drawbar curve in one run, effects on nodes.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "effects/effect.h"
#include "terrain/node_spring.h"
#include "vehicle/rig.h"
#include "vehicle/slip_sweep.h"
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
