// Whole machines against hand calculation and closed forms.
#include "vehicle/vehicle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "terrain/rigid.h"
#include "vehicle/controllers.h"
#include "vehicle/machines.h"
#include "vehicle/rig.h"

namespace terrode::vehicle {
namespace {

constexpr double g = 9.81;
// Swinging has died down to this share of the weight at the end of the runs below.
constexpr double settled = 1e-4;

// Ground of a height of its own under each body, without or with friction (one coefficient for each body).
class Blocks final : public terrain::Terrain {
 public:
  explicit Blocks(std::map<int, double> heights = {}, std::map<int, double> friction = {})
      : heights_(std::move(heights)), friction_(std::move(friction)) {}
  terrain::BodyId add_body(std::shared_ptr<const wheel::Body> shape) override {
    shapes_.push_back(std::move(shape));
    return static_cast<int>(shapes_.size()) - 1;
  }
  terrain::Sampling sampling() const override { return terrain::Sampling::point_value; }
  void begin_step(double, double) override {}
  void set_motion(terrain::BodyId, const Pose&, const Twist&) override {}
  terrain::ContactResult wrench(terrain::BodyId i, const Pose& pose, const Twist& u) override {
    constexpr double k = 1e6, c = 4e3, scale = 1e-3;
    terrain::ContactResult r;
    const Vec3 arm(0, 0, -shapes_[static_cast<std::size_t>(i)]->rolling()->radius);
    const double depth = height_of(i) - (pose.p_W + arm).z();
    if (depth <= 0.0) return r;
    const Vec3 v = u.v_W + u.w_W.cross(arm);
    const double N = std::max(0.0, k * depth - c * v.z());
    const double mu = friction_.contains(i) ? friction_.at(i) : 0.0;
    const double speed = std::hypot(v.x(), v.y());
    const double drag = mu * N * (speed > 1e-12 ? std::tanh(speed / scale) / speed : 1.0 / scale);
    r.wrench.F_W = Vec3(-drag * v.x(), -drag * v.y(), N);
    r.wrench.M_W = arm.cross(r.wrench.F_W);
    Eigen::Matrix<double, 3, 6> A;
    A << Mat3::Identity(), (Mat3() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0).finished();
    r.damping = A.transpose() * Vec3(drag, drag, c).asDiagonal() * A;
    r.stiffness(2, 2) = k;
    return r;
  }
  void end_step() override {}
  double height(double, double) const override { return 0.0; }
  double undisturbed_height(double, double) const override { return 0.0; }
  std::vector<std::uint8_t> snapshot() const override { return {}; }
  void restore(std::span<const std::uint8_t>) override {}
  std::string name() const override { return "blocks"; }
  // Raised step by step, so that a machine is set on flat ground and lifted slowly.
  void raise(double share) { share_ = share; }

