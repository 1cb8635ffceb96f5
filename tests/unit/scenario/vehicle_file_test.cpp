#include "scenario/vehicle_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

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

// What is written from a machine is read back to the same.
TEST(VehicleFile, MachinesAreWrittenAndReadBack) {
  std::vector<vehicle::VehicleSpec> machines = {parse_machine(cart_text, "cart.yaml")};
  for (const std::string& name : vehicle::machine_names()) machines.push_back(vehicle::machine(name));
  for (const vehicle::VehicleSpec& m : machines) {
    const std::string text = to_yaml(m);
    const vehicle::VehicleSpec again = parse_machine(text, "again.yaml");
    EXPECT_EQ(to_yaml(again), text) << m.name;
    EXPECT_EQ(again.mass(), m.mass()) << m.name;
    ASSERT_EQ(again.wheels.size(), m.wheels.size());
    for (std::size_t i = 0; i < m.wheels.size(); ++i) {
      EXPECT_EQ(again.wheels[i].centre, m.wheels[i].centre);
      EXPECT_EQ(again.wheels[i].drive.kind, m.wheels[i].drive.kind);
      EXPECT_EQ(again.wheels[i].drive.motor.gear, m.wheels[i].drive.motor.gear);
      EXPECT_EQ(again.wheels[i].shape.grousers.height, m.wheels[i].shape.grousers.height);
      EXPECT_EQ(again.wheels[i].strut.has_value(), m.wheels[i].strut.has_value());
      EXPECT_EQ(again.wheels[i].steering.has_value(), m.wheels[i].steering.has_value());
    }
    ASSERT_EQ(again.joints.size(), m.joints.size());
    for (std::size_t i = 0; i < m.joints.size(); ++i) {
      EXPECT_EQ(again.joints[i].kind, m.joints[i].kind);
      EXPECT_EQ(again.joints[i].axis, m.joints[i].axis);
    }
  }
}

TEST(VehicleFile, KeysOfAnotherKindOfSensorAreRefused) {
  const std::string text = cart_text;
  EXPECT_NO_THROW(parse_machine(text + "sensors: [{name: s, kind: imu, body: frame}]\n", "cart.yaml"));
  EXPECT_THROW(parse_machine(text + "sensors: [{name: s, kind: imu, body: frame, joint: tail_hinge}]\n", "cart.yaml"), InputError);
  EXPECT_THROW(parse_machine(text + "sensors: [{name: s, kind: encoder, body: frame}]\n", "cart.yaml"), InputError);
}

TEST(VehicleFile, ParticlesStandBesideParticleGroundAlone) {
  const DriveScenario d = parse_drive(robot("ground: dem\nparticles: {smallest: 20 mm, largest: 25 mm}\nscript: [{duration: 1, speed: 0.1}]\n"), "a.yaml");
  EXPECT_EQ(d.base.particles.largest, 0.025);
  EXPECT_EQ(parse_drive(robot("ground: mpi\nparticles: {floor: rough}\nscript: [{duration: 1, speed: 0.1}]\n"), "a.yaml").base.particles.floor, "rough");
  try {
    parse_drive(robot("particles: {smallest: 20 mm}\nscript: [{duration: 1, speed: 0.1}]\n"), "a.yaml");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("ground: dem"));
  }
  // Laid as far as the script goes, and the margin drives on.
  const std::string margin = "mobility_margin: {every: 1 s}\nscript: [{duration: 2, speed: 0.1}]\n";
  EXPECT_NO_THROW(parse_drive(robot("ground: dem\n" + margin), "a.yaml"));
  EXPECT_THROW(parse_drive(robot("ground: mpi\n" + margin), "a.yaml"), InputError);
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
  ASSERT_NE(d.base.surface, nullptr);
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

TEST(VehicleFile, ReadsGroundsGravityAndRocks) {
  const DriveScenario d = parse_drive(robot(R"(
surface:
  - {kind: slope, angle: 0.1}
  - {kind: step, at: 1 m, height: 5 cm, run: 10 mm}
soil_map:
  - {x0: 2, y0: -1, x1: 3, y1: 1, soil: {bekker: {k: 1e5 Pa}}}
gravity: moon
rocks:
  - {radius: 10 cm, x: 2 m}
rock_field: {count: 5, x0: 1, y0: -2, x1: 6, y1: 2, seed: 4}
mobility_margin: {every: 2 s}
script: [{duration: 1, speed: 0.1}]
)"),
                                      "drive.yaml");
  ASSERT_NE(d.base.surface, nullptr);
  EXPECT_NEAR(d.base.surface->height(0.5, 0.0), 0.5 * std::tan(0.1), 1e-12);
  EXPECT_NEAR(d.base.surface->height(1.005, 0.0), 1.005 * std::tan(0.1) + 0.025, 1e-12);
  EXPECT_NEAR(d.base.surface->gradient(1.005, 0.0).x(), std::tan(0.1) + 5.0, 1e-9);
  ASSERT_EQ(d.base.soil_map.size(), 1u);
  const bekker::Soil patch = d.base.bekker_soil(d.base.soil_map[0].soil, "");
  EXPECT_EQ(patch.k, 1e5);
  EXPECT_EQ(patch.n, 1.387);  // the rest is that of the scenario
  EXPECT_DOUBLE_EQ(d.options.gravity.z(), -1.62);
  EXPECT_EQ(d.options.rocks.size(), 6u);
  EXPECT_EQ(d.options.margin_interval, 2.0);
  EXPECT_THAT(d.base.notes, testing::Contains(testing::HasSubstr("stay as given")));
}

