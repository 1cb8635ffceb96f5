// Rigid bodies, joints and the forces the joints carry, solved by ODE (dWorldStep: one linear complementarity problem
// for all constraints, accurate to rounding). This room alone sees ODE's headers.
//
// Forces from joints. A joint's load is the constraint multiplier: the MEAN over [t_n, t_n + h] of what the joint
// exerts on its body, for external forces evaluated at the pose before the step. Whoever logs it pairs it with t_n and
// that pose. Where the body's velocity changes in the step, the external load on everything that hangs on the joint is
// m (v1 - v0)/h - load (see Rig).
//
// A World belongs to one thread at a time; different worlds may be stepped by different threads at once (each has a
// threading implementation of its own, since ODE's shared one crashes then).
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/frames.h"
#include "core/problem.h"
#include "multibody/collisions.h"

struct dxBody;
struct dxJoint;
struct dxWorld;
struct dxThreadingImplementation;

namespace terrode::multibody {

class World;

// Of a step [s]: ODE divides by it, and ends the process where the quotient is not finite.
inline constexpr double kShortestStep = 1e-9;
// Of a body [kg]: likewise.
inline constexpr double kLightest = 1e-9;
// Ten thousand times the earth's [m/s2], beyond any centrifuge: under more the solver overflows within a few steps.
inline constexpr double kStrongestGravity = 1e5;

struct WorldOptions {
  Vec3 gravity{0.0, 0.0, -9.81};  // m/s2
  // Constraint force mixing [s/kg, s/(kg m2)]: the velocity a constraint gives way per newton. 1e-14 keeps multipliers
  // to some 1e-9 and still lets redundant constraints share their load; 0 is exact and aborts on redundant ones.
  double cfm = 1e-14;
  double erp = 0.2;  // share of a joint's position error repaired in a step, 0..1
  Problems validate() const;
};

// Mass [kg] and moments of inertia about the centre of mass in body axes [kg m2].
struct MassProperties {
  double mass = 0.0;
  Mat3 inertia_B = Mat3::Zero();

  // Full cylinder about the y axis (a wheel): I_yy = m r^2/2, I_xx = I_zz = m (3 r^2 + b^2)/12.
  static MassProperties cylinder(double mass, double radius, double width);
  // Box with the given edge lengths [m].
  static MassProperties box(double mass, const Vec3& size);
  static MassProperties sphere(double mass, double radius);
  // Positive mass, symmetric positive definite inertia that fulfils the triangle inequality of a real body.
  Problems validate(const std::string& key) const;
};

// A rigid body. Its origin is its centre of mass.
class Body {
 public:
  ~Body();
  Body(const Body&) = delete;
  Body& operator=(const Body&) = delete;

  const std::string& name() const { return name_; }
  const MassProperties& mass_properties() const { return mass_; }
  double mass() const { return mass_.mass; }

  Pose pose() const;
  Twist twist() const;
  void set_pose(const Pose& pose);
  void set_twist(const Twist& twist);

  // External load of the coming step; sums up, and is zero again after it. Moment about the centre of mass.
  void add_wrench(const Wrench& wrench);
  void add_force_at(const Vec3& F_W, const Vec3& p_W);

  // A kinematic body keeps its twist whatever acts on it (infinite mass).
  void set_kinematic(bool kinematic);

  // Kinetic energy m v^2/2 + w.I.w/2 [J].
  double kinetic_energy() const;

  // What other bodies' surfaces exerted on this one in the last step: mean over the step, moment about the centre of
  // mass. Zero without a collision shape.
  const Wrench& contact_load() const { return contact_load_; }

 private:
  friend class World;
  friend class Collisions;
  friend class Joint;
  friend class Slider;
  friend class Hinge;
  friend class Fixed;
  friend class Ball;
  friend class Rod;
  friend class LinearMotor;
  friend class AngularMotor;
  friend class SoilDamper;
  Body(World& world, std::string name, const MassProperties& mass);
  World& world_;
  std::string name_;
  MassProperties mass_;
  dxBody* id_ = nullptr;
  bool kinematic_ = false;
  Wrench contact_load_;
};

// What a joint exerted on its body in the last step: mean over the step, moment about the body's centre of mass at the
// step's beginning. `solved` is false (and the wrench zero) where the joint took no part in the step.
struct JointLoad {
  Wrench on_body;
  bool solved = false;
};

// A velocity servo: holds `velocity` [m/s or rad/s] with at most `max_effort` [N or N m].
struct Motor {
  double velocity = 0.0;
  double max_effort = std::numeric_limits<double>::infinity();
  // A motor that reaches its limit no longer imposes its motion, silently in ODE. Here that is a RunError unless the
  // limit is meant (a drive of limited torque).
  bool may_saturate = false;
  // Velocity lost per unit of effort [m/s per N, rad/s per N m]: effort = (velocity - rate)/droop, solved implicitly.
  // The line of a direct-current motor. 0: stiff.
  double droop = 0.0;
};

// A joint between `body` and `parent` (nullptr: the world), attached in this order always: positions, rates and motor
// velocities are of the body relative to the parent. (ODE's other order mirrors motion but not force.)
class Joint {
 public:
  virtual ~Joint();
  Joint(const Joint&) = delete;
  Joint& operator=(const Joint&) = delete;

