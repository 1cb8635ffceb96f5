#include "vehicle/rocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "terrain/node_spring.h"
#include "terrain/rigid.h"
#include "vehicle/controllers.h"
#include "vehicle/machines.h"

namespace terrode::vehicle {
namespace {

RockField field() {
  RockField f;
  f.count = 300;
  f.x1 = f.y1 = 20.0;
  f.smallest = 0.05;
  f.largest = 0.5;
  f.clear_x = f.clear_y = 10.0;
  f.clear_radius = 2.0;
  return f;
}

TEST(Rocks, ScatterKeepsApartAndClear) {
  const RockField f = field();
  const std::vector<RockSpec> rocks = scatter(f);
  ASSERT_EQ(rocks.size(), 300u);
  for (std::size_t i = 0; i < rocks.size(); ++i) {
    EXPECT_GE(std::hypot(rocks[i].x - 10.0, rocks[i].y - 10.0), 2.0 + rocks[i].radius);
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_GT(std::hypot(rocks[i].x - rocks[k].x, rocks[i].y - rocks[k].y), rocks[i].radius + rocks[k].radius);
  }
  EXPECT_EQ(scatter(f)[17].x, rocks[17].x);  // the same seed, the same rocks
}

// N(>D)/N = (D^-e - L^-e)/(s^-e - L^-e) at the middle: 300 of them scatter by sqrt(p (1 - p)/300) about it.
TEST(Rocks, SizesFollowTheirLaw) {
  const RockField f = field();
  const std::vector<RockSpec> rocks = scatter(f);
  for (const double d : {0.06, 0.1, 0.2}) {
    const double e = -f.exponent;
    const double p = (std::pow(d, e) - std::pow(f.largest, e)) / (std::pow(f.smallest, e) - std::pow(f.largest, e));
    const auto n = std::count_if(rocks.begin(), rocks.end(), [&](const RockSpec& r) { return 2.0 * r.radius > d; });
    EXPECT_NEAR(static_cast<double>(n) / 300.0, p, 3.5 * std::sqrt(p * (1.0 - p) / 300.0)) << d;
  }
}

TEST(Rocks, TooManyForTheirPlaceAreRefused) {
  RockField f = field();
  f.smallest = f.largest = 2.0;
  EXPECT_THROW(scatter(f), InputError);
  f.count = -1;
  EXPECT_THROW(scatter(f), InputError);
  RockSpec loose;
  loose.name = "r";
  loose.buried = 0.1;
  EXPECT_FALSE(loose.validate("rock").empty());
}

std::unique_ptr<terrain::Terrain> soft() {
  terrain::NodeSpringParams p;
  p.spacing = 0.02;
  return std::make_unique<terrain::NodeSpringTerrain>(p);
}

Script ahead(double speed, double seconds) {
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = seconds;
  moves[0].speed = speed;
  return Script(moves);
}

// A fixed kerb under one wheel: the wheel climbs by its height and comes down again, and the books close.
TEST(Rocks, RoverClimbsAFixedRock) {
  VehicleOptions options;
  RockSpec slab;
  slab.name = "slab";
  slab.shape = multibody::ShapeKind::box;
  slab.size = Vec3(0.3, 0.4, 0.2);
  slab.x = 1.0;
  slab.y = 0.45;
  slab.fixed = true;
  slab.buried = 0.15;  // 50 mm stick out
  options.rocks = {slab};
  Vehicle rover(rocker_bogie_rover(), options, std::make_unique<terrain::RigidTerrain>());
  Script script = ahead(0.2, 5.0);
  const recording::Run run = rover.run(script, 5.0);
  const std::vector<double>& left = run.find("front_left_sinkage")->values;
  const std::vector<double>& right = run.find("front_right_sinkage")->values;
  EXPECT_NEAR(*std::min_element(left.begin(), left.end()), -0.05, 0.005);
  EXPECT_GT(*std::min_element(right.begin(), right.end()), -0.005);
  EXPECT_GT(rover.last().pose.p_W.x(), 0.8);
  const VehicleEnergy e = rover.energy();
  EXPECT_GT(e.rocks, 0.0);
  const double turned_over = std::abs(e.drives) + std::abs(e.gravity) + std::abs(e.ground) + std::abs(e.rocks);
  EXPECT_NEAR(e.residual(), 0.0, 0.01 * turned_over);  // joints' error repair in the knocks
}

// A loose rock settles on the soil with its weight and is pushed along by the robot.
TEST(Rocks, LooseRockLiesOnTheSoilAndIsPushed) {
  VehicleOptions options;
  options.time_step = 1e-3;
  RockSpec rock;
  rock.name = "stone";
  rock.shape = multibody::ShapeKind::box;
  rock.size = Vec3(0.12, 0.5, 0.16);
  rock.density = 800.0;
  rock.x = 0.5;
  options.rocks = {rock};
  Vehicle robot(skid_steer_robot(), options, std::make_unique<terrain::RigidTerrain>());
  robot.settle();
  EXPECT_NEAR(robot.body("stone").pose().p_W.x(), 0.5, 1e-3);
  double carried = 0.0;
  for (std::size_t i = 4; i < robot.simulation().contacts().size(); ++i) carried += robot.simulation().contacts()[i].wrench.F_W.z();
  EXPECT_NEAR(carried, rock.mass() * 9.81, 0.02 * rock.mass() * 9.81);
  Script script = ahead(0.2, 3.0);
  robot.run(script, 3.0);
  EXPECT_GT(robot.body("stone").pose().p_W.x(), 0.6);
  EXPECT_EQ(robot.body_runs().size(), 6u);  // chassis, four wheels, the stone
}

TEST(Rocks, RockThatHoldsIsNamed) {
  VehicleOptions options;
  options.immobile_time = 2.0;
  RockSpec wall;
  wall.name = "wall";
  wall.shape = multibody::ShapeKind::box;
  wall.size = Vec3(0.2, 2.0, 0.8);
  wall.x = 0.6;
  wall.fixed = true;
  options.rocks = {wall};
  Vehicle robot(skid_steer_robot(), options, soft());
  Script script = ahead(0.2, 12.0);
  robot.run(script, 12.0);
  ASSERT_EQ(robot.events().size(), 1u);
  EXPECT_EQ(robot.end(), RunEnd::immobilised);
  EXPECT_THAT(robot.events()[0], testing::HasSubstr("a rock holds"));
}

TEST(Rocks, RocksUnderTheMachineAreRefused) {
  VehicleOptions options;
  RockSpec rock;
  rock.name = "stone";
  rock.x = 0.18;
  rock.y = 0.23;
  options.rocks = {rock};
  EXPECT_THROW(Vehicle(skid_steer_robot(), options, soft()), InputError);
}

// A low belly on soft ground carries part of the weight and is told as the reason.
TEST(Rocks, BellyHangsUp) {
  VehicleSpec spec = skid_steer_robot();
  spec.bodies[0].touches_ground = true;
  spec.bodies[0].size.z() = 0.27;  // 15 mm off the ground
  spec.bodies[0].mass = 150.0;
  for (auto& w : spec.wheels) w.drive.kind = DriveKind::speed;
  VehicleOptions options;
  options.immobile_time = 2.0;
  options.gravity = 9.81 * Vec3(-0.25, 0.0, -1.0);  // uphill
  Vehicle robot(spec, options, soft());
  Script script = ahead(0.1, 8.0);
  robot.run(script, 8.0);
  ASSERT_EQ(robot.events().size(), 1u);
  EXPECT_THAT(robot.events()[0], testing::HasSubstr("hangs on the ground"));
}

}  // namespace
}  // namespace terrode::vehicle