TEST(VehicleFile, SoilMeasuredOnEarthIsScaledWhereAsked) {
  const DriveScenario d = parse_drive(
      robot("gravity: mars\nsoil_measured_at: earth\nterrain: {node_spacing: 20 mm}\nscript: [{duration: 1, speed: 0.1}]\n"),
      "drive.yaml");
  ASSERT_EQ(d.base.effects.size(), 1u);
  EXPECT_EQ(d.base.effects[0].parameters.at("g"), 3.71);
  EXPECT_THAT(d.base.notes, testing::Contains(testing::HasSubstr("scales k")));
  // k and the load shrink alike: the robot sinks as on Earth.
  const DriveScenario home = parse_drive(robot("terrain: {node_spacing: 20 mm}\nscript: [{duration: 1, speed: 0.1}]\n"), "drive.yaml");
  const double there = run_drive(d).run.find("front_left_sinkage")->values.back();
  const double here = run_drive(home).run.find("front_left_sinkage")->values.back();
  EXPECT_NEAR(there, here, 0.1 * here);  // but for cohesion, which helps at a small load
}

TEST(VehicleFile, ResumedRunGoesOnToTheBit) {
  const std::string text = robot(R"(
terrain: {node_spacing: 20 mm}
surface: {kind: fractal, rms_height: 5 mm}
rocks: [{radius: 4 cm, x: 0.5}]
path: {waypoints: [[0, 0], [1, 0], [2, 1]], speed: 0.3}
duration: 2 s
)");
  const DriveScenario d = parse_drive(text, "drive.yaml");
  const std::string file = (std::filesystem::temp_directory_path() / ("terrode_state_" + std::to_string(getpid()) + ".h5")).string();
  DriveRun whole(d), first(d), second(d);
  whole.run(2.0);
  first.run(1.0);
  recording::write_atomically(file, false, [&](recording::Hdf5File& f) { first.save(f); });
  second.resume(recording::Hdf5File::open(file));
  second.run(2.0);
  const recording::Run all = whole.result().run, rest = second.result().run;
  const std::size_t skipped = all.time.size() - rest.time.size();
  EXPECT_EQ(rest.time.size(), 50u);
  for (const recording::Channel& c : all.channels) {
    const std::vector<double> tail(c.values.begin() + static_cast<std::ptrdiff_t>(skipped), c.values.end());
    EXPECT_EQ(tail, rest.find(c.name)->values) << c.name;
  }
  const DriveScenario other = parse_drive(text + "\n", "drive.yaml");
  DriveRun wrong(other);
  EXPECT_THROW(wrong.resume(recording::Hdf5File::open(file)), InputError);
  std::filesystem::remove(file);
}

TEST(VehicleFile, MarginsAreTakenAndChangeNothing) {
  const std::string text = robot("terrain: {node_spacing: 20 mm}\nscript: [{duration: 1.5, speed: 0.2}]\n");
  const DriveResult plain = run_drive(parse_drive(text, "d.yaml"));
  const DriveResult r = run_drive(parse_drive(text + "mobility_margin: {every: 0.5 s, rate: 200 N/s}\n", "d.yaml"));
  ASSERT_EQ(r.margins.size(), 3u);
  for (const auto& m : r.margins) {
    EXPECT_GT(m.pull, 0.3 * 25.0 * 9.81);  // tan(phi) = 0.69 less compaction
    EXPECT_LT(m.pull, 0.69 * 25.0 * 9.81);
  }
  EXPECT_EQ(r.run.find("position_x")->values, plain.run.find("position_x")->values);
  EXPECT_EQ(r.bodies.size(), 5u);
}

TEST(VehicleFile, ReadyScenariosAreRight) {
  for (const char* name : {"rover", "robot", "car", "towed", "moon", "urdf"}) {
    const DriveScenario d = load_drive(std::string(TERRODE_SOURCE_DIR) + "/scenarios/" + name + ".yaml");
    EXPECT_FALSE(d.machine.wheels.empty()) << name;
    EXPECT_GT(d.planned_path().size(), 1u) << name;
  }
}

TEST(VehicleFile, WrongDrivesAreRefused) {
  EXPECT_THROW(parse_drive(robot(""), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("script:\n  - {speed: 1}\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("script:\n  - {duration: 1, sped: 1}\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("gravity: venus\nscript: [{duration: 1}]\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("ground: rigid\nsurface: {kind: slope, angle: 0.1}\nscript: [{duration: 1}]\n"), "d.yaml"),
               InputError);
  EXPECT_THROW(parse_drive(robot("rocks: [{radius: -1, x: 2}]\nscript: [{duration: 1}]\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("soil_map: [{x0: 0, x1: 0, y0: 0, y1: 1, soil: {}}]\nscript: [{duration: 1}]\n"), "d.yaml"),
               InputError);
  EXPECT_THROW(parse_drive("vehicle: skid-steer\nscript: [{duration: 1}]\n", "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("path: {waypoints: [[1, 2, 3]]}\n"), "d.yaml"), InputError);
  EXPECT_THROW(parse_drive(robot("surface: {kind: png, file: none.png, cell: 1, white: 1}\nscript: [{duration: 1}]\n"),
                           "d.yaml"),
               InputError);
}

}  // namespace
}  // namespace terrode::scenario
