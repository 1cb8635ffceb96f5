#include "multibody/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <thread>

#include "core/random.h"

namespace terrode::multibody {
namespace {

// Rounding of a handful of operations on numbers of order one.
constexpr double rounding = 1e-12;

MassProperties brick(double mass = 2.0) { return MassProperties::box(mass, Vec3(0.2, 0.1, 0.1)); }
WorldOptions weightless() { return {Vec3::Zero(), 1e-14, 0.2}; }

// A sled on a rail with a driven, loaded wheel; returns every number that its steps made.
std::vector<double> rolling_rig(std::uint64_t seed, int steps) {
  World world;
  Random random(seed);
  const Twist along{Vec3(0.05, 0, 0), Vec3::Zero()};
  Body& carriage = world.add_body("carriage", brick(5.0), {}, along);
  Body& hub = world.add_body("hub", brick(1.0), {}, along);
  Body& wheel = world.add_body("wheel", MassProperties::cylinder(3.2, 0.12, 0.16), {}, along);
  Slider& rail = world.add_slider("rail", carriage, nullptr, Vec3::UnitX());
  Slider& lift = world.add_slider("lift", hub, &carriage, Vec3::UnitZ());
  Hinge& axle = world.add_hinge("axle", wheel, &hub, Vec3::Zero(), Vec3::UnitY());
  rail.set_motor({0.05});
  axle.set_motor({0.5});
  std::vector<double> out;
  for (int n = 0; n < steps; ++n) {
    wheel.add_wrench({Vec3(10.0 * random.normal(), 0, 41.2 + random.normal()), Vec3(0, random.normal(), 0)});
    world.step(1e-3);
    out.insert(out.end(), {rail.effort(), axle.effort(), lift.position(), wheel.twist().w_W.y()});
  }
  return out;
}

TEST(World, TwoWorldsInTwoThreadsGiveTheSerialNumbers) {
  const std::vector<double> first = rolling_rig(1, 3000), second = rolling_rig(2, 3000);
  std::vector<double> a, b;
  std::thread one([&] { a = rolling_rig(1, 3000); });
  std::thread two([&] { b = rolling_rig(2, 3000); });
  one.join();
  two.join();
  EXPECT_EQ(a, first);
  EXPECT_EQ(b, second);
}

TEST(World, LoadOfAJointThatWasNotSolvedIsZeroAndSaysSo) {
  World world(weightless());
  Body& body = world.add_body("body", brick(), {});
  LinearMotor& hold = world.add_linear_motor("hold", body, {Vec3::UnitX()});
  SoilDamper& damper = world.add_soil_damper("damper", body);
  body.add_wrench({Vec3(37.5, 0, 0), Vec3::Zero()});
  world.step(1e-3);
  EXPECT_TRUE(hold.load().solved);
  EXPECT_NEAR(hold.load().on_body.F_W.x(), -37.5, 1e-8);
  EXPECT_FALSE(damper.load().solved);
  damper.set(Vec3::Zero(), 10.0 * Mat3::Identity());
  world.step(1e-3);
  EXPECT_TRUE(damper.load().solved);
  damper.set(Vec3::Zero(), Mat3::Zero());
  world.step(1e-3);
  EXPECT_FALSE(damper.load().solved);
  EXPECT_EQ(damper.load().on_body.F_W, Vec3(Vec3::Zero()));
}

TEST(World, MotorThatWasTakenAwayReportsNoEffort) {
  World world(weightless());
  Body& body = world.add_body("body", brick(), {});
  Slider& rail = world.add_slider("rail", body, nullptr, Vec3::UnitX());
  rail.set_motor({0.0});
  body.add_wrench({Vec3(37.5, 0, 0), Vec3::Zero()});
  world.step(1e-3);
  EXPECT_NEAR(rail.effort(), -37.5, 1e-8);
  rail.clear_motor();
  world.step(1e-3);
  EXPECT_EQ(rail.effort(), 0.0);
}

TEST(World, SaturatedMotorIsAnErrorUnlessItIsMeant) {
  for (const bool meant : {false, true}) {
    World world(weightless());
    Body& body = world.add_body("body", brick(2.0), {});
    Slider& rail = world.add_slider("rail", body, nullptr, Vec3::UnitX());
    rail.set_motor({0.0, 10.0, meant});
    body.add_wrench({Vec3(37.5, 0, 0), Vec3::Zero()});
    if (!meant) {
      EXPECT_THROW(world.step(1e-3), RunError);
      continue;
    }
    world.step(1e-3);
    EXPECT_TRUE(rail.saturated());
    EXPECT_NEAR(rail.effort(), -10.0, rounding);
    EXPECT_NEAR(body.twist().v_W.x(), 27.5 / 2.0 * 1e-3, rounding);
  }
}

TEST(World, RedundantConstraintsShareTheLoadAndKeepItsSum) {
  World world(weightless());
  Body& body = world.add_body("body", brick(), {});
  Slider& one = world.add_slider("one", body, nullptr, Vec3::UnitX());
  Slider& two = world.add_slider("two", body, nullptr, Vec3::UnitX());
  one.set_motor({0.1});
  two.set_motor({0.1});
  body.set_twist({Vec3(0.1, 0, 0), Vec3::Zero()});
  for (int n = 0; n < 10; ++n) {
    body.add_wrench({Vec3(-37.5, 0, 0), Vec3::Zero()});
    world.step(1e-3);
    EXPECT_NEAR(one.effort(), 18.75, 1e-4);  // CFM against the rounding of a singular system: 1e-6 of the load
    EXPECT_NEAR(one.effort() + two.effort(), 37.5, 1e-8);  // the default CFM's share of the load
  }
  EXPECT_EQ(world.messages(), 0u);
}

TEST(World, MotionOfAJointIsThatOfItsBodyAgainstTheWorld) {
  World world(weightless());
  Body& sled = world.add_body("sled", brick(), {});
  Body& wheel = world.add_body("wheel", MassProperties::cylinder(3.2, 0.12, 0.16), {Vec3(0, 1, 0), Quat::Identity()});
  Slider& rail = world.add_slider("rail", sled, nullptr, Vec3::UnitX());
  Hinge& axle = world.add_hinge("axle", wheel, nullptr, Vec3(0, 1, 0), Vec3::UnitY());
  rail.set_motor({0.3});
  axle.set_motor({0.7});
  for (int n = 0; n < 100; ++n) world.step(1e-2);
  EXPECT_NEAR(sled.twist().v_W.x(), 0.3, rounding);
  EXPECT_NEAR(rail.position(), 0.3, 1e-9);
  EXPECT_NEAR(wheel.twist().w_W.y(), 0.7, rounding);
  EXPECT_NEAR(axle.position(), 0.7, 1e-9);
  EXPECT_NEAR(axle.turned(), 0.7, 1e-9);
}

TEST(World, HingeCountsWholeTurns) {
  World world(weightless());
  Body& wheel = world.add_body("wheel", MassProperties::cylinder(3.2, 0.12, 0.16), {});
  Hinge& axle = world.add_hinge("axle", wheel, nullptr, Vec3::Zero(), Vec3::UnitY());
  axle.set_motor({-20.0});
  for (int n = 0; n < 1000; ++n) world.step(1e-3);
  // Exact rotation in a step: without it the wheel would lag by (omega h)^2/12, 7e-4 rad here. Position repair of the
  // joint leaves some 1e-9.
  EXPECT_NEAR(axle.turned(), -20.0, 1e-7);
}

// ODE ends the program where a number overflows within its step: what flies off is named before.
TEST(World, WhatFliesOffIsNamedBeforeTheSolverSeesIt) {
  WorldOptions options;
  options.gravity = Vec3(0, 5.6e14, 0);
  EXPECT_THROW(World{options}, InputError);
  World world;
  std::vector<double> state = world.snapshot();
  state[4] = 5.6e14;
  EXPECT_THROW(world.restore(state), InputError);
  Body& body = world.add_body("rock", brick(), {}, {});
  for (const auto& twist : {Twist{Vec3(2e9, 0, 0), Vec3::Zero()}, Twist{Vec3::Zero(), Vec3(0, 0, -2e9)}}) {
    body.set_twist(twist);
    EXPECT_THROW(world.step(1e-3), RunError);
  }
  body.set_twist({});
  EXPECT_NO_THROW(world.step(1e-3));
}

TEST(World, NotFiniteInputIsNamedBeforeTheSolverSeesIt) {
  World world;
  Body& wheel = world.add_body("wheel", MassProperties::cylinder(3.2, 0.12, 0.16), {});
  world.step(1e-3);
  wheel.add_wrench({Vec3(0, 0, std::nan("")), Vec3::Zero()});
  try {
    world.step(1e-3);
    FAIL() << "a step with a NaN force went through";
  } catch (const RunError& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("'wheel'"));
    EXPECT_THAT(e.what(), testing::HasSubstr("t = 0.001 s"));
    EXPECT_THAT(e.what(), testing::HasSubstr("external force"));
    EXPECT_THAT(e.what(), testing::HasSubstr("smaller time step"));
  }
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_THROW(wheel.set_twist({Vec3(inf, 0, 0), Vec3::Zero()}), InputError);
  EXPECT_THROW(wheel.set_pose({Vec3(0, std::nan(""), 0), Quat::Identity()}), InputError);
  EXPECT_THROW(world.step(0.0), InputError);
  EXPECT_THROW(world.step(5e-324), InputError);  // whose inverse is infinite
  EXPECT_THROW(world.step(std::nan("")), InputError);
}

TEST(World, OverflowingForceIsRefused) {
  World world;
  Body& wheel = world.add_body("wheel", MassProperties::cylinder(3.2, 0.12, 0.16), {});
  wheel.add_wrench({Vec3(1e200, 0, 0), Vec3::Zero()});
  EXPECT_THROW(world.step(1e-3), RunError);
}

TEST(World, WrongPartsAreRefusedWithEveryProblem) {
  World world, other;
  Body& a = world.add_body("a", brick(), {});
  Body& b = other.add_body("b", brick(), {});
  EXPECT_THROW(world.add_body("a", brick(), {}), InputError);
  EXPECT_THROW(world.add_slider("s", a, &b, Vec3::UnitX()), InputError);
  EXPECT_THROW(world.add_slider("s", a, &a, Vec3::UnitX()), InputError);
  EXPECT_THROW(world.add_slider("s", a, nullptr, Vec3::Zero()), InputError);
  EXPECT_THROW(world.add_linear_motor("m", a, {}), InputError);
  MassProperties flat = brick();
  flat.mass = -1.0;
  flat.inertia_B.diagonal() = Vec3(1.0, 1.0, 3.0);
  try {
    world.add_body("", flat, {});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.problems().size(), 3u);
  }
  WorldOptions bad;
  bad.cfm = -1.0;
  bad.erp = 2.0;
  EXPECT_EQ(bad.validate().size(), 2u);
  EXPECT_THROW(World{bad}, InputError);
}

