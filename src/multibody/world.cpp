#include "multibody/world.h"

#include <fmt/format.h>
#include <ode/ode.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <mutex>

namespace terrode::multibody {

namespace {

// ODE aborts the process when a number overflows inside its solver; beyond this no quantity of a machine is meant.
constexpr double largest_number = 1e30;
// Metres, metres a second and radians a second that no machine reaches: one that does has flown off.
constexpr double farthest = 1e9, fastest = 1e9;
constexpr double saturation_share = 0.99;

struct MessageSink {
  std::size_t count = 0;
  char last[256] = "";
  const World* world = nullptr;
};
// ODE's self-threaded implementation solves on the calling thread, so its handlers run there too.
thread_local MessageSink sink;

void on_message(int, const char* format, va_list arguments) {
  ++sink.count;
  std::vsnprintf(sink.last, sizeof sink.last, format, arguments);
}

// ODE ends the process after this returns, and neither an exception nor longjmp may leave it: all that can be done is
// to say where it happened.
void on_fatal(int, const char* format, va_list arguments) {
  char text[256];
  std::vsnprintf(text, sizeof text, format, arguments);
  std::fprintf(stderr, "terrode: the rigid-body solver stops the program: %s", text);
  if (sink.world != nullptr)
    std::fprintf(stderr, " (at t = %.9g s, step %zu)", sink.world->time(), sink.world->steps());
  std::fputs("\n", stderr);
}

std::mutex& creation_mutex() {
  static std::mutex mutex;
  return mutex;
}

void initialise_once() {
  static_assert(sizeof(dReal) == 8, "ODE must be built in double precision");
  static const bool done = [] {
    if (dInitODE2(0) == 0) throw RunError("ODE could not be initialised");
    if (dCheckConfiguration("ODE_double_precision") != 1)
      throw RunError(std::string("ODE must be built in double precision; this one says: ") + dGetConfiguration());
    dSetMessageHandler(&on_message);
    dSetDebugHandler(&on_fatal);
    dSetErrorHandler(&on_fatal);
    return true;
  }();
  static_cast<void>(done);
}

Vec3 vec(const dReal* v) { return {v[0], v[1], v[2]}; }

bool within(const Vec3& v, double limit) { return v.allFinite() && v.cwiseAbs().maxCoeff() < limit; }

Vec3 unit_axis(const std::string& joint, const Vec3& axis) {
  const double length = axis.norm();
  if (!std::isfinite(length) || length < 1e-12)
    throw InputError(Problem{{}, 0, 0, joint + ".axis", "has no direction", "a finite vector other than zero"});
  return axis / length;
}

}  // namespace

// ------------------------------------------------------------------------------------------------ options and masses

Problems WorldOptions::validate() const {
  Problems p;
  if (!gravity.allFinite() || gravity.norm() > kStrongestGravity)
    p.push_back({{}, 0, 0, "world.gravity", gravity.allFinite() ? fmt::format("is {:.6g} m/s2", gravity.norm()) : "is not finite",
                 fmt::format("three finite numbers, together at most {:g} m/s2", kStrongestGravity)});
  require(p, "world.cfm", cfm, "s/kg", cfm >= 0.0 && cfm < 1e-3, "a number from 0 to 1e-3");
  require(p, "world.erp", erp, "-", erp >= 0.0 && erp <= 1.0, "a number from 0 to 1");
  return p;
}

MassProperties MassProperties::cylinder(double mass, double radius, double width) {
  MassProperties m{mass, Mat3::Zero()};
  const double across = mass * (3.0 * radius * radius + width * width) / 12.0;
  m.inertia_B.diagonal() = Vec3(across, 0.5 * mass * radius * radius, across);
  return m;
}

MassProperties MassProperties::box(double mass, const Vec3& size) {
  MassProperties m{mass, Mat3::Zero()};
  const Vec3 s = size.cwiseProduct(size);
  m.inertia_B.diagonal() = mass / 12.0 * Vec3(s.y() + s.z(), s.x() + s.z(), s.x() + s.y());
  return m;
}

MassProperties MassProperties::sphere(double mass, double radius) {
  return {mass, 0.4 * mass * radius * radius * Mat3::Identity()};
}

Problems MassProperties::validate(const std::string& key) const {
  Problems p;
  require(p, key + ".mass", mass, "kg", mass >= kLightest && mass < largest_number, fmt::format("a mass of {:g} kg or more", kLightest));
  const double scale = inertia_B.cwiseAbs().maxCoeff();
  if (!inertia_B.allFinite() || !(scale > 0.0) || scale >= largest_number) {
    p.push_back({{}, 0, 0, key + ".inertia", "is not finite or zero", "moments of inertia above 0"});
    return p;
  }
  if ((inertia_B - inertia_B.transpose()).cwiseAbs().maxCoeff() > 1e-9 * scale)
    p.push_back({{}, 0, 0, key + ".inertia", "is not symmetric", "a symmetric matrix"});
  const Vec3 i = Eigen::SelfAdjointEigenSolver<Mat3>(inertia_B).eigenvalues();  // ascending
  if (!(i.x() > 0.0))
    p.push_back({{},
                 0,
                 0,
                 key + ".inertia",
                 fmt::format("has the principal moment {:.6g} kg m2", i.x()),
                 "principal moments above 0"});
  if (i.x() + i.y() < i.z() * (1.0 - 1e-9))
    p.push_back({{},
                 0,
                 0,
                 key + ".inertia",
                 fmt::format("has principal moments {:.6g}, {:.6g}, {:.6g} kg m2", i.x(), i.y(), i.z()),
                 "two moments whose sum is at least the third, as of any real body"});
  return p;
}

// ------------------------------------------------------------------------------------------------------------ bodies

Body::Body(World& world, std::string name, const MassProperties& mass)
    : world_(world), name_(std::move(name)), mass_(mass), id_(dBodyCreate(world.id_)) {
  dMass m;
  const Mat3& i = mass.inertia_B;
  dMassSetParameters(&m, mass.mass, 0, 0, 0, i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2));
  dBodySetMass(id_, &m);
  // Exact rotation for a constant angular velocity; the default lets a wheel lag by (omega h)^2/12.
  dBodySetFiniteRotationMode(id_, 1);
}

