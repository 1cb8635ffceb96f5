// Whole machines on soft ground: bodies, joints, suspension, wheels, drives and steering from a plain description,
// moved by a controller, with every wheel measured as the single-wheel rig measures its own.
//
// Frames. A description is given in the machine's frame: x forward, y left, z up, the origin on level ground under the
// machine as it stands assembled. Sprung joints have their assembly position there.
//
// A wheel hangs on its parent by a chain of which any link may be absent:
//     parent -[strut: slider along z with spring and damper]- upright -[steering: hinge about z]- knuckle -[axle: hinge
//     about y]- wheel
//
// Setting down. The machine is placed so that its lowest wheel just touches, and gravity rises from 0 to its value by
// 10 u^3 - 15 u^4 + 6 u^5 over `settle_time` while the drives hold still: it sinks in without a jolt, whatever its
// suspension. Time zero is after that.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "recording/checkpoint.h"
#include "recording/recording.h"
#include "multibody/collisions.h"
#include "vehicle/rocks.h"
#include "vehicle/simulation.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {

// A rigid body; a box of `size` gives its inertia unless that is given, and is what touches rocks.
struct BodySpec {
  std::string name;
  double mass = 0.0;                // kg
  Vec3 position = Vec3::Zero();     // m, centre of mass
  Vec3 size = Vec3(0.1, 0.1, 0.1);  // m
  std::optional<Mat3> inertia;      // kg m2 about the centre of mass, machine axes
  bool touches_ground = false;      // its box presses on the ground too: a belly that hangs up
  // What presses on the ground in place of the box: convex hulls of points about the centre of mass [m] (a foot, a plough).
  std::vector<std::vector<Vec3>> pieces = {};
};

struct SpringSpec {
  double stiffness = 0.0;  // N/m or N m/rad
  double damping = 0.0;    // N s/m or N m s/rad
  double preload = 0.0;    // N or N m that the spring exerts against the parent as assembled
};

enum class JointKind { fixed, hinge, slider, ball, rod };

// Between `body` and `parent`. A rod joins `anchor` on the body to `anchor_on_parent`.
struct JointSpec {
  std::string name;
  JointKind kind = JointKind::hinge;
  std::string body, parent;
  Vec3 anchor = Vec3::Zero();            // m
  Vec3 anchor_on_parent = Vec3::Zero();  // m, rods alone
  Vec3 axis = Vec3::UnitY();             // hinges and sliders
  std::optional<SpringSpec> spring;      // hinges and sliders
};

// What turns a wheel about its axle, and what its command means.
enum class DriveKind {
  free,      // nothing
  speed,     // servo: command is the angular velocity [rad/s], held with at most max_torque
  torque,    // command is the torque [N m], at most max_torque
  dc_motor,  // command is the angular velocity [rad/s] of a speed controller that sets the motor's voltage
};

// A direct-current motor behind a gear, all at the wheel's side where not said otherwise: voltage u = ke N w_cmd +
// speed_gain (w_cmd - w), within +-voltage; current i = (u - ke N w)/resistance; torque = efficiency N kt i, within
// efficiency N kt current_limit; kt = ke = torque_constant.
struct DcMotorSpec {
  double voltage = 24.0;                                           // V
  double resistance = 1.0;                                         // Ohm
  double torque_constant = 0.05;                                   // N m/A = V s/rad, of the motor's shaft
  double gear = 50.0;                                              // N, motor turns per wheel turn
  double efficiency = 0.8;                                         // of the gear
  double current_limit = std::numeric_limits<double>::infinity();  // A
  double speed_gain = 5.0;                                         // V s/rad of wheel speed
};

struct DriveSpec {
  DriveKind kind = DriveKind::speed;
  double max_torque = std::numeric_limits<double>::infinity();  // N m
  DcMotorSpec motor;
};

// Position servo about z: turns at (target - angle)/response, at most `rate`. Without `joint` a knuckle of knuckle_mass
// turns at the wheel's centre; with it, that hinge of the machine (whose body is the wheel's parent) is the steering.
struct SteeringSpec {
  double limit = 1.0;         // rad, largest angle to either side
  double rate = 0.5;          // rad/s
  double response = 0.2;      // s
  double knuckle_mass = 0.5;  // kg
  std::string joint;
};

