#include "scenario/vehicle_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vehicle/machines.h"

namespace terrode::scenario {
namespace {

const char* const soil_text = R"(
soil:
  bekker: {cohesion: 139.28 Pa, friction_angle: 0.606, shear_modulus: 0.5151 mm, k: 2.541e5 Pa, n: 1.387, plate_width: 50 mm}
)";

std::string robot(const std::string& more) { return std::string("vehicle: skid-steer-robot\n") + soil_text + more; }

const char* const cart_text = R"(
name: cart
hitch: [-0.2, 0, 0.1]
bodies:
  - {name: frame, mass: 20 kg, position: [0, 0, 0.2], size: [0.5, 0.3, 0.1]}
  - {name: tail, mass: 2 kg, position: [-0.4, 0, 0.2]}
joints:
  - {name: tail_hinge, kind: hinge, body: tail, parent: frame, anchor: [-0.3, 0, 0.2], axis: [0, 1, 0],
     spring: {stiffness: 50 N m/rad, damping: 2}}
wheels:
  - {name: left, parent: frame, centre: [0, 0.2, 0.1], mass: 1 kg, radius: 100 mm, width: 80 mm,
     drive: {kind: dc_motor, voltage: 24 V, gear: 50}, steering: {limit: 30 deg}}
  - {name: right, parent: frame, centre: [0, -0.2, 0.1], mass: 1 kg, radius: 100 mm, width: 80 mm,
     strut: {stiffness: 3 kN/m, damping: 100 N s/m, preload: 100 N}}
)";

TEST(VehicleFile, ReadsAMachine) {
  const vehicle::VehicleSpec v = parse_machine(cart_text, "cart.yaml");
  ASSERT_EQ(v.bodies.size(), 2u);
  ASSERT_EQ(v.joints.size(), 1u);
  ASSERT_EQ(v.wheels.size(), 2u);
  EXPECT_EQ(v.bodies[0].mass, 20.0);
  EXPECT_EQ(v.joints[0].spring->stiffness, 50.0);
  EXPECT_EQ(v.wheels[0].drive.kind, vehicle::DriveKind::dc_motor);
  EXPECT_NEAR(v.wheels[0].steering->limit, 0.5235987756, 1e-9);
  EXPECT_EQ(v.wheels[1].strut->spring.stiffness, 3000.0);
  EXPECT_EQ(v.wheels[1].drive.kind, vehicle::DriveKind::speed);
  EXPECT_NEAR(v.mass(), 20 + 2 + 2 + 0.5 + 1.0, 1e-12);
}

TEST(VehicleFile, SaysEveryProblemWithItsPlace) {
  std::string text = cart_text;
  text.replace(text.find("mass: 20 kg"), 11, "mass: -2 kg");
  text.replace(text.find("kind: hinge"), 11, "kind: hunge");
  text.replace(text.find("radius: 100 mm"), 14, "radius: 100 kg");
  try {
    parse_machine(text, "cart.yaml");
    FAIL();
  } catch (const InputError& e) {
    ASSERT_GE(e.problems().size(), 3u);
    for (const Problem& p : e.problems()) {
      EXPECT_EQ(p.file, "cart.yaml");
      EXPECT_GT(p.line, 0);
    }
    EXPECT_THAT(e.what(), testing::HasSubstr("hinge"));
  }
  std::string lost = cart_text;
  lost.replace(lost.find("parent: frame, centre: [0, 0.2"), 13, "parent: fram");
  EXPECT_THROW(parse_machine(lost, "cart.yaml"), InputError);
}

TEST(VehicleFile, ReadsADrive) {
  const DriveScenario d = parse_drive(robot(R"(
surface: {kind: fractal, rms_height: 5 mm, seed: 3}
slope: 3 deg
terrain: {node_spacing: 10 mm}
time_step: 2 ms
script:
  - {duration: 2 s, speed: 0.2}
  - {duration: 3 s, speed: 0.2, curvature: 0.5 1/m}
)"),
                                      "drive.yaml");
  EXPECT_EQ(d.machine.name, "skid-steer-robot");
  EXPECT_EQ(d.script.size(), 2u);
  EXPECT_EQ(d.duration, 5.0);
  EXPECT_LT(d.options.gravity.x(), 0.0);
  EXPECT_EQ(d.base.terrain.node_spacing, 0.01);
  ASSERT_NE(d.surface, nullptr);
}

TEST(VehicleFile, DriveRunsFromItsFile) {
  const DriveScenario d =
      parse_drive(robot("terrain: {node_spacing: 10 mm}\nscript:\n  - {duration: 2 s, speed: 0.2}\n"), "drive.yaml");
  const DriveResult r = run_drive(d);
  EXPECT_NEAR(r.simulated_seconds, 2.0, 1e-6);
  EXPECT_GT(r.run.find("position_x")->values.back(), 0.2);
  EXPECT_GT(r.energy_per_metre, 0.0);
  const auto& sinkage = r.run.find("front_left_sinkage")->values;
  EXPECT_GT(sinkage.back(), 1e-3);
}

TEST(VehicleFile, WrongDrivesAreRefused) {
  EXPECT_THROW(parse_drive(robot(""), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("script:\n  - {speed: 1}\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("script:\n  - {duration: 1, sped: 1}\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive("vehicle: skid-steer\nscript: [{duration: 1}]\n", "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("path: {waypoints: [[1, 2, 3]]}\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("surface: {kind: png, file: none.png, cell: 1, white: 1}\nscript: [{duration: 1}]\n"),
                           "d.yaml"),
               InputError);
}

}  // namespace
}  // namespace terrode::scenario
