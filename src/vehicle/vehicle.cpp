// Building a machine from its description, its commands and its step. How it is run and recorded: vehicle_run.cpp.
#include "vehicle/vehicle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "vehicle/ramp.h"
#include "vehicle/vehicle_parts.h"
#include "wheel/convex.h"

namespace terrode::vehicle {

using multibody::AxisJoint;
using multibody::Body;
using multibody::Hinge;
using multibody::MassProperties;

namespace {

constexpr double torque_servo_speed = 1e4;  // rad/s no wheel reaches: a motor set to it gives its largest torque
constexpr int machine_group = 1;            // of collision shapes: parts of the machine do not feel each other

void set_spring(AxisJoint& joint, const SpringSpec& s) {
  joint.set_spring(s.stiffness, s.damping, s.stiffness > 0.0 ? s.preload / s.stiffness : 0.0);
}

double torque_per_amp(const DcMotorSpec& m) { return m.efficiency * m.gear * m.torque_constant; }

}  // namespace

// ---------------------------------------------------------------------------------------------------------- building

Vehicle::Vehicle(const VehicleSpec& spec, const VehicleOptions& options, std::unique_ptr<terrain::Terrain> ground)
    : spec_(spec), options_(options), ground_(std::move(ground)) {
  Problems p = spec.validate();
  const Problems more = options.validate();
  p.insert(p.end(), more.begin(), more.end());
  if (ground_ == nullptr) p.push_back(vehicle_problem("ground", "is missing", "a ground under the machine"));
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
  lift += ground_->roughness();
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
    if (w.steering && w.steering->joint.empty()) {
      Body& knuckle = world_->add_body(w.name + ".knuckle", small_box(w.steering->knuckle_mass), centre);
      parts.steering = &world_->add_hinge(w.name + ".steering", knuckle, parent, centre.p_W, Vec3::UnitZ());
      parts.steering->set_motor({0.0});
      joints_[parts.steering->name()] = parts.steering;
      parent = &knuckle;
    }
    MassProperties mass = MassProperties::cylinder(w.mass, w.shape.radius, w.shape.width);
    if (w.inertia) mass.inertia_B = *w.inertia;
    parts.body = &world_->add_body(w.name, mass, centre);
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
  for (std::size_t i = 0; i < wheels_.size(); ++i)
    if (spec_.wheels[i].steering && !spec_.wheels[i].steering->joint.empty()) {
      wheels_[i].steering = dynamic_cast<Hinge*>(joints_.at(spec_.wheels[i].steering->joint));
      wheels_[i].steering->set_motor({0.0});
    }
  for (const BodySpec& b : spec_.bodies)
    if (b.touches_ground) {
      bellies_.push_back(b.name);
      simulation_->add(*bodies_.at(b.name), b.pieces.empty() ? wheel::make_box(b.size.x(), b.size.y(), b.size.z())
                                                             : std::make_shared<const wheel::ConvexPieces>(b.pieces));
    }
  for (const SensorSpec& s : spec_.sensors) {
    Sensor out;
    if (s.kind == SensorKind::imu) {
      out.body = bodies_.at(s.body);
      const auto at = std::find_if(spec_.bodies.begin(), spec_.bodies.end(),
                                   [&](const BodySpec& b) { return b.name == s.body; });
      if (at != spec_.bodies.end()) {
        out.arm = s.position - at->position;
      } else {
        const auto wheel_at = std::find_if(spec_.wheels.begin(), spec_.wheels.end(),
                                           [&](const VehicleWheelSpec& w) { return w.name == s.body; });
        out.arm = s.position - wheel_at->centre;
      }
    } else {
      out.joint = joints_.at(s.joint);
      out.axis = dynamic_cast<AxisJoint*>(out.joint);
    }
    sensors_.push_back(out);
  }
  place_rocks();
  velocity_before_.resize(world_->bodies().size());
  rate_before_.resize(sprung_.size());
  last_.wheels.resize(wheels_.size());
  last_.pose = chassis_->pose();
  last_.heading = options_.start_heading;
}

void Vehicle::place_rocks() {
  if (options_.rocks.empty()) return;
  multibody::Collisions& collisions = world_->collisions();
  collisions.set_law(options_.rock_contact);
  for (const BodySpec& b : spec_.bodies)
    collisions.add(bodies_.at(b.name), {multibody::ShapeKind::box, 0.0, 0.0, b.size}, {}, machine_group);
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const wheel::WheelShape& w = spec_.wheels[i].shape;
    collisions.add(wheels_[i].body, {multibody::ShapeKind::cylinder, w.radius + w.grousers.height, w.width, {}}, {},
                   machine_group);
  }
  Problems p;
  for (const RockSpec& r : options_.rocks) {
    for (std::size_t i = 0; i < wheels_.size(); ++i) {
      const Vec3 at = wheels_[i].body->pose().p_W;
      if (r.distance(at.x(), at.y()) < wheels_[i].radius)
        p.push_back(vehicle_problem("rocks." + r.name, "lies under the wheel '" + spec_.wheels[i].name + "' at the start",
                                    "a place free of the machine"));
    }
    // The highest ground under a loose rock, so that it starts above all of it.
    double level = ground_->undisturbed_height(r.x, r.y);
    if (!r.fixed)
      for (int i = 0; i < 8; ++i) {
        const double a = 0.25 * M_PI * i, d = 0.7 * r.reach();
        level = std::max(level, ground_->undisturbed_height(r.x + d * std::cos(a), r.y + d * std::sin(a)));
      }
    const Pose pose{Vec3(r.x, r.y, level - r.buried + 0.5 * r.height()),
                    Quat(Eigen::AngleAxisd(r.heading, Vec3::UnitZ()))};
    const multibody::CollisionShape shape{r.shape, r.radius, 0.0, r.size};
    if (r.fixed) {
      collisions.add(nullptr, shape, pose, 0);
      continue;
    }
    if (bodies_.contains(r.name)) {
      p.push_back(vehicle_problem("rocks." + r.name + ".name", "is a body of the machine", "a name of its own"));
      continue;
    }
    const bool ball = r.shape == multibody::ShapeKind::sphere;
    Body& body = world_->add_body(
        r.name, ball ? MassProperties::sphere(r.mass(), r.radius) : MassProperties::box(r.mass(), r.size), pose);
    bodies_[r.name] = &body;
    collisions.add(&body, shape, {}, 0);
    simulation_->add(body, ball ? std::make_shared<const wheel::Sphere>(r.radius)
                                : wheel::make_box(r.size.x(), r.size.y(), r.size.z()));
  }
  throw_if_any(p);
}