struct StrutSpec {
  SpringSpec spring;
  double upright_mass = 1.0;  // kg
};

struct VehicleWheelSpec {
  std::string name;
  std::string parent;
  Vec3 centre = Vec3::Zero();  // m
  double mass = 1.0;           // kg
  std::optional<Mat3> inertia; // kg m2, machine axes; else of a full cylinder
  wheel::WheelShape shape;
  DriveSpec drive;
  std::optional<StrutSpec> strut;
  std::optional<SteeringSpec> steering;
};

// What the machine measures of itself; channels are named <sensor>_<quantity>, means over a sample. `noise` is the
// deviation of a normal error on every channel, in its SI unit, a new one each sample.
//   imu          at `position` on `body`, body axes: acceleration_x/_y/_z less gravity [m/s2], angular_velocity_x/_y/_z
//   encoder      position and rate of a hinge or slider (`joint`; a wheel's are <wheel>.axle, .steering, .strut)
//   joint_load   what the joint exerts on its body, body axes, moment about its centre of mass: force_x/_y/_z [N],
//                moment_x/_y/_z [N m]
enum class SensorKind { imu, encoder, joint_load };

struct SensorSpec {
  std::string name;
  SensorKind kind = SensorKind::imu;
  std::string body;              // imu
  Vec3 position = Vec3::Zero();  // m, machine frame, imu
  std::string joint;             // encoder, joint_load
  double noise = 0.0;
};

struct VehicleSpec {
  std::string name;
  std::vector<BodySpec> bodies;  // the first is the one whose motion is the machine's
  std::vector<JointSpec> joints;
  std::vector<VehicleWheelSpec> wheels;
  std::vector<SensorSpec> sensors;
  Vec3 hitch = Vec3::Zero();  // m, where a drawbar load pulls at the first body

  double mass() const;  // kg, uprights, knuckles and wheels included
  // Every problem: names twice or unknown, masses, joints to nothing, a machine without wheels.
  Problems validate() const;
};

struct VehicleOptions {
  double time_step = 4e-3;              // s
  double sample_interval = 2e-2;        // s
  double settle_time = 1.0;             // s
  Vec3 gravity{0.0, 0.0, -9.81};        // m/s2; tilt it for a slope
  double start_x = 0.0, start_y = 0.0;  // m
  double start_heading = 0.0;           // rad from x towards y
  // Immobilised: over this time the machine has moved on by less than this share of what it was driven to.
  double immobile_time = 5.0;  // s
  double immobile_share = 0.02;
  // Mobility margin every so often during run(); 0: never. Pull and rate of its ramp: 0 stands for the machine's weight
  // and a tenth of it a second.
  double margin_interval = 0.0;  // s
  double margin_largest = 0.0;   // N
  double margin_rate = 0.0;      // N/s
  std::vector<RockSpec> rocks;
  multibody::ContactLaw rock_contact;
  std::uint64_t seed = 1;  // of sensor noise
  Problems validate() const;
};

// Mean over a step (forces) at the step's beginning (motion). Wheel axes: heading is horizontal, square to the axle.
struct WheelSample {
  double forward_velocity = 0.0;  // m/s along the heading
  double angular_velocity = 0.0;  // rad/s about the axle, relative to the world
  double slip = 0.0;              // 1 - v/(omega r); 0 while the rim stands
  double sinkage = 0.0;           // m below the undisturbed surface
  double drawbar_pull = 0.0;      // N, ground on wheel along its heading
  double lateral_force = 0.0;     // N to the left of the heading
  double normal_load = 0.0;       // N upwards
  double driving_torque = 0.0;    // N m of the drive
  double power = 0.0;             // W, torque times axle rate
  double electric_power = 0.0;    // W, of dc_motor drives; else equal to power
  double energy = 0.0;            // J of power since time zero
  double steering_angle = 0.0;    // rad
  bool limited = false;           // the drive is at its limit
};