Body::~Body() { dBodyDestroy(id_); }

Pose Body::pose() const {
  const dReal* q = dBodyGetQuaternion(id_);
  return {vec(dBodyGetPosition(id_)), Quat(q[0], q[1], q[2], q[3])};
}

Twist Body::twist() const { return {vec(dBodyGetLinearVel(id_)), vec(dBodyGetAngularVel(id_))}; }

void Body::set_pose(const Pose& pose) {
  const double norm = pose.R_WB.norm();
  if (!within(pose.p_W, largest_number) || !std::isfinite(norm) || norm < 1e-12)
    throw InputError(Problem{{}, 0, 0, name_ + ".pose", "is not finite", "a finite position and orientation"});
  dBodySetPosition(id_, pose.p_W.x(), pose.p_W.y(), pose.p_W.z());
  const dQuaternion q = {pose.R_WB.w(), pose.R_WB.x(), pose.R_WB.y(), pose.R_WB.z()};
  dBodySetQuaternion(id_, q);
}

void Body::set_twist(const Twist& twist) {
  if (!within(twist.v_W, largest_number) || !within(twist.w_W, largest_number))
    throw InputError(Problem{{}, 0, 0, name_ + ".twist", "is not finite", "finite velocities"});
  dBodySetLinearVel(id_, twist.v_W.x(), twist.v_W.y(), twist.v_W.z());
  dBodySetAngularVel(id_, twist.w_W.x(), twist.w_W.y(), twist.w_W.z());
}

void Body::add_wrench(const Wrench& wrench) {
  dBodyAddForce(id_, wrench.F_W.x(), wrench.F_W.y(), wrench.F_W.z());
  dBodyAddTorque(id_, wrench.M_W.x(), wrench.M_W.y(), wrench.M_W.z());
}

void Body::add_force_at(const Vec3& F_W, const Vec3& p_W) {
  dBodyAddForceAtPos(id_, F_W.x(), F_W.y(), F_W.z(), p_W.x(), p_W.y(), p_W.z());
}

void Body::set_kinematic(bool kinematic) {
  if (kinematic)
    dBodySetKinematic(id_);
  else
    dBodySetDynamic(id_);
  kinematic_ = kinematic;
}

double Body::kinetic_energy() const {
  if (kinematic_) return 0.0;
  const Vec3 v = vec(dBodyGetLinearVel(id_));
  const Vec3 w_B = pose().R_WB.conjugate() * vec(dBodyGetAngularVel(id_));
  return 0.5 * mass_.mass * v.squaredNorm() + 0.5 * w_B.dot(mass_.inertia_B * w_B);
}

// ------------------------------------------------------------------------------------------------------------ joints

struct Joint::Feedback {
  dJointFeedback ode;
};

Joint::Joint(World& world, std::string name, Body& body, Body* parent)
    : world_(world), name_(std::move(name)), body_(body), parent_(parent), feedback_(std::make_unique<Feedback>()) {
  std::memset(&feedback_->ode, 0, sizeof feedback_->ode);
}

