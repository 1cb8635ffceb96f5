// A whole machine on particles, over a short distance.
#include <gtest/gtest.h>

#include <cmath>

#include "scenario/vehicle_file.h"

namespace terrode::scenario {
namespace {

// A robot of 4 kg; grains so coarse that the test takes seconds.
const char* const robot = R"(
vehicle:
  name: small-robot
  bodies:
    - {name: frame, mass: 3 kg, position: [0, 0, 0.1], size: [0.2, 0.12, 0.06]}
  wheels:
    - {name: fl, parent: frame, centre: [0.08, 0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
    - {name: fr, parent: frame, centre: [0.08, -0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
    - {name: rl, parent: frame, centre: [-0.08, 0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
    - {name: rr, parent: frame, centre: [-0.08, -0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
ground: dem
particles: {smallest: 12 mm, largest: 15 mm, prism: 80 mm, depth: 35 mm, window_ahead: 80 mm, window_behind: 80 mm}
time_step: 1 ms
settle_time: 0.2 s
script: [{duration: 0.5 s, speed: 0.2 m/s, ramp: 0.1 s}]
)";

double mean_of_second_half(const recording::Run& run, const std::string& channel) {
  const std::vector<double>& v = run.find(channel)->values;
  double sum = 0;
  for (std::size_t i = v.size() / 2; i < v.size(); ++i) sum += v[i];
  return sum / static_cast<double>(v.size() - v.size() / 2);
}

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
    load += mean_of_second_half(r.run, name + "_normal_load");
    pull += mean_of_second_half(r.run, name + "_drawbar_pull");
    // Over grains of 13 mm, whose mean top is at zero: neither on the floor nor in the air.
    EXPECT_GT(mean_of_second_half(r.run, name + "_sinkage"), -0.01) << name;
    EXPECT_LT(mean_of_second_half(r.run, name + "_sinkage"), 0.02) << name;
    EXPECT_GT(mean_of_second_half(r.run, name + "_normal_load"), 0.1 * 9.81) << name;
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
