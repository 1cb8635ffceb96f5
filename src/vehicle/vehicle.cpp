#include "vehicle/vehicle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace terrode::vehicle {

using multibody::AxisJoint;
using multibody::Body;
using multibody::Hinge;
using multibody::MassProperties;
using multibody::Motor;
using multibody::Slider;

namespace {

constexpr double standstill = 1e-9;         // m/s of the rim, below which slip has no meaning
constexpr double overturned_cos = 0.25;     // of the angle between the machine's up and the ground's
constexpr double torque_servo_speed = 1e4;  // rad/s no wheel reaches: a motor set to it gives its largest torque

double smooth_step(double u) {
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 1.0;
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

Problem problem(std::string key, std::string message, std::string expected) {
  return {{}, 0, 0, std::move(key), std::move(message), std::move(expected)};
}

void check_spring(Problems& p, const std::string& key, const SpringSpec& s) {
  require(p, key + ".stiffness", s.stiffness, "N/m or N m/rad", s.stiffness >= 0.0, "0 or more");
  require(p, key + ".damping", s.damping, "N s/m or N m s/rad", s.damping >= 0.0, "0 or more");
  require(p, key + ".preload", s.preload, "N or N m", s.stiffness > 0.0 || s.preload == 0.0,
          "0, or a spring with stiffness");
  if (!(s.stiffness + s.damping > 0.0))
    p.push_back(problem(key, "has neither stiffness nor damping", "one of them above 0"));
}

void set_spring(AxisJoint& joint, const SpringSpec& s) {
  joint.set_spring(s.stiffness, s.damping, s.stiffness > 0.0 ? s.preload / s.stiffness : 0.0);
}

double torque_per_amp(const DcMotorSpec& m) { return m.efficiency * m.gear * m.torque_constant; }

}  // namespace

// ------------------------------------------------------------------------------------------------------------- specs

double VehicleSpec::mass() const {
  double m = 0.0;
  for (const BodySpec& b : bodies) m += b.mass;
  for (const VehicleWheelSpec& w : wheels)
    m += w.mass + (w.strut ? w.strut->upright_mass : 0.0) + (w.steering ? w.steering->knuckle_mass : 0.0);
  return m;
}

Problems VehicleSpec::validate() const {
  Problems p;
  std::set<std::string> names, joint_names;
  const auto take = [&p](std::set<std::string>& taken, const std::string& key, const std::string& name_) {
    if (name_.empty())
      p.push_back(problem(key + ".name", "is empty", "a name"));
    else if (!taken.insert(name_).second)
      p.push_back(problem(key + ".name", "'" + name_ + "' is taken", "a name of its own"));
  };
  if (bodies.empty()) p.push_back(problem("bodies", "is empty", "at least one body"));
  for (const BodySpec& b : bodies) {
    const std::string key = "bodies." + b.name;
    take(names, key, b.name);
    require(p, key + ".mass", b.mass, "kg", b.mass > 0.0, "a mass above 0");
    if (!b.position.allFinite()) p.push_back(problem(key + ".position", "is not finite", "three lengths"));
    if (!b.inertia && !(b.size.allFinite() && b.size.minCoeff() > 0.0))
      p.push_back(problem(key + ".size", "has a length of 0 or less", "three lengths above 0"));
  }
  if (wheels.empty()) p.push_back(problem("wheels", "is empty", "at least one wheel"));
  const auto known = [&](const std::string& key, const std::string& name_) {
    if (names.contains(name_)) return;
    const std::string near = nearest_word(name_, {names.begin(), names.end()});
    p.push_back(problem(key, "'" + name_ + "' is not a body", near.empty() ? "the name of a body" : "'" + near + "'"));
  };
  const std::set<std::string> body_names = names;
  for (const VehicleWheelSpec& w : wheels) {
    const std::string key = "wheels." + w.name;
    take(names, key, w.name);
    if (!body_names.contains(w.parent)) known(key + ".parent", w.parent);
    require(p, key + ".mass", w.mass, "kg", w.mass > 0.0, "a mass above 0");
    if (!w.centre.allFinite()) p.push_back(problem(key + ".centre", "is not finite", "three lengths"));
    for (Problem q : w.shape.validate()) {
      q.key = key + "." + q.key;
      p.push_back(q);
    }
    if (!(w.drive.max_torque >= 0.0))
      p.push_back(problem(key + ".drive.max_torque", "is below 0", "a torque, 0 or more"));
    if (w.drive.kind == DriveKind::torque && std::isinf(w.drive.max_torque))
      p.push_back(problem(key + ".drive.max_torque", "is missing", "the largest torque of a torque drive"));
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
      if (!(m.current_limit > 0.0)) p.push_back(problem(at + ".current_limit", "is not above 0", "a current above 0"));
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
    }
  }
  for (const JointSpec& j : joints) {
    const std::string key = "joints." + j.name;
    take(joint_names, key, j.name);
    known(key + ".body", j.body);
    known(key + ".parent", j.parent);
    if (j.body == j.parent) p.push_back(problem(key, "joins '" + j.body + "' to itself", "two bodies"));
    if (!j.anchor.allFinite() || !j.anchor_on_parent.allFinite() || !j.axis.allFinite())
      p.push_back(problem(key, "has a place or axis that is not finite", "finite numbers"));
    const bool has_axis = j.kind == JointKind::hinge || j.kind == JointKind::slider;
    if (has_axis && !(j.axis.norm() > 1e-9)) p.push_back(problem(key + ".axis", "is zero", "a direction"));
    if (j.kind == JointKind::rod && !((j.anchor - j.anchor_on_parent).norm() > 1e-9))
      p.push_back(problem(key + ".anchor_on_parent", "is where the other end is", "a rod with a length"));
    if (j.spring && !has_axis)
      p.push_back(problem(key + ".spring", "stands at a joint without axis", "a hinge or slider"));
    if (j.spring) check_spring(p, key + ".spring", *j.spring);
  }
  if (!hitch.allFinite()) p.push_back(problem("hitch", "is not finite", "three lengths"));
  return p;
}

