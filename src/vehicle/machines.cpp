#include "vehicle/machines.h"

namespace terrode::vehicle {

namespace {

wheel::WheelShape rim(double radius, double width) {
  wheel::WheelShape s;
  s.radius = radius;
  s.width = width;
  return s;
}

JointSpec hinge(const std::string& name, const std::string& body, const std::string& parent, const Vec3& anchor,
                const Vec3& axis) {
  JointSpec j;
  j.name = name;
  j.kind = JointKind::hinge;
  j.body = body;
  j.parent = parent;
  j.anchor = anchor;
  j.axis = axis;
  return j;
}

JointSpec rod(const std::string& name, const std::string& body, const std::string& parent, const Vec3& a,
              const Vec3& b) {
  JointSpec j;
  j.name = name;
  j.kind = JointKind::rod;
  j.body = body;
  j.parent = parent;
  j.anchor = a;
  j.anchor_on_parent = b;
  return j;
}

}  // namespace

VehicleSpec rocker_bogie_rover() {
  VehicleSpec v;
  v.name = "rocker-bogie-rover";
  v.bodies.push_back({"chassis", 140.0, Vec3(0.0, 0.0, 0.50), Vec3(0.9, 0.6, 0.3), {}});
  v.bodies.push_back({"differential", 2.0, Vec3(0.0, 0.0, 0.70), Vec3(0.06, 0.80, 0.04), {}});
  v.hitch = Vec3(-0.45, 0.0, 0.30);
  v.joints.push_back(hinge("differential_pivot", "differential", "chassis", Vec3(0.0, 0.0, 0.70), Vec3::UnitZ()));
  for (const int side : {1, -1}) {
    const std::string s = side > 0 ? "left" : "right";
    const double y = 0.45 * side;
    v.bodies.push_back({"rocker_" + s, 5.0, Vec3(0.20, y, 0.38), Vec3(0.7, 0.05, 0.05), {}});
    v.bodies.push_back({"bogie_" + s, 3.0, Vec3(-0.30, y, 0.28), Vec3(0.6, 0.05, 0.05), {}});
    v.joints.push_back(hinge("rocker_pivot_" + s, "rocker_" + s, "chassis", Vec3(0.0, y, 0.45), Vec3::UnitY()));
    v.joints.push_back(hinge("bogie_pivot_" + s, "bogie_" + s, "rocker_" + s, Vec3(-0.30, y, 0.30), Vec3::UnitY()));
    // The bar's end lies above the rocker's pivot; a rod forward from it to the rocker ties the two together.
    v.joints.push_back(
        rod("link_" + s, "differential", "rocker_" + s, Vec3(0.0, 0.40 * side, 0.70), Vec3(0.25, 0.40 * side, 0.70)));
    const struct {
      const char* name;
      double x;
      const char* parent;
      bool steered;
    } places[] = {{"front", 0.60, "rocker_", true}, {"middle", 0.0, "bogie_", false}, {"rear", -0.60, "bogie_", true}};
    for (const auto& p : places) {
      VehicleWheelSpec w;
      w.name = std::string(p.name) + "_" + s;
      w.parent = p.parent + s;
      w.centre = Vec3(p.x, y, 0.13);
      w.mass = 3.2;
      w.shape = rim(0.13, 0.16);
      w.drive.kind = DriveKind::speed;
      w.drive.max_torque = 60.0;
      if (p.steered) w.steering = SteeringSpec{};
      v.wheels.push_back(w);
    }
  }
  return v;
}

VehicleSpec skid_steer_robot() {
  VehicleSpec v;
  v.name = "skid-steer-robot";
  v.bodies.push_back({"chassis", 19.0, Vec3(0.0, 0.0, 0.15), Vec3(0.5, 0.35, 0.12), {}});
  v.hitch = Vec3(-0.25, 0.0, 0.12);
  for (const int end : {1, -1})
    for (const int side : {1, -1}) {
      VehicleWheelSpec w;
      w.name = std::string(end > 0 ? "front" : "rear") + (side > 0 ? "_left" : "_right");
      w.parent = "chassis";
      w.centre = Vec3(0.18 * end, 0.23 * side, 0.10);
      w.mass = 1.5;
      w.shape = rim(0.10, 0.08);
      w.drive.kind = DriveKind::dc_motor;
      w.drive.motor.voltage = 24.0;
      w.drive.motor.resistance = 0.6;
      w.drive.motor.torque_constant = 0.035;
      w.drive.motor.gear = 71.0;
      w.drive.motor.efficiency = 0.75;
      w.drive.motor.current_limit = 15.0;
      w.drive.motor.speed_gain = 10.0;
      v.wheels.push_back(w);
    }
  return v;
}

VehicleSpec two_axle_car() {
  VehicleSpec v;
  v.name = "two-axle-car";
  v.bodies.push_back({"chassis", 1020.0, Vec3(0.0, 0.0, 0.55), Vec3(3.6, 1.5, 0.6), {}});
  v.hitch = Vec3(-1.8, 0.0, 0.45);
  for (const int end : {1, -1})
    for (const int side : {1, -1}) {
      VehicleWheelSpec w;
      w.name = std::string(end > 0 ? "front" : "rear") + (side > 0 ? "_left" : "_right");
      w.parent = "chassis";
      w.centre = Vec3(1.25 * end, 0.72 * side, 0.32);
      w.mass = 20.0;
      w.shape = rim(0.32, 0.22);
      StrutSpec strut;
      strut.spring = {25e3, 2.0e3, 1020.0 / 4.0 * 9.81};
      strut.upright_mass = 20.0;
      w.strut = strut;
      if (end > 0) {
        SteeringSpec s;
        s.limit = 0.6;
        s.knuckle_mass = 5.0;
        w.steering = s;
        w.drive.kind = DriveKind::free;
      } else {
        w.drive.kind = DriveKind::speed;
        w.drive.max_torque = 1500.0;
      }
      v.wheels.push_back(w);
    }
  return v;
}

VehicleSpec towed_axle() {
  VehicleSpec v;
  v.name = "towed-axle";
  v.bodies.push_back({"frame", 50.0, Vec3(0.05, 0.0, 0.30), Vec3(0.8, 0.5, 0.2), {}});
  v.hitch = Vec3(0.90, 0.0, 0.20);
  const struct {
    const char* name;
    Vec3 centre;
    double mass;
  } wheels[] = {{"left", Vec3(0.0, 0.35, 0.20), 4.0},
                {"right", Vec3(0.0, -0.35, 0.20), 4.0},
                {"front", Vec3(0.70, 0.0, 0.20), 2.0}};
  for (const auto& p : wheels) {
    VehicleWheelSpec w;
    w.name = p.name;
    w.parent = "frame";
    w.centre = p.centre;
    w.mass = p.mass;
    w.shape = rim(0.20, 0.12);
    w.drive.kind = DriveKind::free;
    v.wheels.push_back(w);
  }
  return v;
}

const std::vector<std::string>& machine_names() {
  static const std::vector<std::string> names = {"rocker-bogie-rover", "skid-steer-robot", "two-axle-car",
                                                 "towed-axle"};
  return names;
}

VehicleSpec machine(const std::string& name) {
  if (name == "rocker-bogie-rover") return rocker_bogie_rover();
  if (name == "skid-steer-robot") return skid_steer_robot();
  if (name == "two-axle-car") return two_axle_car();
  if (name == "towed-axle") return towed_axle();
  const std::string near = nearest_word(name, machine_names());
  throw InputError(Problem{
      {},
      0,
      0,
      "machine",
      "'" + name + "' is not known",
      near.empty() ? "one of rocker-bogie-rover, skid-steer-robot, two-axle-car, towed-axle" : "'" + near + "'"});
}

}  // namespace terrode::vehicle