Body& Vehicle::body(const std::string& name) {
  const auto it = bodies_.find(name);
  if (it == bodies_.end()) throw InputError(vehicle_problem("body", "'" + name + "' is not there", "a body of the machine"));
  return *it->second;
}

multibody::Joint& Vehicle::joint(const std::string& name) {
  const auto it = joints_.find(name);
  if (it == joints_.end()) throw InputError(vehicle_problem("joint", "'" + name + "' is not there", "a joint of the machine"));
  return *it->second;
}

double Vehicle::time() const { return settled_ ? world_->time() - zero_time_ : 0.0; }

// ---------------------------------------------------------------------------------------------------------- commands

void Vehicle::drive(std::size_t wheel, double command) {
  if (wheel >= wheels_.size() || !std::isfinite(command))
    throw InputError(
        vehicle_problem("drive", fmt::format("of wheel {} is {:.6g}", wheel, command), "a wheel and a finite command"));
  wheels_[wheel].command = command;
}

void Vehicle::steer(std::size_t wheel, double angle) {
  if (wheel >= wheels_.size() || !std::isfinite(angle))
    throw InputError(
        vehicle_problem("steer", fmt::format("of wheel {} is {:.6g}", wheel, angle), "a wheel and a finite angle"));
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
  commanded_yaw_ = 0.0;
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
  commanded_yaw_ = yaw_rate;
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
      throw Buried(fmt::format("wheel '{}' at t = {:.6g} s is buried to its axle (sinkage {:.4g} m, radius {:.4g} m)",
                               spec_.wheels[i].name, last_.time, s.sinkage, w.radius));
  }
  for (Sensor& s : sensors_) {
    if (s.joint != nullptr) {
      s.turn_before = s.joint->body().pose().R_WB;
      if (s.axis != nullptr) s.motion_before = Vec3(s.axis->position(), s.axis->rate(), 0.0);
      continue;
    }
    const Twist u = s.body->twist();
    s.turn_before = s.body->pose().R_WB;
    s.spin_before = u.w_W;
    s.motion_before = u.v_W + u.w_W.cross(s.turn_before * s.arm);
  }

  simulation_->step(h);

  for (std::size_t i = 0; i < wheels_.size(); ++i) sample(i);
  for (Sensor& s : sensors_) {
    const Quat to_body = s.turn_before.conjugate();
    if (s.joint != nullptr) {
      const Wrench& load = s.joint->load().on_body;
      s.force = to_body * load.F_W;
      s.moment = to_body * load.M_W;
      continue;
    }
    const Twist u = s.body->twist();
    const Vec3 v = u.v_W + u.w_W.cross(s.body->pose().R_WB * s.arm);
    s.force = to_body * Vec3((v - s.motion_before) / h - g);
    s.moment = to_body * s.spin_before;
  }
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
  const Vec3 F = simulation_->contacts()[i].wrench.F_W + w.body->contact_load().F_W;  // rocks are ground, too
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
  e.rocks = world_->collisions().work;
  return e;
}

}  // namespace terrode::vehicle