Problems VehicleOptions::validate() const {
  Problems p;
  require(p, "options.time_step", time_step, "s", time_step > 0.0 && time_step <= 0.1, "above 0, at most 0.1 s");
  require(p, "options.sample_interval", sample_interval, "s", sample_interval >= 0.0, "0 or more");
  require(p, "options.settle_time", settle_time, "s", settle_time > 0.0, "above 0");
  if (!gravity.allFinite() || !(gravity.z() < 0.0))
    p.push_back(problem("options.gravity", "does not point down", "a finite vector with z below 0"));
  require(p, "options.start_x", start_x, "m", true, "a finite position");
  require(p, "options.start_y", start_y, "m", true, "a finite position");
  require(p, "options.start_heading", start_heading, "rad", true, "a finite angle");
  require(p, "options.immobile_time", immobile_time, "s", immobile_time > 0.0, "above 0");
  require(p, "options.immobile_share", immobile_share, "-", immobile_share >= 0.0 && immobile_share < 1.0, "0 to 1");
  return p;
}

// ---------------------------------------------------------------------------------------------------------- building

struct Vehicle::WheelParts {
  Body* body = nullptr;
  Hinge* axle = nullptr;
  Hinge* steering = nullptr;
  Slider* strut = nullptr;
  double radius = 0.0;
  double command = 0.0, target_angle = 0.0, energy = 0.0;
  double axle_rate = 0.0, steering_rate = 0.0;  // at the step's beginning
  bool voltage_limited = false;
};

Vehicle::Vehicle(const VehicleSpec& spec, const VehicleOptions& options, std::unique_ptr<terrain::Terrain> ground)
    : spec_(spec), options_(options), ground_(std::move(ground)) {
  Problems p = spec.validate();
  const Problems more = options.validate();
  p.insert(p.end(), more.begin(), more.end());
  if (ground_ == nullptr) p.push_back(problem("ground", "is missing", "a ground under the machine"));
  throw_if_any(p);
  build();
}

Vehicle::~Vehicle() = default;

