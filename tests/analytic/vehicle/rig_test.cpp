// The single-wheel rig against closed forms: on rigid ground with friction, and under forces known in advance.
#include "vehicle/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "terrain/rigid.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {
namespace {

constexpr double radius = 0.13, width = 0.16, load = 115.0;

// What the default CFM (a joint gives way by 1e-14 of its load) leaves of a force that changes every step.
constexpr double multiplier_tolerance = 1e-8;
// Transients of touchdown and ramp have died down to this share of the load at the end of the runs below.
constexpr double settled_tolerance = 1e-6;

std::shared_ptr<const wheel::Body> paper_wheel() {
  wheel::WheelShape shape;
  shape.radius = radius;
  shape.width = width;
  return std::make_shared<wheel::Wheel>(shape);
}

// Pushes back with the load and pulls with forces that are known at each time, wherever the wheel is.
class KnownForce final : public terrain::Terrain {
 public:
  static double fx(double t) { return t < 0.4 ? 0.0 : -37.5 + 20.0 * std::sin(12.0 * t) + 3.0 * std::cos(210.0 * t); }
  static double ty(double t) { return t < 0.4 ? 0.0 : -4.2 + 2.0 * std::cos(9.0 * t) - 0.7 * std::sin(170.0 * t); }
  terrain::BodyId add_body(std::shared_ptr<const wheel::Body>) override { return 0; }
  terrain::Sampling sampling() const override { return terrain::Sampling::point_value; }
  void begin_step(double t, double) override { t_ = t; }
  void set_motion(terrain::BodyId, const Pose&, const Twist&) override {}
  terrain::ContactResult wrench(terrain::BodyId, const Pose&, const Twist&) override {
    terrain::ContactResult r;
    r.wrench = {Vec3(fx(t_), 0.0, load), Vec3(0.0, ty(t_), 0.0)};
    asked_at.push_back(t_);
    return r;
  }
  void end_step() override { ++ended; }
  double height(double, double) const override { return 0.0; }
  double undisturbed_height(double, double) const override { return 0.0; }
  std::vector<std::uint8_t> snapshot() const override { return {}; }
  void restore(std::span<const std::uint8_t>) override {}
  std::string name() const override { return "known"; }

  std::vector<double> asked_at;
  std::size_t ended = 0;