void Joint::adopt(dxJoint* id) {
  id_ = id;
  dJointAttach(id_, body_.id_, parent_ != nullptr ? parent_->id_ : nullptr);
  dJointSetFeedback(id_, &feedback_->ode);
}

Joint::~Joint() {
  if (id_ != nullptr) dJointDestroy(id_);
}

void Joint::prepare(double) {
  // ODE leaves the feedback of a joint without rows as it was: a number that stays NaN says that nothing was solved.
  feedback_->ode.f1[0] = std::numeric_limits<double>::quiet_NaN();
}

void Joint::read() {
  const dJointFeedback& f = feedback_->ode;
  load_.solved = !std::isnan(f.f1[0]);
  load_.on_body = load_.solved ? Wrench{vec(f.f1), vec(f.t1)} : Wrench{};
}

void Joint::check(double) const {}
void Joint::save(std::vector<double>&) const {}
void Joint::load_state(const double*&) {}

// -------------------------------------------------------------------------------------------------------- axis joints

void AxisJoint::set_motor(const Motor& motor) {
  if (has_spring_) throw InputError(Problem{{}, 0, 0, name_, "has a spring", "a joint without spring for a motor"});
  Problems p;
  require(p, name_ + ".motor.velocity", motor.velocity, "m/s or rad/s", std::abs(motor.velocity) < largest_number,
          "a finite velocity");
  if (!(motor.max_effort >= 0.0))
    p.push_back({{}, 0, 0, name_ + ".motor.max_effort", fmt::format("is {:.6g}", motor.max_effort), "0 or more"});
  require(p, name_ + ".motor.droop", motor.droop, "rad/s per N m", motor.droop >= 0.0, "0 or more");
  throw_if_any(p);
  has_motor_ = true;
  motor_ = motor;
  applied_h_ = -1.0;
}

void AxisJoint::clear_motor() {
  has_motor_ = false;
  applied_h_ = -1.0;
}

void AxisJoint::set_spring(double stiffness, double damping, double rest) {
  if (has_motor_) throw InputError(Problem{{}, 0, 0, name_, "has a motor", "a joint without motor for a spring"});
  Problems p;
  require(p, name_ + ".spring.stiffness", stiffness, "N/m or N m/rad", stiffness >= 0.0, "0 or more");
  require(p, name_ + ".spring.damping", damping, "N s/m or N m s/rad", damping >= 0.0, "0 or more");
  require(p, name_ + ".spring.rest", rest, "m or rad", true, "a finite position");
  if (p.empty() && !(stiffness + damping > 0.0))
    p.push_back({{}, 0, 0, name_ + ".spring", "has neither stiffness nor damping", "one of them above 0"});
  throw_if_any(p);
  has_spring_ = true;
  stiffness_ = stiffness;
  damping_ = damping;
  rest_ = rest;
  applied_h_ = -1.0;
}

void AxisJoint::clear_spring() {
  has_spring_ = false;
  applied_h_ = -1.0;
}

void AxisJoint::apply_drive(double h) {
  if (applied_h_ == h) return;
  applied_h_ = h;
  set_param(dParamVel, has_motor_ ? motor_.velocity : 0.0);
  set_param(dParamFMax, has_motor_ ? motor_.max_effort : 0.0);
  set_param(dParamCFM, has_motor_ && motor_.droop > 0.0 ? motor_.droop : world_.options().cfm);
  if (has_spring_) {
    // A stop that is reached from both sides is ODE's implicit spring: f = -(k x + (h k + c) v) with these two.
    const double d = h * stiffness_ + damping_;
    set_param(dParamStopERP, h * stiffness_ / d);
    set_param(dParamStopCFM, 1.0 / d);
    set_param(dParamLoStop, rest_);
    set_param(dParamHiStop, rest_);
  } else {
    set_param(dParamLoStop, -dInfinity);
    set_param(dParamHiStop, dInfinity);
  }
}

void AxisJoint::prepare(double h) {
  Joint::prepare(h);
  apply_drive(h);
  axis_before_ = axis();
}

void AxisJoint::read() {
  Joint::read();
  effort_ = (has_motor_ || has_spring_) ? project(load_.on_body) : 0.0;
}

bool AxisJoint::saturated() const {
  return has_motor_ && std::abs(effort_) >= saturation_share * motor_.max_effort && motor_.max_effort > 0.0;
}

void AxisJoint::check(double time) const {
  if (motor_.may_saturate || !saturated()) return;
  throw RunError(
      fmt::format("joint '{}' at t = {:.9g} s: the motor needs {:.6g} of at most {:.6g} (N or N m) and no "
                  "longer imposes its motion; raise max_effort, or allow saturation",
                  name_, time, effort_, motor_.max_effort));
}