void Vehicle::build() {
  const Quat turn(Eigen::AngleAxisd(options_.start_heading, Vec3::UnitZ()));
  const Vec3 across = turn * Vec3::UnitY();
  const auto ground_place = [&](const Vec3& p) {
    return Vec3(turn * Vec3(p.x(), p.y(), 0.0) + Vec3(options_.start_x, options_.start_y, 0.0));
  };
  // Highest lift at which some wheel just touches: the rim over the ground around its lowest point.
  double lift = -std::numeric_limits<double>::infinity();
  std::vector<std::shared_ptr<const wheel::Wheel>> shapes;
  for (const VehicleWheelSpec& w : spec_.wheels) {
    shapes.push_back(std::make_shared<wheel::Wheel>(w.shape));
    const double r = w.shape.radius + w.shape.grousers.height;
    for (int i = -8; i <= 8; ++i)
      for (int j = -1; j <= 1; ++j) {
        const double dx = r * i / 8.0, dy = 0.5 * w.shape.width * j;
        const Vec3 at = ground_place(w.centre) + turn * Vec3(dx, dy, 0.0);
        lift = std::max(lift, ground_->undisturbed_height(at.x(), at.y()) + std::sqrt(std::max(0.0, r * r - dx * dx)) -
                                  w.centre.z());
      }
  }
  const auto place = [&](const Vec3& p) { return Vec3(ground_place(p) + Vec3(0, 0, p.z() + lift)); };
  const auto pose = [&](const Vec3& p) { return Pose{place(p), turn}; };

  multibody::WorldOptions w_options;
  w_options.gravity = Vec3::Zero();
  world_ = std::make_unique<multibody::World>(w_options);
  simulation_ = std::make_unique<Simulation>(*world_, *ground_);
  for (const BodySpec& b : spec_.bodies) {
    MassProperties m = MassProperties::box(b.mass, b.size);
    if (b.inertia) m.inertia_B = *b.inertia;
    bodies_[b.name] = &world_->add_body(b.name, m, pose(b.position));
  }
  chassis_ = bodies_.at(spec_.bodies.front().name);
  origin_in_chassis_ = -spec_.bodies.front().position;
  hitch_in_chassis_ = spec_.hitch - spec_.bodies.front().position;

  for (std::size_t i = 0; i < spec_.wheels.size(); ++i) {
    const VehicleWheelSpec& w = spec_.wheels[i];
    WheelParts parts;
    parts.radius = w.shape.radius;
    Body* parent = bodies_.at(w.parent);
    const Pose centre = pose(w.centre);
    const auto small_box = [&](double mass) { return MassProperties::box(mass, Vec3::Constant(0.6 * w.shape.radius)); };
    if (w.strut) {
      Body& upright = world_->add_body(w.name + ".upright", small_box(w.strut->upright_mass), centre);
      parts.strut = &world_->add_slider(w.name + ".strut", upright, parent, Vec3::UnitZ());
      // Preload presses the upright down: the rest position lies below.
      const SpringSpec& s = w.strut->spring;
      parts.strut->set_spring(s.stiffness, s.damping, s.stiffness > 0.0 ? -s.preload / s.stiffness : 0.0);
      sprung_.push_back(parts.strut);
      joints_[parts.strut->name()] = parts.strut;
      parent = &upright;
    }
    if (w.steering) {
      Body& knuckle = world_->add_body(w.name + ".knuckle", small_box(w.steering->knuckle_mass), centre);
      parts.steering = &world_->add_hinge(w.name + ".steering", knuckle, parent, centre.p_W, Vec3::UnitZ());
      parts.steering->set_motor({0.0});
      joints_[parts.steering->name()] = parts.steering;
      parent = &knuckle;
    }
    parts.body = &world_->add_body(w.name, MassProperties::cylinder(w.mass, w.shape.radius, w.shape.width), centre);
    bodies_[w.name] = parts.body;
    parts.axle = &world_->add_hinge(w.name + ".axle", *parts.body, parent, centre.p_W, across);
    joints_[parts.axle->name()] = parts.axle;
    simulation_->add(*parts.body, shapes[i]);
    wheels_.push_back(parts);
  }
  for (const JointSpec& j : spec_.joints) {
    Body& b = *bodies_.at(j.body);
    Body* parent = bodies_.at(j.parent);
    const Vec3 axis = turn * j.axis;
    multibody::Joint* made = nullptr;
    AxisJoint* sprung = nullptr;
    switch (j.kind) {
      case JointKind::fixed:
        made = &world_->add_fixed(j.name, b, parent);
        break;
      case JointKind::hinge:
        made = sprung = &world_->add_hinge(j.name, b, parent, place(j.anchor), axis);
        break;
      case JointKind::slider:
        made = sprung = &world_->add_slider(j.name, b, parent, axis);
        break;
      case JointKind::ball:
        made = &world_->add_ball(j.name, b, parent, place(j.anchor));
        break;
      case JointKind::rod:
        made = &world_->add_rod(j.name, b, parent, place(j.anchor), place(j.anchor_on_parent));
        break;
    }
    joints_[j.name] = made;
    if (j.spring) {
      set_spring(*sprung, *j.spring);
      sprung_.push_back(sprung);
    }
  }
  velocity_before_.resize(world_->bodies().size());
  rate_before_.resize(sprung_.size());
  last_.wheels.resize(wheels_.size());
  last_.pose = chassis_->pose();
  last_.heading = options_.start_heading;
}