TEST(World, EffortOfAHingeIsExactWithTheCentreOfMassOffItsAxis) {
  World world;
  const double reach = 0.4, mass = 2.0;
  Body& arm = world.add_body("arm", brick(mass), {Vec3(reach, 0, 0), Quat::Identity()});
  Hinge& pivot = world.add_hinge("pivot", arm, nullptr, Vec3::Zero(), Vec3::UnitY());
  pivot.set_motor({0.0});
  world.step(1e-3);
  // The weight at +x turns the arm about +y by m g reach; the motor holds it.
  EXPECT_NEAR(pivot.effort(), -mass * 9.81 * reach, 1e-8);
}

TEST(World, SpringSettlesWhereItCarriesTheWeight) {
  World world;
  Body& body = world.add_body("body", brick(2.0), {});
  Slider& leg = world.add_slider("leg", body, nullptr, Vec3::UnitZ());
  leg.set_spring(400.0, 60.0, 0.05);
  for (int n = 0; n < 2000; ++n) world.step(1e-3);
  EXPECT_NEAR(leg.position(), 0.05 - 2.0 * 9.81 / 400.0, 1e-9);
  EXPECT_NEAR(leg.effort(), 2.0 * 9.81, 1e-8);
  EXPECT_THROW(leg.set_motor({1.0}), InputError);
}