struct VehicleSample {
  double time = 0.0;  // s
  Pose pose;          // of the first body
  Twist twist;
  double heading = 0.0;            // rad
  double pitch = 0.0, roll = 0.0;  // rad, pitch positive nose down, roll positive to the right
  double speed = 0.0;              // m/s along the heading
  double travel = 0.0;             // m of path covered
  double hitch_pull = 0.0;         // N applied
  std::vector<WheelSample> wheels;
};

struct VehicleEnergy {
  double drives = 0.0;   // J, of axle and steering drives
  double gravity = 0.0;  // J
  double hitch = 0.0;    // J, negative for a resisting pull
  double springs = 0.0;  // J that springs and dampers gave (their stored energy counts negative)
  double kinetic = 0.0;  // J, gain
  double ground = 0.0;   // J, work done on the ground
  double rocks = 0.0;    // J, spent between wheels, bodies and rocks
  double residual() const { return drives + gravity + hitch + springs - kinetic - ground - rocks; }
};

// How much more the machine could pull, at a moment of a run.
struct MarginSample {
  double time = 0.0;    // s
  double travel = 0.0;  // m
  double pull = 0.0;    // N
  bool at_least = false;  // the ramp ended before the machine did
};

enum class RunEnd { none, duration, controller, immobilised, overturned };

class Vehicle;

// What drives a machine. Called at the beginning of each step; sets commands. Its state is saved with the machine's.
class Controller {
 public:
  virtual ~Controller() = default;
  virtual void command(Vehicle& vehicle) = 0;
  virtual bool finished(const Vehicle&) const { return false; }
  virtual std::vector<double> state() const { return {}; }
  virtual void set_state(const std::vector<double>&) {}
};

struct VehicleState {
  SimulationState simulation;
  std::vector<double> numbers;
  std::vector<double> controller;
};

class Vehicle {
 public:
  // Throws InputError with every problem.
  Vehicle(const VehicleSpec& spec, const VehicleOptions& options, std::unique_ptr<terrain::Terrain> ground);
  ~Vehicle();

  // Lets gravity come on. Called by run() and step() where it was not.
  void settle(const Progress& progress = {});

  // Commands, kept until changed. drive(i): see DriveKind; steer(i): angle [rad], ignored without steering.
  void drive(std::size_t wheel, double command);
  void steer(std::size_t wheel, double angle);
  // All wheels at once, from rigid-body kinematics: the machine's origin moves at `speed` [m/s] and turns with
  // `curvature` [1/m] (left positive); steered wheels point along their path, others take the part along their heading.
  // Wheels with torque drives are left alone. turn_in_place() spins about the origin at a yaw rate [rad/s].
  void drive_path(double speed, double curvature);
  void turn_in_place(double yaw_rate);
  // Resisting pull at the hitch, horizontal and backwards along the heading [N].
  void set_hitch_pull(double pull) { hitch_pull_ = pull; }
  double commanded_speed() const { return commanded_speed_; }

  // One step. Throws RunError when the solution fails or a wheel is buried to its axle.
  void step();
  const VehicleSample& last() const { return last_; }

  // Runs until the controller has finished, `duration` [s] is over, the machine is immobilised or overturned.
  recording::Run run(Controller& controller, double duration, const Progress& progress = {});
  // Why a run ended early, or what else there is to say.
  const std::vector<std::string>& events() const { return events_; }
  RunEnd end() const { return end_; }
  // The samples that the present or last run() has taken until now: all there is when it throws.
  const recording::Run& so_far() const { return run_; }
  // The motion of every body that belongs to the machine and of every loose rock, with the same times: position, unit
  // quaternion, velocity, angular velocity.
  const std::vector<recording::Run>& body_runs() const { return body_runs_; }
  const std::vector<MarginSample>& margins() const { return margins_; }
  // Called by run() after every sample, between steps. It must change nothing.
  void set_observer(std::function<void(Vehicle&)> observer) { observer_ = std::move(observer); }
  // Between two samples of run() (in the observer): machine, ground, controller and samples. A machine of the same make
  // that is set to it and given the rest of the time goes on bit for bit. resume() throws InputError for a state of
  // another machine.
  recording::Checkpoint checkpoint(const Controller& controller) const;
  void resume(const recording::Checkpoint& checkpoint, Controller& controller);

