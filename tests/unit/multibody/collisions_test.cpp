// Bodies that touch each other, against closed forms.
#include "multibody/collisions.h"

#include <gtest/gtest.h>

#include <cmath>

#include "multibody/world.h"

namespace terrode::multibody {
namespace {

constexpr double g = 9.81;

Body& ball(World& world, const std::string& name, double mass, double radius, const Vec3& at) {
  Body& b = world.add_body(name, MassProperties::sphere(mass, radius), {at, Quat::Identity()});
  world.collisions().add(&b, {ShapeKind::sphere, radius, 0.0, {}}, {}, 0);
  return b;
}

void floor_under(World& world, double top = 0.0) {
  world.collisions().add(nullptr, {ShapeKind::box, 0.0, 0.0, Vec3(20, 20, 1)}, {Vec3(0, 0, top - 0.5), Quat::Identity()}, 0);
}

TEST(Collisions, BallRestsWithItsWeight) {
  World world;
  floor_under(world);
  Body& b = ball(world, "ball", 3.0, 0.1, Vec3(0, 0, 0.1));
  for (int i = 0; i < 2000; ++i) world.step(1e-3);
  EXPECT_NEAR(b.contact_load().F_W.z(), 3.0 * g, 1e-9 * 3.0 * g);
  EXPECT_NEAR(b.pose().p_W.z(), 0.1 - 3.0 * g / ContactLaw{}.stiffness, 1e-9);  // its spring's deflection
}

// v^2 = v0^2 - 2 mu g x.
TEST(Collisions, BlockSlidesByCoulombsLaw) {
  for (const double heading : {0.0, 0.6}) {  // friction knows no direction
    World world;
    ContactLaw law;
    law.friction = 0.4;
    world.collisions().set_law(law);
    floor_under(world);
    Body& b = world.add_body("block", MassProperties::box(5.0, Vec3(0.4, 0.4, 0.1)), {Vec3(0, 0, 0.05), Quat::Identity()});
    world.collisions().add(&b, {ShapeKind::box, 0.0, 0.0, Vec3(0.4, 0.4, 0.1)}, {}, 0);
    for (int i = 0; i < 500; ++i) world.step(1e-3);
    b.set_twist({Vec3(std::cos(heading), std::sin(heading), 0.0), Vec3::Zero()});
    const Vec3 from = b.pose().p_W;
    for (int i = 0; i < 1000; ++i) world.step(1e-3);
    // The step is first order: one step's travel of the whole.
    EXPECT_NEAR((b.pose().p_W - from).norm(), 1.0 / (2.0 * 0.4 * g), 2e-3) << heading;
    EXPECT_NEAR(b.twist().v_W.norm(), 0.0, 1e-4) << heading;
  }
}

TEST(Collisions, PushKeepsMomentumAndBooksItsLoss) {
  WorldOptions options;
  options.gravity = Vec3::Zero();
  World world(options);
  Body& a = ball(world, "a", 1.0, 0.1, Vec3(0, 0, 0));
  Body& b = ball(world, "b", 2.0, 0.1, Vec3(0.3, 0.02, 0));
  a.set_twist({Vec3(1, 0, 0), Vec3::Zero()});
  const double before = world.mechanical_energy();
  for (int i = 0; i < 1000; ++i) world.step(5e-4);
  const Vec3 p = a.mass() * a.twist().v_W + b.mass() * b.twist().v_W;
  EXPECT_NEAR((p - Vec3(1, 0, 0)).norm(), 0.0, 1e-12);
  EXPECT_GT(b.twist().v_W.x(), 0.1);
  EXPECT_NEAR(world.collisions().work, before - world.mechanical_energy(), 1e-6 * before);  // gyroscopic terms of spins
}

TEST(Collisions, WheelsOfOneMachineDoNotFeelEachOther) {
  World world;
  Body& a = world.add_body("a", MassProperties::cylinder(1.0, 0.1, 0.1), {Vec3(0, 0, 0), Quat::Identity()});
  Body& b = world.add_body("b", MassProperties::cylinder(1.0, 0.1, 0.1), {Vec3(0.05, 0, 0), Quat::Identity()});
  for (Body* w : {&a, &b}) world.collisions().add(w, {ShapeKind::cylinder, 0.1, 0.1, {}}, {}, 1);
  world.step(1e-3);
  EXPECT_EQ(world.collisions().count(), 0u);
}

// A cylinder stands along its y: it rolls on a floor, and its flat end is its side.
TEST(Collisions, CylinderTouchesAsAWheel) {
  World world;
  floor_under(world);
  Body& w = world.add_body("w", MassProperties::cylinder(4.0, 0.15, 0.3), {Vec3(0, 0, 0.15), Quat::Identity()});
  world.collisions().add(&w, {ShapeKind::cylinder, 0.15, 0.3, {}}, {}, 1);
  for (int i = 0; i < 500; ++i) world.step(1e-3);
  EXPECT_NEAR(w.pose().p_W.z(), 0.15, 1e-3);
  EXPECT_NEAR(w.contact_load().F_W.z(), 4.0 * g, 1e-6 * 4.0 * g);
  w.set_twist({Vec3(0.3, 0, 0), Vec3(0, 0.3 / 0.15, 0)});
  for (int i = 0; i < 1000; ++i) world.step(1e-3);
  EXPECT_NEAR(w.pose().p_W.x(), 0.3, 0.01);
}

TEST(Collisions, RestoredWorldGoesOnToTheBit) {
  const auto make = [](World& world) {
    floor_under(world);
    for (int i = 0; i < 4; ++i) ball(world, "ball" + std::to_string(i), 1.0 + i, 0.1, Vec3(0.15 * i, 0.01 * i, 0.1 + 0.21 * i));
  };
  World first, second;
  make(first);
  make(second);
  for (int i = 0; i < 150; ++i) first.step(1e-3);
  second.restore(first.snapshot());
  for (int i = 0; i < 300; ++i) {
    first.step(1e-3);
    second.step(1e-3);
  }
  EXPECT_EQ(first.snapshot(), second.snapshot());
}

TEST(Collisions, WrongShapesAreRefused) {
  World world;
  EXPECT_THROW(world.collisions().add(nullptr, {ShapeKind::sphere, 0.0, 0.0, {}}, {}, 0), InputError);
  EXPECT_THROW(world.collisions().add(nullptr, {ShapeKind::box, 0.0, 0.0, Vec3(1, 0, 1)}, {}, 0), InputError);
  EXPECT_THROW(world.collisions().add(nullptr, {ShapeKind::cylinder, 1.0, 0.0, {}}, {}, 0), InputError);
  ContactLaw law;
  law.friction = -1.0;
  EXPECT_THROW(world.collisions().set_law(law), InputError);
}

}  // namespace
}  // namespace terrode::multibody