void AxisJoint::save(std::vector<double>& s) const {
  s.insert(s.end(), {has_motor_ ? 1.0 : 0.0, motor_.velocity, motor_.max_effort, motor_.may_saturate ? 1.0 : 0.0,
                     motor_.droop, has_spring_ ? 1.0 : 0.0, stiffness_, damping_, rest_});
}

void AxisJoint::load_state(const double*& s) {
  for (const int i : {1, 4, 6, 7, 8})
    if (!(std::abs(s[i]) < largest_number) || !(s[2] >= 0.0))
      throw InputError(Problem{{}, 0, 0, name_, "has a motor or spring that is none in the state to go on from", "numbers"});
  has_motor_ = s[0] != 0.0;
  motor_ = {s[1], s[2], s[3] != 0.0, s[4]};
  has_spring_ = s[5] != 0.0;
  stiffness_ = s[6];
  damping_ = s[7];
  rest_ = s[8];
  applied_h_ = -1.0;
  s += 9;
}

// ------------------------------------------------------------------------------------------------------------- slider

Slider::Slider(World& world, std::string name, Body& body, Body* parent, const Vec3& axis_W)
    : AxisJoint(world, std::move(name), body, parent) {
  const Vec3 a = unit_axis(name_, axis_W);
  adopt(dJointCreateSlider(world.id_, nullptr));
  dJointSetSliderAxis(id_, a.x(), a.y(), a.z());
}

double Slider::position() const { return dJointGetSliderPosition(id_); }
double Slider::rate() const { return dJointGetSliderPositionRate(id_); }

Vec3 Slider::axis() const {
  dVector3 a;
  dJointGetSliderAxis(id_, a);
  return vec(a);
}

void Slider::prepare(double h) { AxisJoint::prepare(h); }
void Slider::set_param(int parameter, double value) { dJointSetSliderParam(id_, parameter, value); }
double Slider::project(const Wrench& load) const { return load.F_W.dot(axis_before_); }

// -------------------------------------------------------------------------------------------------------------- hinge

Hinge::Hinge(World& world, std::string name, Body& body, Body* parent, const Vec3& anchor_W, const Vec3& axis_W)
    : AxisJoint(world, std::move(name), body, parent) {
  const Vec3 a = unit_axis(name_, axis_W);
  adopt(dJointCreateHinge(world.id_, nullptr));
  dJointSetHingeAnchor(id_, anchor_W.x(), anchor_W.y(), anchor_W.z());
  dJointSetHingeAxis(id_, a.x(), a.y(), a.z());
}

double Hinge::position() const { return dJointGetHingeAngle(id_); }
double Hinge::rate() const { return dJointGetHingeAngleRate(id_); }

Vec3 Hinge::axis() const {
  dVector3 a;
  dJointGetHingeAxis(id_, a);
  return vec(a);
}

Vec3 Hinge::anchor() const {
  dVector3 a;
  dJointGetHingeAnchor(id_, a);
  return vec(a);
}

void Hinge::prepare(double h) {
  AxisJoint::prepare(h);
  arm_before_ = anchor() - body_.pose().p_W;
}

void Hinge::read() {
  AxisJoint::read();
  const double angle = position();
  turned_ += std::remainder(angle - last_angle_, 2.0 * M_PI);
  last_angle_ = angle;
}

void Hinge::save(std::vector<double>& s) const {
  AxisJoint::save(s);
  s.insert(s.end(), {turned_, last_angle_});
}

void Hinge::load_state(const double*& s) {
  AxisJoint::load_state(s);
  turned_ = s[0];
  last_angle_ = s[1];
  s += 2;
}

void Hinge::set_param(int parameter, double value) { dJointSetHingeParam(id_, parameter, value); }

double Hinge::project(const Wrench& load) const { return (load.M_W - arm_before_.cross(load.F_W)).dot(axis_before_); }

// ------------------------------------------------------------------------------------------------------- other joints

Fixed::Fixed(World& world, std::string name, Body& body, Body* parent) : Joint(world, std::move(name), body, parent) {
  adopt(dJointCreateFixed(world.id_, nullptr));
  dJointSetFixed(id_);
}

Ball::Ball(World& world, std::string name, Body& body, Body* parent, const Vec3& anchor)
    : Joint(world, std::move(name), body, parent) {
  adopt(dJointCreateBall(world.id_, nullptr));
  dJointSetBallAnchor(id_, anchor.x(), anchor.y(), anchor.z());
}