Body& Vehicle::body(const std::string& name) {
  const auto it = bodies_.find(name);
  if (it == bodies_.end()) throw InputError(problem("body", "'" + name + "' is not there", "a body of the machine"));
  return *it->second;
}

multibody::Joint& Vehicle::joint(const std::string& name) {
  const auto it = joints_.find(name);
  if (it == joints_.end()) throw InputError(problem("joint", "'" + name + "' is not there", "a joint of the machine"));
  return *it->second;
}

double Vehicle::time() const { return settled_ ? world_->time() - zero_time_ : 0.0; }

// ---------------------------------------------------------------------------------------------------------- commands

void Vehicle::drive(std::size_t wheel, double command) {
  if (wheel >= wheels_.size() || !std::isfinite(command))
    throw InputError(
        problem("drive", fmt::format("of wheel {} is {:.6g}", wheel, command), "a wheel and a finite command"));
  wheels_[wheel].command = command;
}

void Vehicle::steer(std::size_t wheel, double angle) {
  if (wheel >= wheels_.size() || !std::isfinite(angle))
    throw InputError(
        problem("steer", fmt::format("of wheel {} is {:.6g}", wheel, angle), "a wheel and a finite angle"));
  if (!spec_.wheels[wheel].steering) return;
  const double limit = spec_.wheels[wheel].steering->limit;
  wheels_[wheel].target_angle = std::clamp(angle, -limit, limit);
}

void Vehicle::drive_path(double speed, double curvature) {
  // A machine with steered and unsteered wheels turns about a point beside the unsteered ones.
  double fixed_x = 0.0;
  int fixed = 0;
  for (const VehicleWheelSpec& w : spec_.wheels)
    if (!w.steering) {
      fixed_x += w.centre.x();
      ++fixed;
    }
  const bool all = fixed == static_cast<int>(spec_.wheels.size());
  fixed_x = fixed > 0 && !all ? fixed_x / fixed : 0.0;
  commanded_speed_ = speed;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const VehicleWheelSpec& w = spec_.wheels[i];
    const double along = 1.0 - curvature * w.centre.y(), aside = curvature * (w.centre.x() - fixed_x);
    double angle = 0.0;
    if (w.steering) {
      angle = along >= 0.0 ? std::atan2(aside, along) : std::atan2(-aside, -along);
      steer(i, angle);
      angle = wheels_[i].target_angle;
    }
    if (w.drive.kind != DriveKind::torque)
      drive(i, speed * (along * std::cos(angle) + aside * std::sin(angle)) / wheels_[i].radius);
  }
}

void Vehicle::turn_in_place(double yaw_rate) {
  commanded_speed_ = 0.0;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const VehicleWheelSpec& w = spec_.wheels[i];
    const double along = -yaw_rate * w.centre.y(), aside = yaw_rate * w.centre.x();
    double angle = 0.0;
    if (w.steering && std::hypot(along, aside) > 0.0) {
      angle = along >= 0.0 ? std::atan2(aside, along) : std::atan2(-aside, -along);
      steer(i, angle);
      angle = wheels_[i].target_angle;
    }
    if (w.drive.kind != DriveKind::torque)
      drive(i, (along * std::cos(angle) + aside * std::sin(angle)) / wheels_[i].radius);
  }
}

void Vehicle::apply_drives() {
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    WheelParts& w = wheels_[i];
    const VehicleWheelSpec& s = spec_.wheels[i];
    w.axle_rate = w.axle->rate();
    w.voltage_limited = false;
    if (w.steering != nullptr) {
      const double wanted = (w.target_angle - w.steering->position()) / s.steering->response;
      w.steering_rate = w.steering->rate();
      w.steering->set_motor({std::clamp(wanted, -s.steering->rate, s.steering->rate)});
    }
    if (!settled_) {
      w.axle->set_motor({0.0, std::numeric_limits<double>::infinity(), true});
      continue;
    }
    switch (s.drive.kind) {
      case DriveKind::free:
        w.axle->clear_motor();
        break;
      case DriveKind::speed:
        w.axle->set_motor({w.command, s.drive.max_torque, true});
        break;
      case DriveKind::torque:
        w.axle->set_motor(
            {std::copysign(torque_servo_speed, w.command), std::min(std::abs(w.command), s.drive.max_torque), true});
        break;
      case DriveKind::dc_motor: {
        const DcMotorSpec& m = s.drive.motor;
        const double back_emf = m.torque_constant * m.gear;
        const double wanted = back_emf * w.command + m.speed_gain * (w.command - w.axle_rate);
        const double torque_per_ampere = torque_per_amp(m);
        const double limit = std::min(torque_per_ampere * m.current_limit, s.drive.max_torque);
        w.voltage_limited = std::abs(wanted) > m.voltage;
        if (w.voltage_limited)
          w.axle->set_motor({std::copysign(m.voltage, wanted) / back_emf, limit, true,
                             m.resistance / (torque_per_ampere * back_emf)});
        else
          w.axle->set_motor({w.command, limit, true, m.resistance / (torque_per_ampere * (back_emf + m.speed_gain))});
        break;
      }
    }
  }
}