TEST(World, SoilDamperActsOnTheVelocityAfterTheStep) {
  World world(weightless());
  Body& body = world.add_body("body", brick(2.0), {}, {Vec3(0, 0, -0.3), Vec3::Zero()});
  SoilDamper& soil = world.add_soil_damper("soil", body);
  const double d = 5000.0, h = 1e-3;
  soil.set(Vec3::Zero(), Vec3(0, 0, d).asDiagonal());
  world.step(h);
  const double v = -0.3 / (1.0 + h * d / 2.0);
  EXPECT_NEAR(body.twist().v_W.z(), v, rounding);
  EXPECT_NEAR(soil.load().on_body.F_W.z(), -d * v, 1e-9);
  EXPECT_THROW(soil.set(Vec3::Zero(), Vec3(0, 0, std::nan("")).asDiagonal()), RunError);
  soil.set(Vec3::Zero(), Vec3(0, -1.0, 2.0).asDiagonal());
  EXPECT_EQ(soil.translational(), Mat3(Vec3(0, 0, 2.0).asDiagonal()));
}

// Against the closed form of one implicit step: (M + h A'DA + h R) u1 = M u0, A the velocity of the point.
TEST(World, SoilDamperActsAtItsPointWithAnyMatrix) {
  World world(weightless());
  const Twist before{Vec3(0.3, -0.2, 0.1), Vec3(0.5, -1.0, 0.7)};
  Body& body = world.add_body("body", MassProperties::sphere(2.0, 0.3), {}, before);
  SoilDamper& soil = world.add_soil_damper("soil", body);
  const Vec3 p(0.1, 0.02, -0.3);
  Mat3 B, C;
  B << 20, 3, 1, -4, 9, 2, 5, 1, 30;
  C << 0.3, 0.1, 0, 0, 0.2, 0.1, 0.05, 0, 0.4;
  const Mat3 D = B * B.transpose(), R = C * C.transpose();
  const double h = 1e-3;
  soil.set(p, D, R);
  world.step(h);
  using Mat6 = Eigen::Matrix<double, 6, 6>;
  Eigen::Matrix<double, 3, 6> A;
  Mat3 cross;
  cross << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
  A << Mat3::Identity(), -cross;
  Mat6 mass = Mat6::Identity() * 2.0;
  mass.bottomRightCorner<3, 3>() = body.mass_properties().inertia_B;
  Mat6 resistance = A.transpose() * D * A;
  resistance.bottomRightCorner<3, 3>() += R;
  Eigen::Matrix<double, 6, 1> u;
  u << before.v_W, before.w_W;
  const Eigen::Matrix<double, 6, 1> after = (mass + h * resistance).ldlt().solve(mass * u);
  EXPECT_NEAR((body.twist().v_W - after.head<3>()).norm(), 0.0, rounding);
  EXPECT_NEAR((body.twist().w_W - after.tail<3>()).norm(), 0.0, rounding);
  EXPECT_NEAR((soil.load().on_body.F_W + D * (after.head<3>() + after.tail<3>().cross(p))).norm(), 0.0, 1e-9);
}