Rod::Rod(World& world, std::string name, Body& body, Body* parent, const Vec3& a, const Vec3& b)
    : Joint(world, std::move(name), body, parent) {
  if (!((a - b).norm() > 1e-9)) throw InputError(Problem{{}, 0, 0, name_, "has length zero", "two distinct points"});
  adopt(dJointCreateDBall(world.id_, nullptr));
  dJointSetDBallAnchor1(id_, a.x(), a.y(), a.z());
  dJointSetDBallAnchor2(id_, b.x(), b.y(), b.z());
}

namespace {
void check_axes(const std::string& name, const std::vector<Vec3>& axes) {
  if (axes.empty() || axes.size() > 3)
    throw InputError(Problem{{}, 0, 0, name + ".axes", fmt::format("has {} entries", axes.size()), "1 to 3 axes"});
}
void set_linear_axes(dJointID id, const std::string& name, const std::vector<Vec3>& axes) {
  dJointSetLMotorNumAxes(id, static_cast<int>(axes.size()));
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const Vec3 a = unit_axis(name, axes[i]);
    dJointSetLMotorAxis(id, static_cast<int>(i), 0, a.x(), a.y(), a.z());
  }
}
constexpr int group(std::size_t axis) { return static_cast<int>(axis) * dParamGroup; }
}  // namespace

LinearMotor::LinearMotor(World& world, std::string name, Body& body, const std::vector<Vec3>& axes)
    : Joint(world, std::move(name), body, nullptr), count_(axes.size()) {
  check_axes(name_, axes);
  adopt(dJointCreateLMotor(world.id_, nullptr));
  set_linear_axes(id_, name_, axes);
  for (std::size_t i = 0; i < count_; ++i) dJointSetLMotorParam(id_, dParamFMax + group(i), dInfinity);
}

void LinearMotor::set_velocity(std::size_t axis, double velocity) {
  if (axis >= count_ || !std::isfinite(velocity))
    throw InputError(Problem{{}, 0, 0, name_ + ".velocity", "is not finite or has no such axis", "a finite velocity"});
  dJointSetLMotorParam(id_, dParamVel + group(axis), velocity);
}

AngularMotor::AngularMotor(World& world, std::string name, Body& body, const std::vector<Vec3>& axes)
    : Joint(world, std::move(name), body, nullptr), count_(axes.size()) {
  check_axes(name_, axes);
  adopt(dJointCreateAMotor(world.id_, nullptr));
  dJointSetAMotorMode(id_, dAMotorUser);
  dJointSetAMotorNumAxes(id_, static_cast<int>(count_));
  for (std::size_t i = 0; i < count_; ++i) {
    const Vec3 a = unit_axis(name_, axes[i]);
    dJointSetAMotorAxis(id_, static_cast<int>(i), 0, a.x(), a.y(), a.z());
    dJointSetAMotorParam(id_, dParamFMax + group(i), dInfinity);
  }
}

void AngularMotor::set_velocity(std::size_t axis, double velocity) {
  if (axis >= count_ || !std::isfinite(velocity))
    throw InputError(Problem{{}, 0, 0, name_ + ".velocity", "is not finite or has no such axis", "a finite velocity"});
  dJointSetAMotorParam(id_, dParamVel + group(axis), velocity);
}

// Three massless rods to points 1 m away resist one direction each; their error repair is off, so that they are
// dampers.
struct SoilDamper::Rows {
  dJointID rod[3];
  dJointFeedback rod_feedback[3];
  bool rod_on[3] = {false, false, false};
  dJointID spin;
  dJointFeedback spin_feedback;
  bool spin_on = false;
};

SoilDamper::SoilDamper(World& world, std::string name, Body& body)
    : Joint(world, std::move(name), body, nullptr), rows_(std::make_unique<Rows>()) {
  for (int i = 0; i < 3; ++i) {
    rows_->rod[i] = dJointCreateDBall(world.id_, nullptr);
    dJointAttach(rows_->rod[i], body_.id_, nullptr);
    dJointSetFeedback(rows_->rod[i], &rows_->rod_feedback[i]);
    dJointSetDBallParam(rows_->rod[i], dParamERP, 0.0);
    dJointDisable(rows_->rod[i]);
  }
  rows_->spin = dJointCreateAMotor(world.id_, nullptr);
  dJointAttach(rows_->spin, body_.id_, nullptr);
  dJointSetFeedback(rows_->spin, &rows_->spin_feedback);
  dJointSetAMotorMode(rows_->spin, dAMotorUser);
  dJointSetAMotorNumAxes(rows_->spin, 3);
  dJointDisable(rows_->spin);
}

SoilDamper::~SoilDamper() {
  for (dJointID rod : rows_->rod) dJointDestroy(rod);
  dJointDestroy(rows_->spin);
}

