#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "vehicle/machines.h"
#include "vehicle/vehicle.h"

namespace terrode::vehicle {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

std::string all_problems(const Problems& problems) {
  std::string out;
  for (const Problem& p : problems) out += p.text() + "\n";
  return out;
}

struct SpecFault {
  std::string key;
  std::function<void(VehicleSpec&)> make;
};

// One fault in a machine that is right, and the problem is the one of that place.
TEST(VehicleSpec, EachFaultIsNamedByItsKey) {
  const std::vector<SpecFault> faults = {
      {"bodies", [](VehicleSpec& v) { v.bodies.clear(); }},
      {"wheels", [](VehicleSpec& v) { v.wheels.clear(); }},
      {"bodies.chassis.mass", [](VehicleSpec& v) { v.bodies[0].mass = 0.0; }},
      {"bodies.chassis.position", [](VehicleSpec& v) { v.bodies[0].position.x() = kNoNumber; }},
      {"bodies.chassis.size", [](VehicleSpec& v) { v.bodies[0].inertia.reset(), v.bodies[0].size.z() = 0.0; }},
      {"bodies..name", [](VehicleSpec& v) { v.bodies.push_back({}), v.bodies.back().mass = 1.0; }},
      {"wheels.front_left.name", [](VehicleSpec& v) { v.wheels[1].name = v.wheels[0].name = "front_left"; }},
      {"wheels.front_left.parent", [](VehicleSpec& v) { v.wheels[0].parent = "chasis"; }},
      {"wheels.front_left.mass", [](VehicleSpec& v) { v.wheels[0].mass = -1.0; }},
      {"wheels.front_left.centre", [](VehicleSpec& v) { v.wheels[0].centre.y() = kNoNumber; }},
      {"wheels.front_left.drive.max_torque", [](VehicleSpec& v) { v.wheels[0].drive.max_torque = -1.0; }},
      {"wheels.front_left.drive.max_torque",
       [](VehicleSpec& v) { v.wheels[0].drive = {DriveKind::torque, std::numeric_limits<double>::infinity(), {}}; }},
      {"wheels.front_left.drive.motor.current_limit",
       [](VehicleSpec& v) { v.wheels[0].drive.kind = DriveKind::dc_motor, v.wheels[0].drive.motor.current_limit = 0.0; }},
      {"wheels.front_left.drive.motor.efficiency",
       [](VehicleSpec& v) { v.wheels[0].drive.kind = DriveKind::dc_motor, v.wheels[0].drive.motor.efficiency = 1.5; }},
      {"wheels.front_left.strut", [](VehicleSpec& v) { v.wheels[0].strut = StrutSpec{{0.0, 0.0, 0.0}, 1.0}; }},
      {"wheels.front_left.strut.preload", [](VehicleSpec& v) { v.wheels[0].strut = StrutSpec{{0.0, 10.0, 5.0}, 1.0}; }},
      {"wheels.front_left.steering.limit",
       [](VehicleSpec& v) { v.wheels[0].steering = SteeringSpec{}, v.wheels[0].steering->limit = 4.0; }},
      {"wheels.front_left.steering.joint",
       [](VehicleSpec& v) { v.wheels[0].steering = SteeringSpec{}, v.wheels[0].steering->joint = "none"; }},
      {"sensors.s.noise", [](VehicleSpec& v) { v.sensors = {{"s", SensorKind::imu, "chassis", Vec3::Zero(), "", -1.0}}; }},
      {"sensors.s.body", [](VehicleSpec& v) { v.sensors = {{"s", SensorKind::imu, "chasis", Vec3::Zero(), "", 0.0}}; }},
      {"sensors.s.position",
       [](VehicleSpec& v) { v.sensors = {{"s", SensorKind::imu, "chassis", Vec3(kNoNumber, 0, 0), "", 0.0}}; }},
      {"sensors.s.joint",
       [](VehicleSpec& v) { v.sensors = {{"s", SensorKind::encoder, "", Vec3::Zero(), "front_left.axel", 0.0}}; }},
      {"hitch", [](VehicleSpec& v) { v.hitch.x() = kNoNumber; }},
  };
  VehicleSpec right = skid_steer_robot();
  right.bodies[0].name = "chassis";
  for (VehicleWheelSpec& w : right.wheels) w.parent = "chassis";
  ASSERT_EQ(all_problems(right.validate()), "");
  ASSERT_EQ(right.wheels[0].name, "front_left");
  for (const SpecFault& fault : faults) {
    VehicleSpec wrong = right;
    fault.make(wrong);
    const Problems problems = wrong.validate();
    EXPECT_TRUE(std::any_of(problems.begin(), problems.end(), [&](const Problem& p) { return p.key == fault.key; }))
        << fault.key << " is not among:\n" << all_problems(problems);
  }
}

TEST(VehicleSpec, NearNamesAreOffered) {
  VehicleSpec v = skid_steer_robot();
  const std::string body = v.bodies[0].name;
  v.wheels[0].parent = body + "s";
  v.sensors = {{"s", SensorKind::encoder, "", Vec3::Zero(), v.wheels[0].name + ".axel", 0.0}};
  const std::string text = all_problems(v.validate());
  EXPECT_NE(text.find("'" + body + "s' is not a body, expected '" + body + "'"), std::string::npos) << text;
  EXPECT_NE(text.find("expected '" + v.wheels[0].name + ".axle'"), std::string::npos) << text;
}

// Joints of a machine with a suspension of its own.
TEST(VehicleSpec, JointsThatCannotBeAreNamed) {
  const VehicleSpec right = rocker_bogie_rover();
  ASSERT_EQ(all_problems(right.validate()), "");
  const auto fault = [&](JointKind kind, const std::function<void(JointSpec&)>& make, const std::string& key) {
    VehicleSpec wrong = right;
    const auto j = std::find_if(wrong.joints.begin(), wrong.joints.end(), [&](const JointSpec& x) { return x.kind == kind; });
    ASSERT_NE(j, wrong.joints.end()) << key;
    make(*j);
    const std::string at = "joints." + j->name + key;
    const Problems problems = wrong.validate();
    EXPECT_TRUE(std::any_of(problems.begin(), problems.end(), [&](const Problem& p) { return p.key == at; }))
        << at << " is not among:\n" << all_problems(problems);
  };
  fault(JointKind::hinge, [](JointSpec& j) { j.body = j.parent; }, "");
  fault(JointKind::hinge, [](JointSpec& j) { j.anchor.x() = kNoNumber; }, "");
  fault(JointKind::hinge, [](JointSpec& j) { j.axis = Vec3::Zero(); }, ".axis");
  fault(JointKind::hinge, [](JointSpec& j) { j.spring = SpringSpec{-1.0, 2.0, 0.0}; }, ".spring.stiffness");
  fault(JointKind::hinge, [](JointSpec& j) { j.parent = "nowhere at all"; }, ".parent");
  fault(JointKind::rod, [](JointSpec& j) { j.anchor_on_parent = j.anchor; }, ".anchor_on_parent");
  fault(JointKind::rod, [](JointSpec& j) { j.spring = SpringSpec{1.0, 0.0, 0.0}; }, ".spring");
}

TEST(VehicleOptions, GravityPointsDownAndRocksHaveNamesOfTheirOwn) {
  VehicleOptions o;
  ASSERT_EQ(all_problems(o.validate()), "");
  o.gravity = Vec3(0, 0, 9.81);
  EXPECT_NE(all_problems(o.validate()).find("options.gravity: does not point down"), std::string::npos);
  VehicleOptions two;
  two.rocks = {RockSpec{}, RockSpec{}};
  two.rocks[0].name = two.rocks[1].name = "stone";
  EXPECT_NE(all_problems(two.validate()).find("rocks.stone.name: is taken"), std::string::npos) << all_problems(two.validate());
}

}  // namespace
}  // namespace terrode::vehicle