// -------------------------------------------------------------------------------------------------------------- steps

void Vehicle::settle(const Progress& progress) {
  if (settled_) return;
  const double h = options_.time_step;
  const auto count = static_cast<std::size_t>(std::ceil(1.5 * options_.settle_time / h));
  for (std::size_t n = 0; n < count; ++n) {
    if (n % 64 == 0 && progress.stop_requested()) throw Interrupted("stopped while the machine was set down");
    world_->set_gravity(options_.gravity * smooth_step(static_cast<double>(n + 1) * h / options_.settle_time));
    advance();
  }
  settled_ = true;
  zero_time_ = world_->time();
  travel_ = 0.0;
  for (WheelParts& w : wheels_) w.energy = 0.0;
}

void Vehicle::step() {
  settle();
  advance();
}

void Vehicle::advance() {
  const double h = options_.time_step;
  const auto& bodies = world_->bodies();
  const Vec3 g = world_->options().gravity;
  for (std::size_t i = 0; i < bodies.size(); ++i) velocity_before_[i] = bodies[i]->twist().v_W;
  for (std::size_t i = 0; i < sprung_.size(); ++i) rate_before_[i] = sprung_[i]->rate();
  apply_drives();

  const Pose pose = chassis_->pose();
  const Twist twist = chassis_->twist();
  const Vec3 ahead = pose.R_WB * Vec3::UnitX(), left = pose.R_WB * Vec3::UnitY();
  const Vec3 heading = Vec3(ahead.x(), ahead.y(), 0.0).normalized();
  const Vec3 hitch_arm = pose.R_WB * hitch_in_chassis_;
  const Vec3 hitch_force = -hitch_pull_ * heading;
  if (hitch_pull_ != 0.0) chassis_->add_force_at(hitch_force, pose.p_W + hitch_arm);

  last_.time = time();
  last_.pose = {pose.p_W + pose.R_WB * origin_in_chassis_, pose.R_WB};
  last_.twist = {twist.v_W + twist.w_W.cross(pose.R_WB * origin_in_chassis_), twist.w_W};
  last_.heading += std::remainder(std::atan2(heading.y(), heading.x()) - last_.heading, 2.0 * M_PI);
  last_.pitch = -std::asin(std::clamp(ahead.z(), -1.0, 1.0));
  last_.roll = std::asin(std::clamp(left.z(), -1.0, 1.0));
  last_.speed = last_.twist.v_W.dot(heading);
  last_.travel = travel_;
  last_.hitch_pull = hitch_pull_;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    WheelSample& s = last_.wheels[i];
    const WheelParts& w = wheels_[i];
    const Pose at = w.body->pose();
    const Twist u = w.body->twist();
    const Vec3 axle = at.R_WB * Vec3::UnitY();
    const Vec3 along = axle.cross(Vec3::UnitZ()).normalized();
    s.forward_velocity = u.v_W.dot(along);
    s.angular_velocity = u.w_W.dot(axle);
    const double rim = s.angular_velocity * w.radius;
    s.slip = std::abs(rim) > standstill ? 1.0 - s.forward_velocity / rim : 0.0;
    s.sinkage = ground_->undisturbed_height(at.p_W.x(), at.p_W.y()) - (at.p_W.z() - w.radius);
    s.steering_angle = w.steering != nullptr ? w.steering->position() : 0.0;
    if (s.sinkage >= w.radius)
      throw RunError(fmt::format("wheel '{}' at t = {:.6g} s is buried to its axle (sinkage {:.4g} m, radius {:.4g} m)",
                                 spec_.wheels[i].name, last_.time, s.sinkage, w.radius));
  }

  simulation_->step(h);

  for (std::size_t i = 0; i < wheels_.size(); ++i) sample(i);
  for (std::size_t i = 0; i < bodies.size(); ++i)
    gravity_work_ += 0.5 * h * bodies[i]->mass() * g.dot(velocity_before_[i] + bodies[i]->twist().v_W);
  for (std::size_t i = 0; i < sprung_.size(); ++i)
    spring_work_ += 0.5 * h * sprung_[i]->effort() * (rate_before_[i] + sprung_[i]->rate());
  const Twist after = chassis_->twist();
  const Vec3 hitch_velocity =
      twist.v_W + twist.w_W.cross(hitch_arm) + after.v_W + after.w_W.cross(chassis_->pose().R_WB * hitch_in_chassis_);
  hitch_work_ += 0.5 * h * hitch_force.dot(hitch_velocity);
  travel_ += h * last_.twist.v_W.head<2>().norm();
}