  // Mobility margin: largest further resisting pull [N] at the hitch that the wheels hold, driven as they are now, up
  // to `largest`. Found by a pull that rises at `rate` [N/s] until the machine makes no more way; everything is as
  // before afterwards. The pull in force counts as zero. `held` tells whether it held the largest.
  double remaining_pull(double rate, double largest, bool* held = nullptr);

  VehicleEnergy energy() const;
  const VehicleSpec& spec() const { return spec_; }
  const VehicleOptions& options() const { return options_; }
  Simulation& simulation() { return *simulation_; }
  multibody::Body& body(const std::string& name);
  multibody::Joint& joint(const std::string& name);
  double time() const;  // s since time zero

  // Between steps, bit-exact. A controller's state goes with it where one is given.
  VehicleState snapshot(const Controller* controller = nullptr) const;
  void restore(const VehicleState& state, Controller* controller = nullptr);

 private:
  struct WheelParts;
  void build();
  void apply_drives();
  void advance();
  void sample(std::size_t wheel);
  std::string immobile_reason() const;
  bool immobilised();
  void place_rocks();
  void begin_recording(std::size_t samples);
  void add_motions();
  void add_measures();
  void keep_sample(double sample_time, std::size_t steps);

  VehicleSpec spec_;
  VehicleOptions options_;
  std::unique_ptr<terrain::Terrain> ground_;
  std::unique_ptr<multibody::World> world_;
  std::unique_ptr<Simulation> simulation_;
  std::vector<WheelParts> wheels_;
  std::vector<multibody::AxisJoint*> sprung_;
  std::map<std::string, multibody::Body*> bodies_;
  std::map<std::string, multibody::Joint*> joints_;
  multibody::Body* chassis_ = nullptr;
  Vec3 origin_in_chassis_ = Vec3::Zero(), hitch_in_chassis_ = Vec3::Zero();
  bool settled_ = false;
  double zero_time_ = 0.0, travel_ = 0.0, commanded_travel_ = 0.0;
  double commanded_speed_ = 0.0, hitch_pull_ = 0.0;
  double drive_work_ = 0.0, gravity_work_ = 0.0, hitch_work_ = 0.0, spring_work_ = 0.0, start_kinetic_ = 0.0;
  std::vector<Vec3> velocity_before_;
  std::vector<double> rate_before_;
  VehicleSample last_;
  std::vector<std::string> events_;
  RunEnd end_ = RunEnd::none;

  // Sensors, with what they need of the step's beginning.
  struct Sensor {
    multibody::Body* body = nullptr;
    Vec3 arm = Vec3::Zero();  // of an imu, body axes
    multibody::Joint* joint = nullptr;
    multibody::AxisJoint* axis = nullptr;
    Vec3 motion_before = Vec3::Zero(), spin_before = Vec3::Zero();  // of an imu; an encoder's position and rate
    Quat turn_before = Quat::Identity();
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();  // of the last step; of an imu acceleration and angular velocity
  };
  std::vector<Sensor> sensors_;
  std::vector<std::string> bellies_;  // bodies that touch the ground, in the order of the simulation's contacts

  double commanded_yaw_ = 0.0;
  // Immobilisation: over the last `window_` seconds, what was driven and what was covered [m].
  double window_ = 0.0, commanded_ = 0.0, covered_ = 0.0;
  recording::Run run_;    // since the last run() began
  bool resumed_ = false;  // run() adds to it
  std::vector<recording::Run> body_runs_;
  std::vector<const multibody::Body*> recorded_bodies_;
  std::vector<MarginSample> margins_;
  std::vector<double> sums_;
  std::function<void(Vehicle&)> observer_;
};

}  // namespace terrode::vehicle