namespace {
// Eigenvalues far below the largest give forces below its rounding.
constexpr double negligible = 1e-12;

using SymmetricEigen = Eigen::SelfAdjointEigenSolver<Mat3>;
}  // namespace

void SoilDamper::set(const Vec3& p, const Mat3& D, const Mat3& R) {
  if (!p.allFinite() || !D.allFinite() || !R.allFinite() || D.cwiseAbs().maxCoeff() >= largest_number ||
      R.cwiseAbs().maxCoeff() >= largest_number)
    throw RunError(
        fmt::format("'{}' on body '{}' at t = {:.9g} s: the ground's contact stiffness or damping is not "
                    "finite; check the soil's parameters",
                    name_, body_.name(), world_.time()));
  const SymmetricEigen d(0.5 * (D + D.transpose()));
  D_.setZero();
  for (int i = 0; i < 3; ++i) {
    const double c = d.eigenvalues()[i];
    const bool on = c > 0.0 && c > negligible * d.eigenvalues()[2];
    if (on != rows_->rod_on[i]) (on ? dJointEnable : dJointDisable)(rows_->rod[i]);
    rows_->rod_on[i] = on;
    if (!on) continue;
    const Vec3 e = d.eigenvectors().col(i);
    const Vec3 far = p + e;
    dJointSetDBallAnchor1(rows_->rod[i], p.x(), p.y(), p.z());
    dJointSetDBallAnchor2(rows_->rod[i], far.x(), far.y(), far.z());
    dJointSetDBallParam(rows_->rod[i], dParamCFM, 1.0 / c);
    D_ += c * e * e.transpose();
  }
  const SymmetricEigen r(0.5 * (R + R.transpose()));
  R_.setZero();
  bool any = false;
  for (int i = 0; i < 3; ++i) {
    const double c = r.eigenvalues()[i];
    const bool on = c > 0.0 && c > negligible * r.eigenvalues()[2];
    dJointSetAMotorParam(rows_->spin, dParamFMax + group(static_cast<std::size_t>(i)), on ? dInfinity : 0.0);
    if (!on) continue;
    any = true;
    const Vec3 e = r.eigenvectors().col(i);
    dJointSetAMotorAxis(rows_->spin, i, 0, e.x(), e.y(), e.z());
    dJointSetAMotorParam(rows_->spin, dParamCFM + group(static_cast<std::size_t>(i)), 1.0 / c);
    R_ += c * e * e.transpose();
  }
  if (any != rows_->spin_on) (any ? dJointEnable : dJointDisable)(rows_->spin);
  rows_->spin_on = any;
}

void SoilDamper::prepare(double) {
  for (dJointFeedback& f : rows_->rod_feedback) f.f1[0] = std::numeric_limits<double>::quiet_NaN();
  rows_->spin_feedback.f1[0] = std::numeric_limits<double>::quiet_NaN();
}

void SoilDamper::read() {
  load_ = {};
  const auto take = [this](const dJointFeedback& f) {
    if (std::isnan(f.f1[0])) return;
    load_.solved = true;
    load_.on_body += Wrench{vec(f.f1), vec(f.t1)};
  };
  for (const dJointFeedback& f : rows_->rod_feedback) take(f);
  take(rows_->spin_feedback);
}

// -------------------------------------------------------------------------------------------------------------- world

World::World(const WorldOptions& options) : options_(options) {
  throw_if_any(options.validate());
  const std::lock_guard<std::mutex> lock(creation_mutex());
  initialise_once();
  id_ = dWorldCreate();
  // Before any joint exists: a joint's motor copies the world's CFM when it is made.
  dWorldSetCFM(id_, options.cfm);
  dWorldSetERP(id_, options.erp);
  dWorldSetGravity(id_, options.gravity.x(), options.gravity.y(), options.gravity.z());
  dWorldSetAutoDisableFlag(id_, 0);
  threading_ = dThreadingAllocateSelfThreadedImplementation();
  dWorldSetStepThreadingImplementation(id_, dThreadingImplementationGetFunctions(threading_), threading_);
}

World::~World() {
  const std::lock_guard<std::mutex> lock(creation_mutex());
  joints_.clear();
  bodies_.clear();
  dWorldDestroy(id_);
  dThreadingFreeImplementation(threading_);
}

Body& World::add_body(const std::string& name, const MassProperties& mass, const Pose& pose, const Twist& twist) {
  Problems p = mass.validate(name);
  if (name.empty()) p.push_back({{}, 0, 0, "body.name", "is empty", "a name"});
  for (const auto& b : bodies_)
    if (b->name() == name) p.push_back({{}, 0, 0, "body.name", "'" + name + "' is taken", "a name of its own"});
  throw_if_any(p);
  std::unique_ptr<Body> body(new Body(*this, name, mass));
  body->set_pose(pose);
  body->set_twist(twist);
  bodies_.push_back(std::move(body));
  return *bodies_.back();
}