// What is known of a wheel only after the step.
void Vehicle::sample(std::size_t i) {
  const double h = options_.time_step;
  WheelSample& s = last_.wheels[i];
  WheelParts& w = wheels_[i];
  const VehicleWheelSpec& spec = spec_.wheels[i];
  const Vec3 axle = w.axle->axis();
  const Vec3 along = axle.cross(Vec3::UnitZ()).normalized();
  const Vec3 F = simulation_->contacts()[i].wrench.F_W;
  s.drawbar_pull = F.dot(along);
  s.lateral_force = F.dot(Vec3::UnitZ().cross(along));
  s.normal_load = F.z();
  s.driving_torque = w.axle->effort();
  const double rate = 0.5 * (w.axle_rate + w.axle->rate());
  s.power = s.driving_torque * rate;
  s.electric_power = s.power;
  s.limited = w.voltage_limited || w.axle->saturated();
  if (spec.drive.kind == DriveKind::dc_motor) {
    const DcMotorSpec& m = spec.drive.motor;
    const double current = s.driving_torque / torque_per_amp(m);
    s.electric_power = current * current * m.resistance + s.power * (s.power > 0.0 ? 1.0 / m.efficiency : m.efficiency);
  }
  w.energy += h * s.power;
  s.energy = w.energy;
  drive_work_ += h * s.power;
  if (w.steering != nullptr) drive_work_ += 0.5 * h * w.steering->effort() * (w.steering_rate + w.steering->rate());
}

VehicleEnergy Vehicle::energy() const {
  VehicleEnergy e;
  e.drives = drive_work_;
  e.gravity = gravity_work_;
  e.hitch = hitch_work_;
  e.springs = spring_work_;
  for (const auto& b : world_->bodies()) e.kinetic += b->kinetic_energy();
  for (const GroundContact& c : simulation_->contacts()) e.ground += c.work;
  return e;
}

// --------------------------------------------------------------------------------------------------------------- runs

namespace {

struct WheelChannel {
  const char* name;
  const char* unit;
  double WheelSample::*field;
};

constexpr WheelChannel wheel_channels[] = {
    {"drawbar_pull", "N", &WheelSample::drawbar_pull},
    {"driving_torque", "N m", &WheelSample::driving_torque},
    {"sinkage", "m", &WheelSample::sinkage},
    {"normal_load", "N", &WheelSample::normal_load},
    {"lateral_force", "N", &WheelSample::lateral_force},
    {"angular_velocity", "rad/s", &WheelSample::angular_velocity},
    {"forward_velocity", "m/s", &WheelSample::forward_velocity},
    {"slip", "", &WheelSample::slip},
    {"power", "W", &WheelSample::power},
    {"electric_power", "W", &WheelSample::electric_power},
    {"energy", "J", &WheelSample::energy},
    {"steering_angle", "rad", &WheelSample::steering_angle},
};

struct BodyChannel {
  const char* name;
  const char* unit;
  double (*value)(const VehicleSample&);
};

constexpr BodyChannel body_channels[] = {
    {"position_x", "m", [](const VehicleSample& s) { return s.pose.p_W.x(); }},
    {"position_y", "m", [](const VehicleSample& s) { return s.pose.p_W.y(); }},
    {"position_z", "m", [](const VehicleSample& s) { return s.pose.p_W.z(); }},
    {"heading", "rad", [](const VehicleSample& s) { return s.heading; }},
    {"pitch", "rad", [](const VehicleSample& s) { return s.pitch; }},
    {"roll", "rad", [](const VehicleSample& s) { return s.roll; }},
    {"forward_velocity", "m/s", [](const VehicleSample& s) { return s.speed; }},
    {"yaw_rate", "rad/s", [](const VehicleSample& s) { return s.twist.w_W.z(); }},
    {"travel", "m", [](const VehicleSample& s) { return s.travel; }},
    {"hitch_pull", "N", [](const VehicleSample& s) { return s.hitch_pull; }},
    {"power", "W",
     [](const VehicleSample& s) {
       double p = 0.0;
       for (const WheelSample& w : s.wheels) p += w.power;
       return p;
     }},
};

}  // namespace