  const std::string& name() const { return name_; }
  const Body& body() const { return body_; }
  const JointLoad& load() const { return load_; }

 protected:
  friend class World;
  struct Feedback;
  Joint(World& world, std::string name, Body& body, Body* parent);
  void adopt(dxJoint* id);
  virtual void prepare(double h);
  virtual void read();
  virtual void check(double time) const;
  virtual void save(std::vector<double>& state) const;
  virtual void load_state(const double*& state);

  World& world_;
  std::string name_;
  Body& body_;
  Body* parent_;
  dxJoint* id_ = nullptr;
  std::unique_ptr<Feedback> feedback_;
  JointLoad load_;
};

// A joint with one free coordinate: position [m or rad], rate, and along it either nothing, a motor, or a spring.
class AxisJoint : public Joint {
 public:
  virtual double position() const = 0;
  virtual double rate() const = 0;
  // Axis in the world; positive motion of the body relative to its parent is along (about) it.
  virtual Vec3 axis() const = 0;

  void set_motor(const Motor& motor);
  void clear_motor();
  const Motor* motor() const { return has_motor_ ? &motor_ : nullptr; }

  // Linear spring and damper along the axis, solved implicitly (stable for any step, first order in time):
  // effort = -stiffness (position - rest) - damping rate. Excludes a motor.
  void set_spring(double stiffness, double damping, double rest);
  void clear_spring();

  // Effort along the axis that motor or spring exerted on the body in the last step [N or N m], about the joint's
  // anchor; zero where the axis was free. Exact also where the centre of mass lies off the axis.
  double effort() const { return effort_; }
  bool saturated() const;

 protected:
  using Joint::Joint;
  void prepare(double h) override;
  void read() override;
  void check(double time) const override;
  void save(std::vector<double>& state) const override;
  void load_state(const double*& state) override;
  virtual void set_param(int parameter, double value) = 0;
  virtual double project(const Wrench& load) const = 0;
  void apply_drive(double h);

  bool has_motor_ = false;
  Motor motor_;
  bool has_spring_ = false;
  double stiffness_ = 0.0, damping_ = 0.0, rest_ = 0.0;
  double applied_h_ = -1.0;
  double effort_ = 0.0;
  Vec3 axis_before_ = Vec3::Zero();
};

// Free to slide along one axis, orientation held.
class Slider : public AxisJoint {
 public:
  double position() const override;
  double rate() const override;
  Vec3 axis() const override;

 private:
  friend class World;
  Slider(World& world, std::string name, Body& body, Body* parent, const Vec3& axis_W);
  void prepare(double h) override;
  void set_param(int parameter, double value) override;
  double project(const Wrench& load) const override;
};

// Free to turn about one axis through an anchor.
class Hinge : public AxisJoint {
 public:
  // Angle in (-pi, pi] from the pose at which the joint was made.
  double position() const override;
  double rate() const override;
  Vec3 axis() const override;
  Vec3 anchor() const;
  // Full turns counted: the angle followed step by step since the joint was made.
  double turned() const { return turned_; }

 private:
  friend class World;
  Hinge(World& world, std::string name, Body& body, Body* parent, const Vec3& anchor_W, const Vec3& axis_W);
  void prepare(double h) override;
  void read() override;
  void save(std::vector<double>& state) const override;
  void load_state(const double*& state) override;
  void set_param(int parameter, double value) override;
  double project(const Wrench& load) const override;
  Vec3 arm_before_ = Vec3::Zero();
  double turned_ = 0.0, last_angle_ = 0.0;
};

// Body held fixed to its parent at the pose both have now.
class Fixed : public Joint {
  friend class World;
  Fixed(World& world, std::string name, Body& body, Body* parent);
};

// Two bodies share a point.
class Ball : public Joint {
  friend class World;
  Ball(World& world, std::string name, Body& body, Body* parent, const Vec3& anchor_W);
};

// A massless rod with a ball at each end: two points keep their distance.
class Rod : public Joint {
  friend class World;
  Rod(World& world, std::string name, Body& body, Body* parent, const Vec3& end_on_body_W, const Vec3& end_on_parent_W);
};

// Imposes the velocity of a body's centre of mass along up to three world axes (velocity rows only: no position is
// held, so positions drift by rounding). Between two bodies ODE adds a moment; use it against the world.
class LinearMotor : public Joint {
 public:
  void set_velocity(std::size_t axis, double velocity);

 private:
  friend class World;
  LinearMotor(World& world, std::string name, Body& body, const std::vector<Vec3>& axes_W);
  std::size_t count_;
};

// Imposes the angular velocity of a body about up to three world axes (velocity rows only).
class AngularMotor : public Joint {
 public:
  void set_velocity(std::size_t axis, double velocity);

