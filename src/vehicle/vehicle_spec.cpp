// What a description of a machine must fulfil.
#include <algorithm>
#include <cmath>
#include <set>

#include "vehicle/vehicle.h"
#include "vehicle/vehicle_parts.h"

namespace terrode::vehicle {

using multibody::MassProperties;

namespace {

void check_spring(Problems& p, const std::string& key, const SpringSpec& s) {
  require(p, key + ".stiffness", s.stiffness, "N/m or N m/rad", s.stiffness >= 0.0, "0 or more");
  require(p, key + ".damping", s.damping, "N s/m or N m s/rad", s.damping >= 0.0, "0 or more");
  require(p, key + ".preload", s.preload, "N or N m", s.stiffness > 0.0 || s.preload == 0.0,
          "0, or a spring with stiffness");
  if (!(s.stiffness + s.damping > 0.0))
    p.push_back(vehicle_problem(key, "has neither stiffness nor damping", "one of them above 0"));
}

}  // namespace

double VehicleSpec::mass() const {
  double m = 0.0;
  for (const BodySpec& b : bodies) m += b.mass;
  for (const VehicleWheelSpec& w : wheels)
    m += w.mass + (w.strut ? w.strut->upright_mass : 0.0) +
         (w.steering && w.steering->joint.empty() ? w.steering->knuckle_mass : 0.0);
  return m;
}

Problems VehicleSpec::validate() const {
  Problems p;
  std::set<std::string> names, joint_names;
  const auto take = [&p](std::set<std::string>& taken, const std::string& key, const std::string& name_) {
    if (name_.empty())
      p.push_back(vehicle_problem(key + ".name", "is empty", "a name"));
    else if (!taken.insert(name_).second)
      p.push_back(vehicle_problem(key + ".name", "'" + name_ + "' is taken", "a name of its own"));
  };
  if (bodies.empty()) p.push_back(vehicle_problem("bodies", "is empty", "at least one body"));
  for (const BodySpec& b : bodies) {
    const std::string key = "bodies." + b.name;
    take(names, key, b.name);
    require(p, key + ".mass", b.mass, "kg", b.mass > 0.0, "a mass above 0");
    if (!b.position.allFinite()) p.push_back(vehicle_problem(key + ".position", "is not finite", "three lengths"));
    if (!b.inertia && !(b.size.allFinite() && b.size.minCoeff() > 0.0))
      p.push_back(vehicle_problem(key + ".size", "has a length of 0 or less", "three lengths above 0"));
  }
  if (wheels.empty()) p.push_back(vehicle_problem("wheels", "is empty", "at least one wheel"));
  const auto known = [&](const std::string& key, const std::string& name_) {
    if (names.contains(name_)) return;
    const std::string near = nearest_word(name_, {names.begin(), names.end()});
    p.push_back(vehicle_problem(key, "'" + name_ + "' is not a body", near.empty() ? "the name of a body" : "'" + near + "'"));
  };
  const std::set<std::string> body_names = names;
  for (const VehicleWheelSpec& w : wheels) {
    const std::string key = "wheels." + w.name;
    take(names, key, w.name);
    if (!body_names.contains(w.parent)) known(key + ".parent", w.parent);
    require(p, key + ".mass", w.mass, "kg", w.mass > 0.0, "a mass above 0");
    if (!w.centre.allFinite()) p.push_back(vehicle_problem(key + ".centre", "is not finite", "three lengths"));
    if (w.inertia)
      for (const Problem& q : MassProperties{w.mass, *w.inertia}.validate(key)) p.push_back(q);
    for (Problem q : w.shape.validate()) {
      q.key = key + "." + q.key;
      p.push_back(q);
    }
    if (!(w.drive.max_torque >= 0.0))
      p.push_back(vehicle_problem(key + ".drive.max_torque", "is below 0", "a torque, 0 or more"));
    if (w.drive.kind == DriveKind::torque && std::isinf(w.drive.max_torque))
      p.push_back(vehicle_problem(key + ".drive.max_torque", "is missing", "the largest torque of a torque drive"));
    if (w.drive.kind == DriveKind::dc_motor) {
      const DcMotorSpec& m = w.drive.motor;
      const std::string at = key + ".drive.motor";
      require(p, at + ".voltage", m.voltage, "V", m.voltage > 0.0, "a voltage above 0");
      require(p, at + ".resistance", m.resistance, "Ohm", m.resistance > 0.0, "a resistance above 0");
      require(p, at + ".torque_constant", m.torque_constant, "N m/A", m.torque_constant > 0.0, "above 0");
      require(p, at + ".gear", m.gear, "-", m.gear > 0.0, "a ratio above 0");
      require(p, at + ".efficiency", m.efficiency, "-", m.efficiency > 0.0 && m.efficiency <= 1.0,
              "above 0, at most 1");
      require(p, at + ".speed_gain", m.speed_gain, "V s/rad", m.speed_gain >= 0.0, "0 or more");
      if (!(m.current_limit > 0.0)) p.push_back(vehicle_problem(at + ".current_limit", "is not above 0", "a current above 0"));
    }
    if (w.strut) {
      check_spring(p, key + ".strut", w.strut->spring);
      require(p, key + ".strut.upright_mass", w.strut->upright_mass, "kg", w.strut->upright_mass > 0.0, "above 0");
    }
    if (w.steering) {
      const SteeringSpec& s = *w.steering;
      require(p, key + ".steering.limit", s.limit, "rad", s.limit > 0.0 && s.limit <= M_PI, "above 0, at most pi");
      require(p, key + ".steering.rate", s.rate, "rad/s", s.rate > 0.0, "above 0");
      require(p, key + ".steering.response", s.response, "s", s.response > 0.0, "above 0");
      require(p, key + ".steering.knuckle_mass", s.knuckle_mass, "kg", s.knuckle_mass > 0.0, "above 0");
      if (!s.joint.empty()) {
        const auto j = std::find_if(joints.begin(), joints.end(), [&](const JointSpec& x) { return x.name == s.joint; });
        if (j == joints.end() || j->kind != JointKind::hinge || j->body != w.parent || j->spring)
          p.push_back(vehicle_problem(key + ".steering.joint", "'" + s.joint + "' does not steer this wheel",
                                      "a hinge without spring whose body is the wheel's parent '" + w.parent + "'"));
        if (w.strut)
          p.push_back(vehicle_problem(key + ".strut", "stands beside steering.joint", "a slider of the machine's own joints"));
      }
    }
  }
  for (const JointSpec& j : joints) {
    const std::string key = "joints." + j.name;
    take(joint_names, key, j.name);
    known(key + ".body", j.body);
    known(key + ".parent", j.parent);
    if (j.body == j.parent) p.push_back(vehicle_problem(key, "joins '" + j.body + "' to itself", "two bodies"));
    if (!j.anchor.allFinite() || !j.anchor_on_parent.allFinite() || !j.axis.allFinite())
      p.push_back(vehicle_problem(key, "has a place or axis that is not finite", "finite numbers"));
    const bool has_axis = j.kind == JointKind::hinge || j.kind == JointKind::slider;
    if (has_axis && !(j.axis.norm() > 1e-9)) p.push_back(vehicle_problem(key + ".axis", "is zero", "a direction"));
    if (j.kind == JointKind::rod && !((j.anchor - j.anchor_on_parent).norm() > 1e-9))
      p.push_back(vehicle_problem(key + ".anchor_on_parent", "is where the other end is", "a rod with a length"));
    if (j.spring && !has_axis)
      p.push_back(vehicle_problem(key + ".spring", "stands at a joint without axis", "a hinge or slider"));
    if (j.spring) check_spring(p, key + ".spring", *j.spring);
  }
  for (const VehicleWheelSpec& w : wheels) {
    joint_names.insert(w.name + ".axle");
    if (w.steering && w.steering->joint.empty()) joint_names.insert(w.name + ".steering");
    if (w.strut) joint_names.insert(w.name + ".strut");
  }
  std::set<std::string> sensor_names;
  for (const SensorSpec& s : sensors) {
    const std::string key = "sensors." + s.name;
    take(sensor_names, key, s.name);
    require(p, key + ".noise", s.noise, "of its unit", s.noise >= 0.0, "0 or more");
    if (s.kind == SensorKind::imu) {
      known(key + ".body", s.body);
      if (!s.position.allFinite()) p.push_back(vehicle_problem(key + ".position", "is not finite", "three lengths"));
    } else if (!joint_names.contains(s.joint)) {
      const std::string near = nearest_word(s.joint, {joint_names.begin(), joint_names.end()});
      p.push_back(vehicle_problem(key + ".joint", "'" + s.joint + "' is not a joint",
                                  near.empty() ? "the name of a joint, or <wheel>.axle, .steering, .strut" : "'" + near + "'"));
    }
    if (s.kind == SensorKind::encoder)
      for (const JointSpec& j : joints)
        if (j.name == s.joint && j.kind != JointKind::hinge && j.kind != JointKind::slider)
          p.push_back(vehicle_problem(key + ".joint", "'" + s.joint + "' has no axis", "a hinge or slider"));
  }
  if (!hitch.allFinite()) p.push_back(vehicle_problem("hitch", "is not finite", "three lengths"));
  return p;
}

Problems VehicleOptions::validate() const {
  Problems p;
  require(p, "options.time_step", time_step, "s", time_step >= multibody::kShortestStep && time_step <= 0.1, "from 1e-9 to 0.1 s");
  require(p, "options.sample_interval", sample_interval, "s", sample_interval >= 0.0, "0 or more");
  require(p, "options.settle_time", settle_time, "s", settle_time > 0.0, "above 0");
  if (!gravity.allFinite() || !(gravity.z() < 0.0))
    p.push_back(vehicle_problem("options.gravity", "does not point down", "a finite vector with z below 0"));
  require(p, "options.start_x", start_x, "m", true, "a finite position");
  require(p, "options.start_y", start_y, "m", true, "a finite position");
  require(p, "options.start_heading", start_heading, "rad", true, "a finite angle");
  require(p, "options.immobile_time", immobile_time, "s", immobile_time > 0.0, "above 0");
  require(p, "options.immobile_share", immobile_share, "-", immobile_share >= 0.0 && immobile_share < 1.0, "0 to 1");
  require(p, "options.margin_interval", margin_interval, "s", margin_interval >= 0.0, "0 or more");
  require(p, "options.margin_largest", margin_largest, "N", margin_largest >= 0.0, "0 or more");
  require(p, "options.margin_rate", margin_rate, "N/s", margin_rate >= 0.0, "0 or more");
  std::set<std::string> rock_names;
  for (const RockSpec& r : rocks) {
    const Problems wrong = r.validate("rocks." + r.name);
    p.insert(p.end(), wrong.begin(), wrong.end());
    if (!rock_names.insert(r.name).second)
      p.push_back(vehicle_problem("rocks." + r.name + ".name", "is taken", "a name of its own"));
  }
  for (const Problem& q : rock_contact.validate("rock_contact")) p.push_back(q);
  return p;
}

}  // namespace terrode::vehicle