 private:
  double t_ = 0.0;
};

TEST(Rig, KnownLoadComesBackThroughRampAndRun) {
  for (const double h : {1e-3, 1e-4}) {
    RigSpec spec;
    spec.time_step = h;
    RigMotion motion;
    motion.slip = 0.3;
    motion.angular_velocity = 2.0;
    motion.duration = 0.5;
    auto ground = std::make_unique<KnownForce>();
    const KnownForce& known = *ground;
    Rig rig(spec, motion, paper_wheel(), std::move(ground));
    rig.touch_down();
    const double t0 = rig.simulation().time();
    while (!rig.finished()) {
      rig.step();
      const double t = t0 + rig.last().time;
      ASSERT_NEAR(known.asked_at.back(), t, 1e-12);
      ASSERT_NEAR(rig.last().drawbar_pull, KnownForce::fx(t), multiplier_tolerance * 60.0) << t;
      ASSERT_NEAR(rig.last().driving_torque, -KnownForce::ty(t), multiplier_tolerance * 6.0) << t;
    }
    EXPECT_EQ(known.ended, known.asked_at.size());
    EXPECT_NEAR(rig.last().forward_velocity, 2.0 * radius * 0.7, 1e-9);
    EXPECT_NEAR(rig.last().slip, 0.3, 1e-9);
  }
}

struct Ground {
  terrain::RigidGroundParams params;
  double friction_force(double sliding) const {
    return params.friction * load * std::tanh(sliding / params.sliding_scale);
  }
  double sliding(double force) const { return params.sliding_scale * std::atanh(force / (params.friction * load)); }
};

Rig make_rig(const RigSpec& spec, const RigMotion& motion) {
  return Rig(spec, motion, paper_wheel(), std::make_unique<terrain::RigidTerrain>(Ground{}.params));
}

void run_to_end(Rig& rig) {
  while (!rig.finished()) rig.step();
}

TEST(Rig, ImposedSlipOnRigidGroundMeetsCoulombFriction) {
  for (const double slip : {-0.7, -0.1, 0.0, 0.01, 0.3, 1.0}) {
    RigMotion motion;
    motion.slip = slip;
    motion.duration = 1.0;
    Rig rig = make_rig({}, motion);
    run_to_end(rig);
    const Ground ground;
    const double force = ground.friction_force(motion.angular_velocity * radius * slip);
    EXPECT_NEAR(rig.last().drawbar_pull, force, settled_tolerance * load) << slip;
    EXPECT_NEAR(rig.last().driving_torque, force * radius, settled_tolerance * load * radius) << slip;
    EXPECT_NEAR(rig.last().normal_load, load, settled_tolerance * load) << slip;
    EXPECT_NEAR(rig.last().sinkage, load / ground.params.stiffness, 1e-9) << slip;
  }
}

TEST(Rig, LockedWheelIsDraggedAgainstFullFriction) {
  RigMotion motion;
  motion.angular_velocity = 0.0;
  motion.forward_velocity = 0.05;
  motion.duration = 1.0;
  Rig rig = make_rig({}, motion);
  const recording::Run run = rig.run();
  EXPECT_TRUE(std::isinf(run.condition.slip));
  EXPECT_NEAR(rig.last().drawbar_pull, -0.6 * load, settled_tolerance * load);
  EXPECT_NEAR(rig.last().driving_torque, -0.6 * load * radius, settled_tolerance * load);
}

TEST(Rig, TowedWheelRollsFreely) {
  RigMotion motion;
  motion.mode = RigMode::towed;
  motion.forward_velocity = 0.05;
  motion.duration = 3.0;
  Rig rig = make_rig({}, motion);
  run_to_end(rig);
  EXPECT_NEAR(rig.last().angular_velocity, 0.05 / radius, 1e-6);
  EXPECT_NEAR(rig.last().driving_torque, 0.0, settled_tolerance * load * radius);
  EXPECT_NEAR(rig.last().drawbar_pull, 0.0, settled_tolerance * load);
}

TEST(Rig, BearingFrictionOfATowedWheelIsItsRollingResistance) {
  RigSpec spec;
  spec.bearing_torque = 1.3;
  RigMotion motion;
  motion.mode = RigMode::towed;
  motion.forward_velocity = 0.05;
  motion.duration = 3.0;
  Rig rig = make_rig(spec, motion);
  run_to_end(rig);
  const double force = 1.3 / radius;
  EXPECT_NEAR(rig.last().drawbar_pull, -force, settled_tolerance * load);
  EXPECT_NEAR(rig.last().driving_torque, -1.3, settled_tolerance * load * radius);
  EXPECT_NEAR(rig.last().angular_velocity, (0.05 - Ground{}.sliding(force)) / radius, 1e-6);
}

TEST(Rig, ForceControlledWheelSlipsAsItsPullAsks) {
  RigMotion motion;
  motion.mode = RigMode::force_controlled;
  motion.pull = 30.0;
  motion.duration = 3.0;
  Rig rig = make_rig({}, motion);
  run_to_end(rig);
  EXPECT_NEAR(rig.last().drawbar_pull, 30.0, settled_tolerance * load);
  EXPECT_NEAR(rig.last().forward_velocity, motion.angular_velocity * radius - Ground{}.sliding(30.0), 1e-7);
  EXPECT_TRUE(rig.events().empty());
}

TEST(Rig, PullBeyondFrictionEndsTheRunWithItsReason) {
  RigMotion motion;
  motion.mode = RigMode::force_controlled;
  motion.pull = 80.0;  // friction holds 69 N
  motion.duration = 3.0;
  Rig rig = make_rig({}, motion);
  run_to_end(rig);
  ASSERT_EQ(rig.events().size(), 1u);
  EXPECT_THAT(rig.events().front(), testing::HasSubstr("cannot hold"));
  EXPECT_GT(rig.last().slip, motion.slip_limit);
}

TEST(Rig, PullRampDrawsTheSlipCurveOfTheGround) {
  RigMotion motion;
  motion.mode = RigMode::pull_ramp;
  motion.pull = -40.0;
  motion.final_pull = 60.0;
  motion.duration = 10.0;
  Rig rig = make_rig({}, motion);
  const Ground ground;
  while (!rig.finished()) {
    rig.step();
    const RigSample& s = rig.last();
    if (s.time < 1.0) continue;
    const double rim = s.angular_velocity * radius;
    ASSERT_NEAR(s.drawbar_pull, ground.friction_force(rim - s.forward_velocity), 1e-3 * load) << s.time;
  }
  EXPECT_NEAR(rig.last().drawbar_pull, 60.0, 0.1);
}

TEST(Rig, TouchdownIsGentle) {
  RigMotion motion;
  Rig rig = make_rig({}, motion);
  rig.touch_down();
  const RigSample down = rig.last();
  EXPECT_NEAR(down.normal_load, load, RigSpec{}.touchdown_tolerance * load);
  double highest = 0.0;
  for (int n = 0; n < 500; ++n) {
    rig.step();
    highest = std::max(highest, std::abs(rig.last().normal_load - load));
  }
  EXPECT_LT(highest, 2.0 * RigSpec{}.touchdown_tolerance * load);
}

TEST(Rig, SlopeTakesNothingFromTheDrawbarPull) {
  RigSpec spec;
  spec.slope = 0.2;
  RigMotion motion;
  motion.slip = 0.3;
  motion.duration = 1.0;
  Rig rig = make_rig(spec, motion);
  run_to_end(rig);
  EXPECT_NEAR(rig.last().drawbar_pull, 0.6 * load, settled_tolerance * load);
  EXPECT_NEAR(rig.last().normal_load, load, settled_tolerance * load);
}

TEST(Rig, EnergyBooksClose) {
  RigMotion motion;
  motion.slip = 0.3;
  motion.duration = 3.0;
  Rig rig = make_rig({}, motion);
  run_to_end(rig);
  const RigEnergy e = rig.energy();
  EXPECT_GT(e.ground, 1.0);
  EXPECT_NEAR(e.machine_residual(), 0.0, 1e-6 * e.ground);
}

TEST(Rig, RestoredRigGoesOnToTheBit) {
  RigMotion motion;
  motion.slip = 0.05;
  Rig first = make_rig({}, motion), second = make_rig({}, motion);
  for (int n = 0; n < 300; ++n) first.step();
  const RigState state = first.snapshot();
  for (int n = 0; n < 300; ++n) first.step();
  second.restore(state);
  for (int n = 0; n < 300; ++n) second.step();
  EXPECT_EQ(first.last().drawbar_pull, second.last().drawbar_pull);
  EXPECT_EQ(first.snapshot().simulation.world, second.snapshot().simulation.world);
  EXPECT_EQ(first.snapshot().numbers, second.snapshot().numbers);
}

TEST(Rig, SamplesAreMeansOverTheirInterval) {
  RigSpec fine, coarse;
  fine.sample_interval = 0.0;
  coarse.sample_interval = 10e-3;
  RigMotion motion;
  motion.duration = 0.5;
  const recording::Run a = make_rig(fine, motion).run(), b = make_rig(coarse, motion).run();
  ASSERT_EQ(a.time.size(), 1000u);
  ASSERT_EQ(b.time.size(), 100u);
  const auto& drawbar = a.find(recording::channel::drawbar_pull)->values;
  double mean = 0.0;
  for (std::size_t i = 300; i < 310; ++i) mean += drawbar[i] / 10.0;
  EXPECT_NEAR(b.find(recording::channel::drawbar_pull)->values[30], mean, 1e-9);
  EXPECT_NEAR(b.time[30], 0.3045, 1e-12);
  for (const recording::Channel& c : a.channels)
    for (const double v : c.values) ASSERT_TRUE(std::isfinite(v)) << c.name;
}

TEST(Rig, WrongInputNamesEveryProblem) {
  RigSpec spec;
  spec.wheel_mass = -1.0;
  spec.time_step = 0.0;
  RigMotion motion;
  motion.slip = 1.5;
  motion.distance = -1.0;
  try {
    make_rig(spec, motion);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.problems().size(), 4u);
  }
  EXPECT_THROW(Rig({}, {}, paper_wheel(), nullptr), InputError);
  EXPECT_THROW(Rig({}, {}, wheel::make_box(1, 1, 1), std::make_unique<terrain::RigidTerrain>()), InputError);
  RigMotion towed;
  towed.mode = RigMode::towed;
  EXPECT_THROW(make_rig({}, towed), InputError);
}

TEST(Rig, SoftGroundThatCarriesNothingIsAnError) {
  terrain::RigidGroundParams soft;
  soft.stiffness = 100.0;
  Rig rig({}, {}, paper_wheel(), std::make_unique<terrain::RigidTerrain>(soft));
  try {
    rig.touch_down();
    FAIL();
  } catch (const RunError& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("buried"));
  }
}

TEST(Rig, StopsWhenAsked) {
  Rig rig = make_rig({}, {});
  Progress progress;
  progress.stop_requested = [] { return true; };
  EXPECT_THROW(rig.run(progress), Interrupted);
}

}  // namespace
}  // namespace terrode::vehicle
