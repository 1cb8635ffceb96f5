// A whole machine on particles, over a short distance.
#include <gtest/gtest.h>

#include <cmath>

#include "../../small_robot.h"
#include "scenario/vehicle_file.h"

namespace terrode::scenario {
namespace {

// Grains so coarse that the test takes seconds.
const std::string robot = kSmallRobot + R"(ground: dem
particles: {smallest: 12 mm, largest: 15 mm, prism: 80 mm, depth: 35 mm, window_ahead: 80 mm, window_behind: 80 mm}
time_step: 1 ms
settle_time: 0.2 s
script: [{duration: 0.5 s, speed: 0.2 m/s, ramp: 0.1 s}]
)";

TEST(VehicleOnParticles, DrivesAShortDistance) {
  const DriveScenario scenario = parse_drive(robot, "robot.yaml");
  const DriveResult r = run_drive(scenario);
  EXPECT_EQ(r.end, vehicle::RunEnd::duration);
  // 90 mm at 0.2 m/s after a ramp; a rim on coarse grains rolls on a radius some percent off its own.
  EXPECT_NEAR(r.run.find("position_x")->values.back(), 0.09, 0.01);
  EXPECT_NEAR(r.run.find("position_y")->values.back(), 0.0, 0.005);
  double load = 0.0, pull = 0.0;
  for (const char* wheel : {"fl", "fr", "rl", "rr"}) {
    const std::string name = wheel;
    load += mean_of_second_half(r.run.find(name + "_normal_load")->values);
    pull += mean_of_second_half(r.run.find(name + "_drawbar_pull")->values);
    // Over grains of 13 mm, whose mean top is at zero: neither on the floor nor in the air.
    EXPECT_GT(mean_of_second_half(r.run.find(name + "_sinkage")->values), -0.01) << name;
    EXPECT_LT(mean_of_second_half(r.run.find(name + "_sinkage")->values), 0.02) << name;
    EXPECT_GT(mean_of_second_half(r.run.find(name + "_normal_load")->values), 0.1 * 9.81) << name;
  }
  // A quarter of a second of a machine that bounces by less than a grain: its mean vertical acceleration is below 2 (v/t).
  EXPECT_NEAR(load, 4.0 * 9.81, 0.05 * 4.0 * 9.81);
  // At a steady speed nothing pulls but its rolling, which the drives overcome.
  EXPECT_NEAR(pull, 0.0, 0.05 * 4.0 * 9.81);
  EXPECT_GT(r.energy.drives, 0.0);
  EXPECT_NEAR(r.energy.residual(), 0.0, 0.02 * r.energy.drives);
}

}  // namespace
}  // namespace terrode::scenario
