#include "scenario/urdf_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "scenario/machine_file.h"
#include "scenario/vehicle_file.h"
#include "terrain/rigid.h"
#include "vehicle/controllers.h"

namespace terrode::scenario {
namespace {

using testing::Contains;
using testing::HasSubstr;
namespace fs = std::filesystem;

const std::string kScout = std::string(TERRODE_SOURCE_DIR) + "/scenarios/machines/scout.yaml";

std::string text_of(const std::string& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

// A copy of the scout in which `from` reads `to`; the sidecar's text with its own changes.
class Changed {
 public:
  Changed(const std::string& urdf_from, const std::string& urdf_to, const std::string& side_from = "", const std::string& side_to = "") {
    folder_ = fs::temp_directory_path() / ("terrode_urdf_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    write("scout.urdf", text_of(kScout.substr(0, kScout.size() - 5) + ".urdf"), urdf_from, urdf_to);
    write("scout.yaml", text_of(kScout), side_from, side_to);
  }
  ~Changed() { fs::remove_all(folder_); }
  std::string problems() const {
    try {
      load_machine((folder_ / "scout.yaml").string());
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

 private:
  void write(const std::string& name, std::string text, const std::string& from, const std::string& to) {
    if (!from.empty()) {
      const auto at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    }
    std::ofstream(folder_ / name) << text;
  }
  fs::path folder_;
};

TEST(Urdf, TakesTheTree) {
  const MachineFile file = load_machine(kScout);
  const vehicle::VehicleSpec& v = file.machine;
  EXPECT_EQ(v.name, "scout");
  ASSERT_EQ(v.bodies.size(), 3u);  // the body with mast and camera, two knuckles
  EXPECT_DOUBLE_EQ(v.bodies[0].mass, 18.0 + 2.0 + 0.5);
  EXPECT_NEAR(v.mass(), 18.0 + 2.0 + 0.5 + 2 * 0.8 + 4 * 1.6, 1e-12);
  // Wheels stand on the ground: axles 0.11 m above the base_footprint, moved so that the lowest point is at 0.
  ASSERT_EQ(v.wheels.size(), 4u);
  EXPECT_NEAR((v.wheels[0].centre - Vec3(0.2, 0.28, 0.11)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((v.wheels[3].centre - Vec3(-0.2, -0.28, 0.11)).norm(), 0.0, 1e-12);
  EXPECT_EQ(v.wheels[0].shape.radius, 0.11);
  EXPECT_EQ(v.wheels[0].shape.width, 0.09);
  EXPECT_EQ(v.wheels[0].drive.max_torque, 15.0);  // the joint's effort
  // The wheel's moments turn with its link: the axle's is the largest.
  EXPECT_NEAR((*v.wheels[0].inertia)(1, 1), 0.0095, 1e-12);
  EXPECT_NEAR((*v.wheels[0].inertia)(2, 2), 0.0055, 1e-12);
  // Steering: limits and rate of the URDF's joint, about the knuckle's own place.
  EXPECT_EQ(v.wheels[0].steering->joint, "steer_left");
  EXPECT_EQ(v.wheels[0].steering->limit, 0.6);
  EXPECT_EQ(v.wheels[0].steering->rate, 0.8);
  EXPECT_FALSE(v.wheels[2].steering.has_value());
  ASSERT_EQ(v.joints.size(), 2u);
  EXPECT_NEAR((v.joints[0].anchor - Vec3(0.2, 0.24, 0.11)).norm(), 0.0, 1e-12);
  EXPECT_TRUE(v.validate().empty());
}

// Parallel axes: 18 kg at 0.16, mast 2 kg at 0.41, camera 0.5 kg at 0.61 above base_footprint.
TEST(Urdf, JoinedLinksAddUpTheirInertia) {
  const vehicle::VehicleSpec v = load_machine(kScout).machine;
  const double m = 20.5, z = (18 * 0.16 + 2 * 0.41 + 0.5 * 0.61) / m, x = (2 * 0.15 + 0.5 * 0.15) / m;
  EXPECT_NEAR(v.bodies[0].position.z(), z, 1e-12);
  EXPECT_NEAR(v.bodies[0].position.x(), x, 1e-12);
  const auto about = [&](double mass, double px, double pz) { return mass * ((px - x) * (px - x) + (pz - z) * (pz - z)); };
  const double iyy = 0.42 + 0.02 + 0.0005 + about(18, 0, 0.16) + about(2, 0.15, 0.41) + about(0.5, 0.15, 0.61);
  EXPECT_NEAR((*v.bodies[0].inertia)(1, 1), iyy, 1e-12);
  EXPECT_EQ(v.bodies[0].size, Vec3(0.52, 0.34, 0.12));  // its collision box
}

TEST(Urdf, SaysWhatWasTakenAndWhatNot) {
  const std::vector<std::string> notes = load_machine(kScout).notes;
  EXPECT_THAT(notes, Contains(HasSubstr("taken: link 'front_left_wheel': a wheel of radius 0.11 m")));
  EXPECT_THAT(notes, Contains(HasSubstr("taken: joint 'camera_pan' (revolute): locked at zero")));
  EXPECT_THAT(notes, Contains(HasSubstr("left out: joint 'front_left_axle': its friction 0.1")));
  EXPECT_THAT(notes, Contains(HasSubstr("left out: the visual shapes and materials of 2 links")));
  EXPECT_THAT(notes, Contains(HasSubstr("left out: 1 element <transmission>")));
}

TEST(Urdf, DrivesAndSteers) {
  const vehicle::VehicleSpec spec = load_machine(kScout).machine;
  vehicle::Vehicle v(spec, {}, std::make_unique<terrain::RigidTerrain>());
  std::vector<vehicle::Manoeuvre> moves(1);
  moves[0].duration = 5.0;
  moves[0].speed = 0.3;
  moves[0].curvature = 0.4;
  vehicle::Script script(moves);
  const recording::Run run = v.run(script, 5.0);
  // Outside wheels slip in friction that grows with sliding speed, and the kingpin lies beside the wheel.
  EXPECT_NEAR(v.last().twist.w_W.z() / v.last().speed, 0.4, 0.03);
  const double angle = std::atan2(0.4 * 0.4, 1.0 - 0.4 * 0.28);  // rear axle at x = -0.2
  EXPECT_NEAR(run.find("left_angle_position")->values.back(), angle, 1e-3);
  EXPECT_NEAR(run.find("imu_acceleration_z")->values.back(), 9.81, 0.2);
}

TEST(Urdf, WrongFilesAreRefusedWithTheReason) {
  EXPECT_THAT(Changed("<link name=\"base_footprint\"/>", "").problems(), HasSubstr("scout.urdf"));
  EXPECT_THAT(Changed("</robot>", "").problems(), HasSubstr("scout.urdf"));
  EXPECT_THAT(Changed("<axis xyz=\"0 0 1\"/>\n    <limit effort", "<axis xyz=\"0 1 1\"/>\n    <limit effort").problems(),
              HasSubstr("along y"));
  EXPECT_THAT(Changed("", "", "front_left_wheel", "front_left_whel").problems(), HasSubstr("'front_left_wheel'"));
  EXPECT_THAT(Changed("", "", "locked: [camera_pan]", "locked: [camera]").problems(), HasSubstr("is not a joint"));
  EXPECT_THAT(Changed("", "", "joint: steer_left}}", "joint: steer_right}}").problems(), HasSubstr("does not hold this wheel"));
  EXPECT_THAT(Changed("<geometry><cylinder radius=\"0.11\" length=\"0.09\"/></geometry>",
                      "<geometry><mesh filename=\"wheel.stl\"/></geometry>")
                  .problems(),
              HasSubstr("no cylinder to take it from"));
  EXPECT_THAT(Changed("<mass value=\"0.8\"/>", "<mass value=\"0\"/>").problems(), HasSubstr("knuckle_left"));
  EXPECT_THAT(Changed("", "", "urdf: scout.urdf", "urdf: none.urdf").problems(), HasSubstr("none.urdf"));
}

}  // namespace
}  // namespace terrode::scenario