void World::check_joint(const std::string& name, const Body& body, const Body* parent) const {
  Problems p;
  if (name.empty()) p.push_back({{}, 0, 0, "joint.name", "is empty", "a name"});
  for (const auto& j : joints_)
    if (j->name() == name) p.push_back({{}, 0, 0, "joint.name", "'" + name + "' is taken", "a name of its own"});
  if (&body.world_ != this || (parent != nullptr && &parent->world_ != this))
    p.push_back({{}, 0, 0, name, "joins a body of another world", "bodies of this world"});
  if (&body == parent) p.push_back({{}, 0, 0, name, "joins a body to itself", "two bodies"});
  throw_if_any(p);
}

template <class J>
J& World::keep(std::unique_ptr<J> joint) {
  J& reference = *joint;
  joints_.push_back(std::move(joint));
  return reference;
}

Slider& World::add_slider(const std::string& name, Body& body, Body* parent, const Vec3& axis) {
  check_joint(name, body, parent);
  return keep(std::unique_ptr<Slider>(new Slider(*this, name, body, parent, axis)));
}
Hinge& World::add_hinge(const std::string& name, Body& body, Body* parent, const Vec3& anchor, const Vec3& axis) {
  check_joint(name, body, parent);
  return keep(std::unique_ptr<Hinge>(new Hinge(*this, name, body, parent, anchor, axis)));
}
Fixed& World::add_fixed(const std::string& name, Body& body, Body* parent) {
  check_joint(name, body, parent);
  return keep(std::unique_ptr<Fixed>(new Fixed(*this, name, body, parent)));
}
Ball& World::add_ball(const std::string& name, Body& body, Body* parent, const Vec3& anchor) {
  check_joint(name, body, parent);
  return keep(std::unique_ptr<Ball>(new Ball(*this, name, body, parent, anchor)));
}
Rod& World::add_rod(const std::string& name, Body& body, Body* parent, const Vec3& a, const Vec3& b) {
  check_joint(name, body, parent);
  return keep(std::unique_ptr<Rod>(new Rod(*this, name, body, parent, a, b)));
}
LinearMotor& World::add_linear_motor(const std::string& name, Body& body, const std::vector<Vec3>& axes) {
  check_joint(name, body, nullptr);
  return keep(std::unique_ptr<LinearMotor>(new LinearMotor(*this, name, body, axes)));
}
AngularMotor& World::add_angular_motor(const std::string& name, Body& body, const std::vector<Vec3>& axes) {
  check_joint(name, body, nullptr);
  return keep(std::unique_ptr<AngularMotor>(new AngularMotor(*this, name, body, axes)));
}
SoilDamper& World::add_soil_damper(const std::string& name, Body& body) {
  check_joint(name, body, nullptr);
  return keep(std::unique_ptr<SoilDamper>(new SoilDamper(*this, name, body)));
}

void World::set_gravity(const Vec3& gravity) {
  WorldOptions next = options_;
  next.gravity = gravity;
  throw_if_any(next.validate());
  options_ = next;
  dWorldSetGravity(id_, gravity.x(), gravity.y(), gravity.z());
}

void World::check_finite() const {
  for (const auto& b : bodies_) {
    const Twist t = b->twist();
    const char* what = nullptr;
    if (!within(vec(dBodyGetPosition(b->id_)), farthest))
      what = "position is not finite or beyond 1e9 m";
    else if (!within(t.v_W, fastest))
      what = "velocity is not finite or beyond 1e9 m/s";
    else if (!within(t.w_W, fastest))
      what = "angular velocity is not finite or beyond 1e9 rad/s";
    else if (!within(vec(dBodyGetForce(b->id_)), largest_number))
      what = "external force is not finite or beyond 1e30 N";
    else if (!within(vec(dBodyGetTorque(b->id_)), largest_number))
      what = "external moment is not finite or beyond 1e30 N m";
    if (what != nullptr)
      throw RunError(
          fmt::format("body '{}' at t = {:.9g} s (step {}): its {}; "
                      "the run has diverged or a force law returned a wrong number: try a smaller time "
                      "step, then check the soil's parameters",
                      b->name(), time_, steps_, what));
  }
}