 private:
  double height_of(int i) const { return heights_.contains(i) ? share_ * heights_.at(i) : 0.0; }
  std::vector<std::shared_ptr<const wheel::Body>> shapes_;
  std::map<int, double> heights_, friction_;
  double share_ = 1.0;
};

std::unique_ptr<terrain::Terrain> rigid(double friction = 0.6) {
  terrain::RigidGroundParams p;
  p.friction = friction;
  return std::make_unique<terrain::RigidTerrain>(p);
}

VehicleOptions fine() {
  VehicleOptions o;
  o.time_step = 1e-3;
  return o;
}

void rest(Vehicle& v, double seconds) {
  const auto n = static_cast<int>(seconds / v.options().time_step);
  for (int i = 0; i < n; ++i) v.step();
}

const WheelSample& wheel_of(const Vehicle& v, const std::string& name) {
  for (std::size_t i = 0; i < v.spec().wheels.size(); ++i)
    if (v.spec().wheels[i].name == name) return v.last().wheels[i];
  throw RunError("no wheel " + name);
}

// Flat ground. A rocker carries, about its bogie's pivot: its front wheel against half of the body (and of the
// differential), its own weight and the weights on its front end; the bogie shares its load by its arms.
TEST(RockerBogie, WheelLoadsOnFlatGroundByHand) {
  const VehicleSpec spec = rocker_bogie_rover();
  Vehicle rover(spec, fine(), std::make_unique<Blocks>());
  rest(rover, 6.0);
  std::map<std::string, BodySpec> body;
  for (const BodySpec& b : spec.bodies) body[b.name] = b;
  const double knuckle = SteeringSpec{}.knuckle_mass, wheel = 3.2;
  const double pivot = -0.30;
  // Everything symmetric about the rover's middle: half of the body's weight acts on each side, at its x (the
  // differential passes the body's pitching moment to both rockers alike).
  const double half = 0.5 * g * (body["chassis"].mass + body["differential"].mass);
  const double rocker = g * body["rocker_left"].mass, bogie = g * body["bogie_left"].mass;
  const double front_end = g * (wheel + knuckle), rear_end = g * (wheel + knuckle), middle = g * wheel;
  const double front = (half * (0.0 - pivot) + rocker * (0.20 - pivot) + front_end * (0.60 - pivot)) / (0.60 - pivot);
  const double pin = half + rocker + front_end - front;  // what the bogie's pivot carries
  // Bogie about its rear wheel at x = -0.60; middle wheel at 0.
  const double middle_load = (pin * (pivot + 0.60) + bogie * (-0.30 + 0.60) + middle * 0.60) / 0.60;
  const double rear = pin + bogie + middle + rear_end - middle_load;
  for (const char* side : {"left", "right"}) {
    const std::string s = side;
    EXPECT_NEAR(wheel_of(rover, "front_" + s).normal_load, front, settled * 1800.0) << s;
    EXPECT_NEAR(wheel_of(rover, "middle_" + s).normal_load, middle_load, settled * 1800.0) << s;
    EXPECT_NEAR(wheel_of(rover, "rear_" + s).normal_load, rear, settled * 1800.0) << s;
  }
  EXPECT_NEAR(rover.last().pitch, 0.0, 1e-3);
  EXPECT_NEAR(rover.last().roll, 0.0, 1e-6);
}

// A wheel on a block 0.12 m high, no friction: each part of the suspension is in balance about its pivot where it now
// stands, the weights in sum, and the body pitches by half of what its rockers do.
TEST(RockerBogie, BalanceOnAStepByHand) {
  for (const int raised : {0, 1, 2}) {  // front, middle, rear left
    const VehicleSpec spec = rocker_bogie_rover();
    auto blocks = std::make_unique<Blocks>(std::map<int, double>{{raised, 0.12}});
    Blocks& ground = *blocks;
    ground.raise(0.0);
    Vehicle rover(spec, fine(), std::move(blocks));
    rover.settle();
    for (int n = 0; n < 3000; ++n) {
      ground.raise((n + 1) / 3000.0);
      rover.step();
    }
    rest(rover, 5.0);
    double sum = 0.0;
    for (const WheelSample& w : rover.last().wheels) sum += w.normal_load;
    EXPECT_NEAR(sum, spec.mass() * g, settled * spec.mass() * g);
    for (const char* side : {"left", "right"}) {
      const std::string s = side;
      const Vec3 pivot = dynamic_cast<multibody::Hinge&>(rover.joint("bogie_pivot_" + s)).anchor();
      const auto x = [&](const std::string& name) { return rover.body(name).pose().p_W.x() - pivot.x(); };
      const auto moment = [&](const std::string& name, double mass) {
        return x(name) * (wheel_of(rover, name).normal_load - g * mass);
      };
      const double knuckle = SteeringSpec{}.knuckle_mass;
      const double balance =
          moment("middle_" + s, 3.2) + moment("rear_" + s, 3.2 + knuckle) - g * 3.0 * x("bogie_" + s);
      EXPECT_NEAR(balance, 0.0, 2e-3 * spec.mass() * g * 0.3) << s << raised;
    }
    const auto pitch = [&](const std::string& name) {
      const Vec3 ahead = rover.body(name).pose().R_WB * Vec3::UnitX();
      return -std::atan2(ahead.z(), std::hypot(ahead.x(), ahead.y()));
    };
    // The links stay nearly parallel: the mean holds to second order in the angles.
    const double mean = 0.5 * (pitch("rocker_left") + pitch("rocker_right"));
    EXPECT_NEAR(pitch("chassis"), mean, 0.02 * std::abs(pitch("rocker_left") - pitch("rocker_right")) + 1e-6) << raised;
    EXPECT_GT(std::abs(pitch("rocker_left")), 0.01);
  }
}

TEST(Vehicle, CarStandsAsItsSpringsAndPreloadSay) {
  const VehicleSpec spec = two_axle_car();
  Vehicle car(spec, fine(), rigid());
  rest(car, 5.0);
  // The preload is the body's weight: struts stay where they were assembled.
  for (const WheelSample& w : car.last().wheels)
    EXPECT_NEAR(w.normal_load, 0.25 * spec.mass() * g, 0.05 * spec.mass() * g);
  double sum = 0.0;
  for (const WheelSample& w : car.last().wheels) sum += w.normal_load;
  EXPECT_NEAR(sum, spec.mass() * g, settled * spec.mass() * g);
  for (const auto& w : spec.wheels)
    EXPECT_NEAR(dynamic_cast<multibody::Slider&>(car.joint(w.name + ".strut")).position(), 0.0, 0.01) << w.name;
}

// Rolling without slip or drive: the pull accelerates mass and turning wheels, a = F/(m + sum I/r^2).
TEST(Vehicle, TowedAxleRollsFreelyByClosedForm) {
  const VehicleSpec spec = towed_axle();
  Vehicle cart(spec, fine(), rigid());
  rest(cart, 1.0);
  double inertia = spec.mass();
  for (const auto& w : spec.wheels) inertia += 0.5 * w.mass;  // I/r^2 of a full cylinder
  const double pull = 20.0, v0 = cart.last().speed;
  cart.set_hitch_pull(-pull);
  rest(cart, 2.0);
  EXPECT_NEAR(cart.last().speed - v0, pull / inertia * (2.0 - 1e-3), 2e-3);
  for (const WheelSample& w : cart.last().wheels) EXPECT_NEAR(w.angular_velocity, cart.last().speed / 0.20, 0.02);
}

TEST(Vehicle, EnergyBooksCloseForEveryMachine) {
  for (const std::string& name : machine_names()) {
    Vehicle v(machine(name), {}, rigid());
    std::vector<Manoeuvre> moves(2);
    moves[0].duration = 3.0;
    moves[0].speed = 0.2;
    moves[0].hitch_pull = name == "towed-axle" ? -30.0 : 20.0;
    moves[1].duration = 3.0;
    moves[1].speed = 0.2;
    moves[1].curvature = 0.2;
    Script script(moves);
    v.run(script, 6.0);
    const VehicleEnergy e = v.energy();
    EXPECT_GT(e.ground, 0.0) << name;
    const double turned_over = std::abs(e.drives) + std::abs(e.gravity) + std::abs(e.hitch) + std::abs(e.springs);
    EXPECT_NEAR(e.residual(), 0.0, 2e-3 * turned_over) << name;  // gyroscopic terms and joints' error repair
  }
}

TEST(Vehicle, MirroredManoeuvreGivesTheMirroredPath) {
  for (const std::string name : {"rocker-bogie-rover", "skid-steer-robot", "two-axle-car"}) {
    std::vector<VehicleSample> ends;
    for (const double sign : {1.0, -1.0}) {
      Vehicle v(machine(name), {}, rigid());
      std::vector<Manoeuvre> moves(1);
      moves[0].duration = 4.0;
      moves[0].speed = 0.25;
      moves[0].curvature = 0.15 * sign;
      Script script(moves);
      v.run(script, 4.0);
      ends.push_back(v.last());
    }
    EXPECT_GT(ends[0].pose.p_W.y(), 0.01) << name;
    EXPECT_NEAR(ends[0].pose.p_W.x(), ends[1].pose.p_W.x(), 1e-6) << name;
    EXPECT_NEAR(ends[0].pose.p_W.y(), -ends[1].pose.p_W.y(), 1e-6) << name;
    EXPECT_NEAR(ends[0].heading, -ends[1].heading, 1e-6) << name;
  }
}

TEST(Vehicle, CurvatureOfASteeredMachineIsTheCommanded) {
  for (const std::string name : {"rocker-bogie-rover", "two-axle-car"}) {
    Vehicle v(machine(name), {}, rigid());
    std::vector<Manoeuvre> moves(1);
    moves[0].duration = 8.0;
    moves[0].speed = 0.3;
    moves[0].curvature = 0.2;
    Script script(moves);
    v.run(script, 8.0);
    // Wheels slip a little in friction that grows with sliding speed.
    EXPECT_NEAR(v.last().twist.w_W.z() / v.last().speed, 0.2, 0.01) << name;
    EXPECT_NEAR(v.last().speed, 0.3, 0.01) << name;
  }
}

TEST(Vehicle, PathFollowerPassesItsWaypoints) {
  Vehicle v(rocker_bogie_rover(), {}, rigid());
  PathFollower::Options options;
  options.speed = 0.4;
  options.lookahead = 0.6;
  options.largest_curvature = 1.0;
  const std::vector<Eigen::Vector2d> path = {{0, 0}, {2.0, 0.0}, {4.0, 1.0}, {5.0, 1.0}};
  PathFollower follower(path, options);
  double nearest = 1e9;
  FunctionController watched([&](Vehicle& x) {
    follower.command(x);
    nearest = std::min(nearest, (x.last().pose.p_W.head<2>() - path[2]).norm());
  });
  v.run(watched, 16.0);
  EXPECT_TRUE(follower.finished(v));
  EXPECT_LT(nearest, 0.3);
  EXPECT_LT((v.last().pose.p_W.head<2>() - path.back()).norm(), 0.2);
}

TEST(Vehicle, TurnsInPlace) {
  for (const std::string name : {"rocker-bogie-rover", "skid-steer-robot"}) {
    Vehicle v(machine(name), {}, rigid());
    std::vector<Manoeuvre> moves(2);
    moves[0].duration = 4.0;
    moves[0].yaw_rate = 1e-6;  // wheels turn to their angles first
    moves[1].duration = 5.0;
    moves[1].yaw_rate = 0.2;
    Script script(moves);
    v.run(script, 9.0);
    EXPECT_GT(v.last().heading, 0.3) << name;
    EXPECT_LT(v.last().pose.p_W.head<2>().norm(), 0.1) << name;
  }
}

// The motor's line: at rest the stall torque, and the torque that a load asks for costs speed.
TEST(Vehicle, DcMotorRunsOnItsLine) {
  VehicleSpec spec = skid_steer_robot();
  for (auto& w : spec.wheels) w.drive.motor.speed_gain = 0.0;
  const DcMotorSpec m = spec.wheels[0].drive.motor;
  Vehicle robot(spec, fine(), rigid());
  const double pull = 40.0, wanted = 0.2 / 0.10;
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = 6.0;
  moves[0].speed = 0.2;
  moves[0].hitch_pull = pull;
  Script script(moves);
  robot.run(script, 6.0);
  const double k = m.efficiency * m.gear * m.torque_constant, emf = m.gear * m.torque_constant;
  double torque = 0.0;
  for (const WheelSample& w : robot.last().wheels) {
    torque += w.driving_torque;
    EXPECT_NEAR(w.angular_velocity, wanted - w.driving_torque * m.resistance / (k * emf), 1e-6);
    EXPECT_GT(w.electric_power, w.power);
    EXPECT_FALSE(w.limited);
  }
  EXPECT_NEAR(torque / 0.10, pull, 0.02 * pull);
}

TEST(Vehicle, DcMotorStallsAtItsCurrentLimit) {
  VehicleSpec spec = skid_steer_robot();
  for (auto& w : spec.wheels) w.drive.motor.current_limit = 1.0;
  const DcMotorSpec m = spec.wheels[0].drive.motor;
  const double strongest = 4.0 * m.efficiency * m.gear * m.torque_constant * m.current_limit / 0.10;
  Vehicle robot(spec, {}, rigid(1.0));
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = 20.0;
  moves[0].speed = 0.5;
  moves[0].ramp = 2.0;
  moves[0].hitch_pull = 1.02 * strongest;
  Script script(moves);
  robot.run(script, 20.0);
  ASSERT_EQ(robot.events().size(), 1u);
  EXPECT_THAT(robot.events()[0], testing::HasSubstr("stall"));
  EXPECT_TRUE(robot.last().wheels[0].limited);
}

TEST(Vehicle, ImmobilisedMachineSaysWhy) {
  Vehicle slippery(skid_steer_robot(), {}, rigid(0.3));
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = 30.0;
  moves[0].speed = 0.2;
  moves[0].hitch_pull = 0.31 * 25.0 * g;
  Script script(moves);
  const recording::Run run = slippery.run(script, 30.0);
  ASSERT_EQ(slippery.events().size(), 1u);
  EXPECT_THAT(slippery.events()[0], testing::HasSubstr("immobilised"));
  EXPECT_THAT(slippery.events()[0], testing::HasSubstr("spin"));
  EXPECT_LT(run.time.back(), 29.0);
}

TEST(Vehicle, RemainingPullIsWhatFrictionHolds) {
  VehicleSpec spec = skid_steer_robot();
  spec.hitch = Vec3(-0.25, 0.0, 0.02);  // low: the load hardly moves from front to rear
  // Hard ground takes friction at the slide that a step ends with: where wheels break away, 4 ms give 2 % too much.
  Vehicle robot(spec, fine(), rigid(0.4));
  robot.drive_path(0.2, 0.0);
  rest(robot, 2.0);
  const VehicleState before = robot.snapshot();
  const double pull = robot.remaining_pull(10.0, 500.0);
  EXPECT_NEAR(pull, 0.4 * spec.mass() * g, 0.01 * 0.4 * spec.mass() * g);
  EXPECT_EQ(before.simulation.world, robot.snapshot().simulation.world);
  EXPECT_EQ(before.numbers, robot.snapshot().numbers);
}

// A slope is gravity that leans back: friction holds as long as tan(slope) < mu.
TEST(Vehicle, ClimbsUpToTheSlopeThatItsPullAllows) {
  const double mu = 0.4;
  for (const double share : {0.93, 1.07}) {
    const double slope = std::atan(share * mu);
    VehicleOptions options;
    options.gravity = g * Vec3(-std::sin(slope), 0.0, -std::cos(slope));
    Vehicle robot(skid_steer_robot(), options, rigid(mu));
    std::vector<Manoeuvre> moves(1);
    moves[0].duration = 6.0;
    moves[0].speed = 0.2;
    Script script(moves);
    robot.run(script, 6.0);
    EXPECT_EQ(robot.last().pose.p_W.x() > 0.5, share < 1.0) << share;
  }
}

// A tricycle whose rear wheels stand without friction pulls with its front wheel alone: the same wheel under the same
// load and pull in the single-wheel rig slips the same.
TEST(Vehicle, WheelOfAMachineWhoseOthersFloatAgreesWithTheRig) {
  VehicleSpec spec;
  spec.name = "tricycle";
  spec.bodies.push_back({"chassis", 40.0, Vec3(0.0, 0.0, 0.13), Vec3(0.8, 0.4, 0.2), {}});
  spec.hitch = Vec3(-0.4, 0.0, 0.0);  // at the ground: the pull takes nothing from the wheel's load
  for (const int i : {0, 1, 2}) {
    VehicleWheelSpec w;
    w.name = i == 0 ? "front" : (i == 1 ? "left" : "right");
    w.parent = "chassis";
    w.centre = i == 0 ? Vec3(0.4, 0.0, 0.13) : Vec3(-0.4, i == 1 ? 0.3 : -0.3, 0.13);
    w.mass = 3.2;
    w.drive.kind = i == 0 ? DriveKind::speed : DriveKind::free;
    spec.wheels.push_back(w);
  }
  const auto ground = [] { return std::make_unique<Blocks>(std::map<int, double>{}, std::map<int, double>{{0, 0.7}}); };
  const double pull = 60.0, omega = 0.5;
  Vehicle tricycle(spec, fine(), ground());
  tricycle.settle();
  tricycle.drive(0, omega);
  tricycle.set_hitch_pull(pull);
  rest(tricycle, 8.0);
  const WheelSample& front = tricycle.last().wheels[0];

  RigSpec rig_spec;
  rig_spec.normal_load = front.normal_load;
  RigMotion motion;
  motion.mode = RigMode::force_controlled;
  motion.angular_velocity = omega;
  motion.pull = pull;
  motion.duration = 8.0;
  Rig rig(rig_spec, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{}), ground());
  while (!rig.finished()) rig.step();
  EXPECT_NEAR(front.drawbar_pull, rig.last().drawbar_pull, 1e-4 * pull);
  EXPECT_NEAR(front.slip, rig.last().slip, 1e-5);
  EXPECT_NEAR(front.driving_torque, rig.last().driving_torque, 1e-4 * pull * 0.13);
}

TEST(Vehicle, RestoredMachineGoesOnToTheBit) {
  std::vector<Manoeuvre> moves(3);
  for (std::size_t i = 0; i < moves.size(); ++i) {
    moves[i].duration = 0.7;
    moves[i].speed = 0.2;
    moves[i].curvature = 0.3 * static_cast<double>(i) - 0.3;
  }
  for (const std::string& name : machine_names()) {
    Vehicle first(machine(name), {}, rigid()), second(machine(name), {}, rigid());
    Script a(moves), b(moves);
    first.run(a, 1.0);
    const VehicleState state = first.snapshot(&a);
    second.restore(state, &b);
    first.run(a, 0.8);
    second.run(b, 0.8);
    EXPECT_EQ(first.snapshot(&a).simulation.world, second.snapshot(&b).simulation.world) << name;
    EXPECT_EQ(first.snapshot(&a).numbers, second.snapshot(&b).numbers) << name;
    EXPECT_EQ(first.snapshot(&a).controller, second.snapshot(&b).controller) << name;
  }
}

TEST(Vehicle, HeadingAtTheStartTurnsTheWholeRun) {
  std::vector<Eigen::Vector2d> ends;
  for (const double heading : {0.0, 0.7}) {
    VehicleOptions options;
    options.start_heading = heading;
    options.start_x = 3.0;
    Vehicle v(skid_steer_robot(), options, rigid());
    std::vector<Manoeuvre> moves(1);
    moves[0].duration = 3.0;
    moves[0].speed = 0.3;
    Script script(moves);
    v.run(script, 3.0);
    const Eigen::Vector2d d = v.last().pose.p_W.head<2>() - Eigen::Vector2d(3.0, 0.0);
    ends.emplace_back(d.norm(), std::atan2(d.y(), d.x()) - heading);
  }
  EXPECT_NEAR(ends[0].x(), ends[1].x(), 1e-6);
  EXPECT_NEAR(ends[0].y(), ends[1].y(), 1e-6);
}

TEST(Vehicle, WrongDescriptionNamesEveryProblem) {
  VehicleSpec spec = skid_steer_robot();
  spec.bodies[0].mass = -1.0;
  spec.wheels[0].parent = "chasis";
  spec.wheels[1].name = spec.wheels[2].name;
  spec.wheels[3].shape.radius = 0.0;
  try {
    Vehicle v(spec, {}, rigid());
    FAIL();
  } catch (const InputError& e) {
    EXPECT_GE(e.problems().size(), 4u);
    EXPECT_THAT(e.what(), testing::HasSubstr("'chassis'"));
  }
  EXPECT_THROW(Vehicle(skid_steer_robot(), {}, nullptr), InputError);
  EXPECT_THROW(machine("rocker-bogie-rove"), InputError);
  EXPECT_THROW(Script({}), InputError);
  EXPECT_THROW(Script({Manoeuvre{}}), InputError);
  EXPECT_THROW(PathFollower({}, {}), InputError);
  VehicleOptions options;
  options.gravity = Vec3::Zero();
  EXPECT_THROW(Vehicle(skid_steer_robot(), options, rigid()), InputError);
}

TEST(Vehicle, ChannelsOfARunAreFiniteAndNamedByWheel) {
  Vehicle v(two_axle_car(), {}, rigid());
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = 1.0;
  moves[0].speed = 0.5;
  Script script(moves);
  const recording::Run run = v.run(script, 1.0);
  EXPECT_EQ(run.channels.size(), 11u + 4u * 12u);
  ASSERT_NE(run.find("rear_left_drawbar_pull"), nullptr);
  for (const auto& c : run.channels) {
    EXPECT_EQ(c.values.size(), run.time.size());
    for (const double x : c.values) ASSERT_TRUE(std::isfinite(x)) << c.name;
  }
}

}  // namespace
}  // namespace terrode::vehicle