// A mass on a stiff spring evaluated at the pose before the step, with the damper that the soil's stiffness asks for:
// no limit on the step, no loss of energy (Newmark's rule).
TEST(World, SoilDamperKeepsAStiffSpringStableAndUndamped) {
  const double k = 1e6, m = 2.0;
  for (const double h : {1e-3, 1e-2}) {  // omega h = 0.7 and 7; explicit stepping ends at 2
    World world(weightless());
    Body& body = world.add_body("body", brick(m), {Vec3(0, 0, 1e-3), Quat::Identity()});
    SoilDamper& soil = world.add_soil_damper("soil", body);
    double largest = 0.0;
    for (int n = 0; n < 5000; ++n) {
      const double d = 0.25 * h * k;
      soil.set(Vec3::Zero(), Vec3(0, 0, d).asDiagonal());
      body.add_wrench({Vec3(0, 0, -k * body.pose().p_W.z() + d * body.twist().v_W.z()), Vec3::Zero()});
      world.step(h);
      if (n > 4000) largest = std::max(largest, std::abs(body.pose().p_W.z()));
    }
    EXPECT_LT(largest, 8e-3) << h;  // the half step's offset of the first velocity raises the amplitude
    EXPECT_GT(largest, 0.9e-3) << h;
  }
}