std::string Vehicle::immobile_reason() const {
  int driven = 0, spinning = 0, limited = 0;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    if (spec_.wheels[i].drive.kind == DriveKind::free) continue;
    ++driven;
    if (last_.wheels[i].slip > 0.8) ++spinning;
    if (last_.wheels[i].limited && std::abs(last_.wheels[i].angular_velocity) < 0.1 * std::abs(wheels_[i].command))
      ++limited;
  }
  if (2 * limited > driven) return "its motors stall at their limit";
  if (2 * spinning > driven) return "its wheels spin: the soil's shear strength is used up";
  return "its wheels neither spin nor stall: it is held by its load or by an obstacle";
}

recording::Run Vehicle::empty_run() const {
  recording::Run run;
  for (const BodyChannel& c : body_channels) run.channels.push_back({c.name, c.unit, {}});
  for (const VehicleWheelSpec& w : spec_.wheels)
    for (const WheelChannel& c : wheel_channels) run.channels.push_back({w.name + "_" + c.name, c.unit, {}});
  return run;
}

recording::Run Vehicle::run(Controller& controller, double duration, const Progress& progress) {
  if (!(duration > 0.0) || !std::isfinite(duration))
    throw InputError(problem("duration", fmt::format("is {:.6g} s", duration), "a finite time above 0"));
  settle(progress);
  const double h = options_.time_step;
  const auto block = static_cast<std::size_t>(std::max(1.0, std::round(options_.sample_interval / h)));
  const auto samples = static_cast<std::size_t>(duration / h / static_cast<double>(block)) + 2;

  const bool resumed = !run_.channels.empty();
  if (!resumed) {
    run_ = empty_run();
    course_ = {};
    course_.mark_time = time();
  }
  recording::Run& run = run_;
  run.time.reserve(samples);
  for (recording::Channel& c : run.channels) c.values.reserve(samples);
  std::vector<double> sums(run.channels.size());
  auto& [n, mark_time, commanded, covered, ended] = course_;
  const auto steps = static_cast<std::size_t>(std::llround(duration / h));
  while (n < steps && !ended) {
    if (progress.stop_requested()) throw Interrupted(fmt::format("stopped at t = {:.6g} s", time()));
    std::fill(sums.begin(), sums.end(), 0.0);
    double time_sum = 0.0;
    std::size_t taken = 0;
    for (; taken < block && n < steps && !ended; ++taken, ++n) {
      controller.command(*this);
      if (controller.finished(*this)) {
        ended = true;
        break;
      }
      step();
      time_sum += last_.time;
      std::size_t k = 0;
      for (const BodyChannel& c : body_channels) sums[k++] += c.value(last_);
      for (const WheelSample& w : last_.wheels)
        for (const WheelChannel& c : wheel_channels) sums[k++] += w.*c.field;
      commanded += h * std::abs(commanded_speed_);
      covered += h * std::copysign(last_.speed, last_.speed * commanded_speed_);
      if ((last_.pose.R_WB * Vec3::UnitZ()).z() < overturned_cos) {
        events_.push_back(fmt::format("overturned at t = {:.6g} s", last_.time));
        ended = true;
      } else if (last_.time - mark_time >= options_.immobile_time) {
        if (commanded > 0.0 && covered < options_.immobile_share * commanded) {
          events_.push_back(
              fmt::format("immobilised at t = {:.6g} s: {:.3g} m covered of {:.3g} m driven in {:.3g} s; {}",
                          last_.time, covered, commanded, last_.time - mark_time, immobile_reason()));
          ended = true;
        }
        mark_time = last_.time;
        commanded = covered = 0.0;
      }
    }
    if (taken == 0) break;
    const double scale = 1.0 / static_cast<double>(taken);
    run.time.push_back(time_sum * scale);
    for (std::size_t k = 0; k < sums.size(); ++k) run.channels[k].values.push_back(sums[k] * scale);
    if (observer_) observer_(*this);
    progress.report(static_cast<double>(n) / static_cast<double>(steps), spec_.name);
  }
  return std::move(run_);
}