void World::step(double h) {
  if (!(h >= kShortestStep) || !std::isfinite(h))
    throw InputError(Problem{{}, 0, 0, "time_step", fmt::format("is {:.6g} s", h), fmt::format("a finite time, at least {:g} s", kShortestStep)});
  check_finite();
  for (const auto& j : joints_) j->prepare(h);
  collisions_.begin_step(h);
  sink.count = 0;
  sink.world = this;
  const int solved = dWorldStep(id_, h);
  sink.world = nullptr;
  messages_ += sink.count;
  if (solved == 0)
    throw RunError(fmt::format("the step at t = {:.9g} s failed: no memory for the rigid-body solver", time_));
  if (sink.count > 0)
    throw RunError(
        fmt::format("the rigid-body solver at t = {:.9g} s (step {}) says: '{}'; likely two joints hold the "
                    "same motion, or a force is far out of proportion",
                    time_, steps_, sink.last));
  for (const auto& j : joints_) j->read();
  collisions_.end_step(h);
  const double before = time_;
  // Compensated sum: t is n h to rounding after any number of steps.
  const double y = h - time_carry_;
  const double t = time_ + y;
  time_carry_ = (t - time_) - y;
  time_ = t;
  ++steps_;
  for (const auto& j : joints_) j->check(before);
}

double World::mechanical_energy() const {
  double e = 0.0;
  for (const auto& b : bodies_)
    if (!b->kinematic_) e += b->kinetic_energy() - b->mass() * options_.gravity.dot(vec(dBodyGetPosition(b->id_)));
  return e;
}

std::vector<double> World::snapshot() const {
  std::vector<double> s = {time_,
                           time_carry_,
                           static_cast<double>(steps_),
                           options_.gravity.x(),
                           options_.gravity.y(),
                           options_.gravity.z(),
                           collisions_.work};
  for (const auto& b : bodies_) {
    const dReal* p = dBodyGetPosition(b->id_);
    const dReal* q = dBodyGetQuaternion(b->id_);
    const dReal* r = dBodyGetRotation(b->id_);
    const dReal* v = dBodyGetLinearVel(b->id_);
    const dReal* w = dBodyGetAngularVel(b->id_);
    s.insert(s.end(), p, p + 3);
    s.insert(s.end(), q, q + 4);
    s.insert(s.end(), r, r + 12);
    s.insert(s.end(), v, v + 3);
    s.insert(s.end(), w, w + 3);
  }
  for (const auto& j : joints_) j->save(s);
  return s;
}

void World::restore(const std::vector<double>& state) {
  if (state.size() != snapshot().size())
    throw InputError(Problem{{},
                             0,
                             0,
                             "snapshot",
                             fmt::format("has {} numbers", state.size()),
                             fmt::format("{}, as a world of these bodies and joints has", snapshot().size())});
  const double* s = state.data();
  const auto need = [](bool good, const char* what, const char* expected) {
    if (!good) throw InputError(Problem{{}, 0, 0, "snapshot", fmt::format("has {}", what), expected});
  };
  const std::size_t bodies_end = 7 + 25 * bodies_.size();
  need(std::all_of(s, s + bodies_end, [](double x) { return std::abs(x) < largest_number; }), "a number that is not finite or beyond any", "numbers");
  need(s[2] >= 0.0 && s[2] < 1e15, "a wrong number of steps", "0 or more");
  time_ = s[0];
  time_carry_ = s[1];
  steps_ = static_cast<std::size_t>(s[2]);
  set_gravity({s[3], s[4], s[5]});
  collisions_.work = s[6];
  s += 7;
  for (const auto& b : bodies_) {
    dBodySetPosition(b->id_, s[0], s[1], s[2]);
    const dQuaternion q = {s[3], s[4], s[5], s[6]};
    need(std::abs(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])) - 1.0) < 1e-6, "an orientation that is none", "a unit quaternion");
    dBodySetQuaternion(b->id_, q);
    const dReal* turned = dBodyGetRotation(b->id_);
    for (int i = 0; i < 12; ++i)
      if (i % 4 != 3) need(std::abs(turned[i] - s[7 + i]) < 1e-6, "an orientation that is none", "the quaternion's matrix");
    // ODE normalises what it is given, which changes the last bit; the state must return to the bit.
    std::memcpy(const_cast<dReal*>(dBodyGetQuaternion(b->id_)), s + 3, 4 * sizeof(dReal));
    std::memcpy(const_cast<dReal*>(dBodyGetRotation(b->id_)), s + 7, 12 * sizeof(dReal));
    dBodySetLinearVel(b->id_, s[19], s[20], s[21]);
    dBodySetAngularVel(b->id_, s[22], s[23], s[24]);
    s += 25;
  }
  for (const auto& j : joints_) j->load_state(s);
}

}  // namespace terrode::multibody