TEST(World, RestoredWorldGoesOnToTheBit) {
  const auto build = [](World& world) -> Hinge& {
    Body& frame = world.add_body("frame", brick(5.0), {Vec3(0.1, 0.2, 0.3), Quat(0.9, 0.1, 0.3, 0.2).normalized()});
    Body& wheel = world.add_body("wheel", MassProperties::cylinder(3.2, 0.12, 0.16),
                                 {Vec3(0.5, 0.2, 0.3), Quat::Identity()}, {Vec3::Zero(), Vec3(0.3, 2.0, -0.5)});
    Slider& strut = world.add_slider("strut", frame, nullptr, Vec3(0.1, 0.2, 1.0));
    strut.set_spring(300.0, 2.0, 0.0);
    return world.add_hinge("axle", wheel, &frame, Vec3(0.4, 0.2, 0.3), Vec3::UnitY());
  };
  World first, second;
  Hinge& axle = build(first);
  Hinge& axle_again = build(second);
  axle.set_motor({3.0, 0.5, true});
  for (int n = 0; n < 500; ++n) first.step(1e-3);
  const std::vector<double> state = first.snapshot();
  for (int n = 0; n < 500; ++n) first.step(1e-3);
  second.restore(state);
  for (int n = 0; n < 500; ++n) second.step(1e-3);
  EXPECT_EQ(first.snapshot(), second.snapshot());
  EXPECT_EQ(axle.effort(), axle_again.effort());
  EXPECT_EQ(axle.turned(), axle_again.turned());
  EXPECT_THROW(second.restore({1.0, 2.0}), InputError);
  // Numbers that would stop the solver: the first body's orientation is none, or not that of its matrix; a position is no number.
  for (const auto& [at, value] : {std::pair{7 + 3, 0.0}, {7 + 7, -2.0}, {7, std::nan("")}, {2, -1.0}}) {
    std::vector<double> damaged = state;
    for (int i = 0; at == 7 + 3 && i < 4; ++i) damaged[static_cast<std::size_t>(at + i)] = value;
    damaged[static_cast<std::size_t>(at)] = value;
    EXPECT_THROW(second.restore(damaged), InputError) << at;
  }
}

TEST(World, FallingBodyKeepsItsEnergyToFirstOrder) {
  World world;
  Body& body = world.add_body("body", brick(2.0), {Vec3(0, 0, 10), Quat::Identity()});
  const double before = world.mechanical_energy();
  const double h = 1e-3;
  for (int n = 0; n < 1000; ++n) world.step(h);
  EXPECT_NEAR(world.time(), 1.0, 1e-15);
  EXPECT_EQ(world.steps(), 1000u);
  // Semi-implicit steps fall g h t/2 below the parabola: a closed form, held to rounding.
  EXPECT_NEAR(body.pose().p_W.z(), 10.0 - 0.5 * 9.81 - 0.5 * 9.81 * h, 1e-11);
  EXPECT_NEAR(world.mechanical_energy() - before, -0.5 * 2.0 * 9.81 * 9.81 * h, 1e-9);
}

TEST(World, RodKeepsItsLengthAndBallItsPoint) {
  World world;
  Body& bob = world.add_body("bob", brick(1.0), {Vec3(0.5, 0, 0), Quat::Identity()});
  world.add_rod("rod", bob, nullptr, Vec3(0.5, 0, 0), Vec3::Zero());
  Body& link = world.add_body("link", brick(1.0), {Vec3(3.5, 0, 0), Quat::Identity()});
  world.add_ball("ball", link, nullptr, Vec3(3.0, 0, 0));
  for (int n = 0; n < 500; ++n) world.step(1e-3);
  EXPECT_NEAR(bob.pose().p_W.norm(), 0.5, 1e-4);
  EXPECT_LT(bob.pose().p_W.z(), -0.1);
  EXPECT_NEAR((link.pose().p_W + link.pose().R_WB * Vec3(-0.5, 0, 0) - Vec3(3, 0, 0)).norm(), 0.0, 1e-4);
}

TEST(World, FixedBodiesMoveAsOne) {
  World world(weightless());
  Body& a = world.add_body("a", brick(), {});
  Body& b = world.add_body("b", brick(), {Vec3(1, 0, 0), Quat::Identity()});
  world.add_fixed("weld", b, &a);
  a.set_twist({Vec3(0.2, 0, 0), Vec3::Zero()});
  b.set_twist({Vec3(0.2, 0, 0), Vec3::Zero()});
  b.add_wrench({Vec3(0, 0, 4.0), Vec3::Zero()});
  world.step(1e-3);
  EXPECT_NEAR(a.twist().v_W.x(), 0.2, rounding);
  EXPECT_NEAR(2.0 * a.twist().v_W.z() + 2.0 * b.twist().v_W.z(), 4.0 * 1e-3, rounding);
}

}  // namespace
}  // namespace terrode::multibody