recording::Checkpoint Vehicle::checkpoint(const Controller& controller) const {
  recording::Checkpoint c;
  const VehicleState state = snapshot(&controller);
  c.numbers["world"] = state.simulation.world;
  c.numbers["contacts"] = state.simulation.contacts;
  c.numbers["vehicle"] = state.numbers;
  c.numbers["controller"] = state.controller;
  c.numbers["course"] = {static_cast<double>(course_.steps), course_.mark_time, course_.commanded, course_.covered,
                         course_.ended ? 1.0 : 0.0};
  c.bytes["ground"] = state.simulation.ground;
  c.put_samples(run_);
  return c;
}

void Vehicle::resume(const recording::Checkpoint& c, Controller& controller) {
  recording::Run run = empty_run();
  c.take_samples(run);
  const std::vector<double>& course = c.number("course");
  if (course.size() != 5) throw InputError(problem("checkpoint", "is of another machine", "one of " + spec_.name));
  restore({{c.number("world"), c.byte("ground"), c.number("contacts")}, c.number("vehicle"), c.number("controller")},
          &controller);
  course_ = {static_cast<std::size_t>(course[0]), course[1], course[2], course[3], course[4] != 0.0};
  run_ = std::move(run);
}

double Vehicle::remaining_pull(double rate, double largest) {
  Problems p;
  require(p, "remaining_pull.rate", rate, "N/s", rate > 0.0, "above 0");
  require(p, "remaining_pull.largest", largest, "N", largest > 0.0, "above 0");
  throw_if_any(p);
  settle();
  const VehicleState before = snapshot();
  const VehicleSample sample_before = last_;
  const double pull_before = hitch_pull_, h = options_.time_step;
  // What the wheels gave over a quarter second is the pull plus mass times acceleration: the machine's own inertia
  // still holds some pull after its wheels no longer do.
  const auto window = static_cast<std::size_t>(std::max(1.0, std::round(0.25 / h)));
  const double seconds = static_cast<double>(window) * h, mass = spec_.mass();
  double found = 0.0;
  try {
    while (hitch_pull_ - pull_before < largest) {
      const Vec3 from = chassis_->pose().p_W, v0 = chassis_->twist().v_W;
      const Vec3 heading = chassis_->pose().R_WB * Vec3::UnitX();
      double pull = 0.0;
      for (std::size_t k = 0; k < window; ++k) {
        hitch_pull_ += rate * h;
        step();
        pull += (hitch_pull_ - pull_before) / static_cast<double>(window);
      }
      found = std::max(found, pull + mass * (chassis_->twist().v_W - v0).dot(heading) / seconds);
      if ((chassis_->pose().p_W - from).dot(heading) < 0.05 * commanded_speed_ * seconds) break;
    }
  } catch (const RunError&) {
    // It dug itself in: what it held until then counts.
  }
  found = std::min(found, largest);
  restore(before);
  last_ = sample_before;
  return found;
}

VehicleState Vehicle::snapshot(const Controller* controller) const {
  VehicleState s;
  s.simulation = simulation_->snapshot();
  s.numbers = {settled_ ? 1.0 : 0.0, zero_time_,    travel_,     commanded_speed_, hitch_pull_,
               drive_work_,          gravity_work_, hitch_work_, spring_work_,     last_.heading};
  for (const WheelParts& w : wheels_) s.numbers.insert(s.numbers.end(), {w.command, w.target_angle, w.energy});
  if (controller != nullptr) s.controller = controller->state();
  return s;
}

void Vehicle::restore(const VehicleState& state, Controller* controller) {
  if (state.numbers.size() != 10 + 3 * wheels_.size())
    throw InputError(problem("snapshot", "is of another machine", "one of " + spec_.name));
  simulation_->restore(state.simulation);
  const double* s = state.numbers.data();
  settled_ = s[0] != 0.0;
  zero_time_ = s[1];
  travel_ = s[2];
  commanded_speed_ = s[3];
  hitch_pull_ = s[4];
  drive_work_ = s[5];
  gravity_work_ = s[6];
  hitch_work_ = s[7];
  spring_work_ = s[8];
  last_.heading = s[9];
  s += 10;
  for (WheelParts& w : wheels_) {
    w.command = s[0];
    w.target_angle = s[1];
    w.energy = s[2];
    s += 3;
  }
  if (controller != nullptr) controller->set_state(state.controller);
}

}  // namespace terrode::vehicle
