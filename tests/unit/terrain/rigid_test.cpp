#include "terrain/rigid.h"

#include <gtest/gtest.h>

#include "wheel/wheel.h"

namespace terrode {
namespace {

TEST(RigidGround, PushesBackAndHoldsByFriction) {
  terrain::RigidGroundParams params;
  params.stiffness = 1e5;
  params.damping = 0.0;
  params.friction = 0.5;
  terrain::RigidTerrain ground(params);
  const auto id = ground.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{0.13, 0.16, 0.0, {}}));
  Pose pose;
  pose.p_W.z() = 0.129;
  Twist twist;
  twist.w_W = Vec3(0, 10, 0);
  ground.begin_step(0, 1e-3);
  const auto r = ground.wrench(id, pose, twist);
  ground.end_step();
  EXPECT_NEAR(r.wrench.F_W.z(), 100.0, 1e-9);
  EXPECT_NEAR(r.wrench.F_W.x(), 50.0, 1e-9);  // a driven rim slides backwards: thrust
  EXPECT_NEAR(r.wrench.M_W.y(), -0.13 * 50.0, 1e-9);
  EXPECT_NEAR(r.slip_power, 50.0 * 1.3, 1e-9);
  ground.begin_step(0, 1e-3);
  pose.p_W.z() = 0.14;
  EXPECT_EQ(ground.wrench(id, pose, twist).wrench.F_W.norm(), 0.0);
  ground.end_step();
  terrain::RigidGroundParams bad;
  bad.stiffness = -1;
  bad.friction = -1;
  EXPECT_EQ(bad.validate().size(), 2u);
}

}  // namespace
}  // namespace terrode