 private:
  friend class World;
  AngularMotor(World& world, std::string name, Body& body, const std::vector<Vec3>& axes_W);
  std::size_t count_;
};

// The part of a soil's force that answers to motion within the step, solved implicitly. A body point p and the body's
// rotation are resisted by F = -D v_p(t_n + h), M = -R w(t_n + h), with D [N s/m] and R [N m s] symmetric. With the
// external force F_n + D v_p(t_n) beside it the body feels F_n - D (v_p(t_n + h) - v_p(t_n)), and so for moments: with
// D = h k/4 + c/2 for a soil of stiffness k and damping c this is Newmark's rule with beta = 1/4, gamma = 1/2 (Newmark
// 1959): second order, stable for any step, no numerical damping.
class SoilDamper : public Joint {
 public:
  ~SoilDamper() override;
  // World axes; only symmetric parts count, and negative eigenvalues as 0 (a soil that softens is left to the explicit
  // force). Holds for the steps until the next call. Throws RunError unless all is finite.
  void set(const Vec3& p_W, const Mat3& D, const Mat3& R = Mat3::Zero());
  // D and R as they act, after the rule above.
  const Mat3& translational() const { return D_; }
  const Mat3& rotational() const { return R_; }

 private:
  friend class World;
  SoilDamper(World& world, std::string name, Body& body);
  void prepare(double h) override;
  void read() override;
  struct Rows;
  std::unique_ptr<Rows> rows_;
  Mat3 D_ = Mat3::Zero(), R_ = Mat3::Zero();
};

// Bodies and joints in one space, stepped together. Owns both; references stay valid while the world lives.
class World {
 public:
  // Throws InputError on bad options, RunError if ODE is not the double-precision build.
  explicit World(const WorldOptions& options = {});
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  // All throw InputError: name taken or empty, mass or pose not valid, a body of another world, a zero axis.
  Body& add_body(const std::string& name, const MassProperties& mass, const Pose& pose, const Twist& twist = {});
  Slider& add_slider(const std::string& name, Body& body, Body* parent, const Vec3& axis_W);
  Hinge& add_hinge(const std::string& name, Body& body, Body* parent, const Vec3& anchor_W, const Vec3& axis_W);
  Fixed& add_fixed(const std::string& name, Body& body, Body* parent);
  Ball& add_ball(const std::string& name, Body& body, Body* parent, const Vec3& anchor_W);
  Rod& add_rod(const std::string& name, Body& body, Body* parent, const Vec3& end_on_body_W,
               const Vec3& end_on_parent_W);
  LinearMotor& add_linear_motor(const std::string& name, Body& body, const std::vector<Vec3>& axes_W);
  AngularMotor& add_angular_motor(const std::string& name, Body& body, const std::vector<Vec3>& axes_W);
  SoilDamper& add_soil_damper(const std::string& name, Body& body);

  // Surfaces that touch each other; bodies without one pass through everything.
  Collisions& collisions() { return collisions_; }
  const Collisions& collisions() const { return collisions_; }

  const std::vector<std::unique_ptr<Body>>& bodies() const { return bodies_; }
  const std::vector<std::unique_ptr<Joint>>& joints() const { return joints_; }

  const WorldOptions& options() const { return options_; }
  void set_gravity(const Vec3& gravity);

  // Advances by h [s], at least kShortestStep. Before it, every pose, velocity and external force is checked: ODE aborts
  // the process on a not-finite number. Throws RunError naming body, time and likely remedy; also when ODE reports a
  // failed solution or a motor has reached a limit that was not meant.
  void step(double h);
  double time() const { return time_; }
  std::size_t steps() const { return steps_; }
  // Messages that ODE has sent while this world was stepped (each also ends the step with a RunError).
  std::size_t messages() const { return messages_; }

  // Kinetic energy plus potential energy -m g.p of all dynamic bodies [J].
  double mechanical_energy() const;

  // Everything that the next steps depend on, as numbers: a world of the same make restored to it goes on bit by bit
  // as the first one did.
  std::vector<double> snapshot() const;
  void restore(const std::vector<double>& state);

 private:
  friend class Body;
  friend class Collisions;
  friend class Joint;
  friend class Slider;
  friend class Hinge;
  friend class Fixed;
  friend class Ball;
  friend class Rod;
  friend class LinearMotor;
  friend class AngularMotor;
  friend class SoilDamper;
  void check_finite() const;
  void check_joint(const std::string& name, const Body& body, const Body* parent) const;
  template <class J>
  J& keep(std::unique_ptr<J> joint);

  WorldOptions options_;
  dxWorld* id_ = nullptr;
  dxThreadingImplementation* threading_ = nullptr;
  std::vector<std::unique_ptr<Body>> bodies_;
  std::vector<std::unique_ptr<Joint>> joints_;
  Collisions collisions_{*this};
  double time_ = 0.0, time_carry_ = 0.0;
  std::size_t steps_ = 0;
  std::size_t messages_ = 0;
};

}  // namespace terrode::multibody
