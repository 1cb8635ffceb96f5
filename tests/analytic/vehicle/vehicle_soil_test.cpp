// Whole machines on node-spring ground of 10 mm at default settings, against hand calculation and the single wheel.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "bekker/steady_wheel.h"
#include "terrain/node_spring.h"
#include "terrain/rigid.h"
#include "terrain/surfaces.h"
#include "vehicle/controllers.h"
#include "vehicle/machines.h"
#include "vehicle/rig.h"
#include "vehicle/vehicle.h"

namespace terrode::vehicle {
namespace {

constexpr double g = 9.81;

terrain::NodeSpringParams soil() {  // Smith et al., Table 1
  terrain::NodeSpringParams p;
  p.spacing = 0.01;
  return p;
}

std::unique_ptr<terrain::Terrain> soft() { return std::make_unique<terrain::NodeSpringTerrain>(soil()); }

// The car's wheels are large: nodes of 20 mm stand to them as 10 mm to the others.
std::unique_ptr<terrain::Terrain> soft_for(const std::string& machine) {
  terrain::NodeSpringParams p = soil();
  if (machine == "two-axle-car") p.spacing = 0.02;
  return std::make_unique<terrain::NodeSpringTerrain>(p);
}

std::vector<Manoeuvre> move(double seconds, double speed, double curvature = 0.0) {
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = seconds;
  moves[0].speed = speed;
  moves[0].curvature = curvature;
  return moves;
}

double mean_of_last(const std::vector<double>& v, double share) {
  const auto from = static_cast<std::size_t>(static_cast<double>(v.size()) * (1.0 - share));
  double sum = 0.0;
  for (std::size_t i = from; i < v.size(); ++i) sum += v[i];
  return sum / static_cast<double>(v.size() - from);
}

// Moment about y at `about` of all weights and contact forces on the bodies whose names begin with one of `parts`.
double pitching_moment(Vehicle& v, const Vec3& about, const std::vector<std::string>& parts) {
  const auto among = [&](const std::string& name) {
    return std::any_of(parts.begin(), parts.end(), [&](const std::string& p) { return name.rfind(p, 0) == 0; });
  };
  double sum = 0.0;
  for (const auto& b : v.simulation().world().bodies())
    if (among(b->name())) sum += (b->pose().p_W.x() - about.x()) * b->mass() * g;
  for (const GroundContact& c : v.simulation().contacts()) {
    if (!among(c.body->name())) continue;
    const Vec3 arm = c.body->pose().p_W - about;
    sum += arm.z() * c.wrench.F_W.x() - arm.x() * c.wrench.F_W.z() + c.wrench.M_W.y();
  }
  return sum;
}

// Each bogie is in balance about its pin; chassis, differential, rockers and front wheels together are about the two
// pins; the loads are those of the hand calculation but for what the soil's moments about the axles shift.
TEST(VehicleOnSoil, RockerBogieBalancesOnSoil) {
  const VehicleSpec spec = rocker_bogie_rover();
  Vehicle rover(spec, {}, soft());
  for (int i = 0; i < 500; ++i) rover.step();
  const double scale = 1e-4 * spec.mass() * g * 0.3;  // a ten-thousandth of the weight at a bogie's arm
  double sum = 0.0;
  for (const WheelSample& w : rover.last().wheels) sum += w.normal_load;
  EXPECT_NEAR(sum, spec.mass() * g, 1e-4 * spec.mass() * g);
  Vec3 pin = Vec3::Zero();
  for (const std::string side : {"left", "right"}) {
    pin = dynamic_cast<multibody::Hinge&>(rover.joint("bogie_pivot_" + side)).anchor();
    EXPECT_NEAR(pitching_moment(rover, pin, {"bogie_" + side, "middle_" + side, "rear_" + side}), 0.0, scale) << side;
  }
  EXPECT_NEAR(pitching_moment(rover, pin, {"chassis", "differential", "rocker_", "front_"}), 0.0, 2.0 * scale);
  std::map<std::string, double> mass;
  for (const BodySpec& b : spec.bodies) mass[b.name] = b.mass;
  const double wheel = 3.2, pivot = -0.30, end = g * (wheel + SteeringSpec{}.knuckle_mass);
  const double half = 0.5 * g * (mass["chassis"] + mass["differential"]);
  const double front =
      (half * -pivot + g * mass["rocker_left"] * (0.20 - pivot) + end * (0.60 - pivot)) / (0.60 - pivot);
  const double on_pin = half + g * mass["rocker_left"] + end - front;
  const double middle = (on_pin * (pivot + 0.60) + g * mass["bogie_left"] * 0.30 + g * wheel * 0.60) / 0.60;
  const double rear = on_pin + g * mass["bogie_left"] + g * wheel + end - middle;
  for (const std::size_t first : {0u, 3u}) {
    // 1.7 N m about a front axle, as the soil took the wheel at rest, over 0.9 m.
    EXPECT_NEAR(rover.last().wheels[first].normal_load, front, 0.015 * front);
    EXPECT_NEAR(rover.last().wheels[first + 1].normal_load, middle, 0.015 * middle);
    EXPECT_NEAR(rover.last().wheels[first + 2].normal_load, rear, 0.015 * rear);
  }
}

TEST(VehicleOnSoil, EnergyBooksClose) {
  for (const std::string& name : machine_names()) {
    Vehicle v(machine(name), {}, soft_for(name));
    std::vector<Manoeuvre> moves = move(1.5, 0.2);
    moves[0].hitch_pull = name == "towed-axle" ? -150.0 : 10.0;
    moves.push_back(move(1.5, 0.2, 0.3)[0]);
    Script script(moves);
    v.run(script, 3.0);
    const VehicleEnergy e = v.energy();
    const double turned_over = std::abs(e.drives) + std::abs(e.gravity) + std::abs(e.hitch) + std::abs(e.springs);
    EXPECT_NEAR(e.residual(), 0.0, 3e-3 * turned_over) << name;  // gyroscopic terms and joints' error repair
    double known = 0.0;  // where the ground says that its share went
    for (const GroundContact& c : v.simulation().contacts()) {
      EXPECT_GE(c.plastic, 0.0) << name;
      known += c.plastic + c.slip + c.damping + c.result.stored_energy;
    }
    // Powers at the steps' beginnings against work over the steps: first order in the step. The car's heavy wheels
    // bounce in their contacts, which takes its sum off by some hundredths.
    if (name != "two-axle-car") {
      EXPECT_NEAR(known, e.ground, 0.02 * e.ground) << name;
    }
  }
}

TEST(VehicleOnSoil, MirroredManoeuvreIsMirrored) {
  for (const std::string name : {"rocker-bogie-rover", "skid-steer-robot", "two-axle-car"}) {
    std::vector<VehicleSample> ends;
    for (const double sign : {1.0, -1.0}) {
      Vehicle v(machine(name), {}, soft_for(name));
      Script script(move(1.5, 0.25, 0.3 * sign));
      v.run(script, 1.5);
      ends.push_back(v.last());
    }
    // Rounding differs between the sides of the lattice, and contacts that open or close carry it on: 2e-7 m over 0.3 m
    // for the rover.
    EXPECT_GT(ends[0].pose.p_W.y(), 1e-3) << name;
    EXPECT_NEAR(ends[0].pose.p_W.x(), ends[1].pose.p_W.x(), 1e-5) << name;
    EXPECT_NEAR(ends[0].pose.p_W.y(), -ends[1].pose.p_W.y(), 1e-5) << name;
    EXPECT_NEAR(ends[0].heading, -ends[1].heading, 1e-5) << name;
  }
}

// Soil under body 0, hard ground without friction under all others.
class SoilUnderTheFirst final : public terrain::Terrain {
 public:
  SoilUnderTheFirst() : soft_(soil()), hard_(slippery()) {}
  terrain::BodyId add_body(std::shared_ptr<const wheel::Body> shape) override {
    (count_ == 0 ? static_cast<terrain::Terrain&>(soft_) : hard_).add_body(std::move(shape));
    return count_++;
  }
  terrain::Sampling sampling() const override { return terrain::Sampling::point_value; }
  void begin_step(double t, double h) override {
    soft_.begin_step(t, h);
    hard_.begin_step(t, h);
  }
  void set_motion(terrain::BodyId, const Pose&, const Twist&) override {}
  terrain::ContactResult wrench(terrain::BodyId i, const Pose& pose, const Twist& u) override {
    return i == 0 ? soft_.wrench(0, pose, u) : hard_.wrench(i - 1, pose, u);
  }
  void end_step() override {
    soft_.end_step();
    hard_.end_step();
  }
  double height(double x, double y) const override { return soft_.height(x, y); }
  double undisturbed_height(double, double) const override { return 0.0; }
  std::vector<std::uint8_t> snapshot() const override { return soft_.snapshot(); }
  void restore(std::span<const std::uint8_t> bytes) override { soft_.restore(bytes); }
  std::string name() const override { return "mixed"; }

 private:
  static terrain::RigidGroundParams slippery() {
    terrain::RigidGroundParams p;
    p.friction = 0.0;
    return p;
  }
  terrain::NodeSpringTerrain soft_;
  terrain::RigidTerrain hard_;
  int count_ = 0;
};

TEST(VehicleOnSoil, WheelOfAMachineWhoseOthersFloatAgreesWithTheRig) {
  VehicleSpec spec;
  spec.name = "tricycle";
  spec.bodies.push_back({"chassis", 25.0, Vec3(0.0, 0.0, 0.13), Vec3(0.8, 0.4, 0.2), {}});
  spec.hitch = Vec3(-0.4, 0.0, 0.0);
  for (const int i : {0, 1, 2}) {
    VehicleWheelSpec w;
    w.name = i == 0 ? "front" : (i == 1 ? "left" : "right");
    w.parent = "chassis";
    w.centre = i == 0 ? Vec3(0.4, 0.0, 0.13) : Vec3(-0.4, i == 1 ? 0.3 : -0.3, 0.13);
    w.mass = 3.2;
    w.drive.kind = i == 0 ? DriveKind::speed : DriveKind::free;
    spec.wheels.push_back(w);
  }
  const double pull = 40.0, omega = 0.5, seconds = 6.0;
  Vehicle tricycle(spec, {}, std::make_unique<SoilUnderTheFirst>());
  std::vector<Manoeuvre> moves = move(seconds, omega * 0.13);
  moves[0].hitch_pull = pull;
  Script script(moves);
  const recording::Run run = tricycle.run(script, seconds);
  const auto mean = [&](const recording::Run& r, const std::string& name) { return mean_of_last(r.find(name)->values, 0.4); };

  RigSpec rig_spec;
  rig_spec.time_step = 2e-3;
  rig_spec.normal_load = mean(run, "front_normal_load");
  RigMotion motion;
  motion.mode = RigMode::force_controlled;
  motion.angular_velocity = omega;
  motion.pull = mean(run, "front_drawbar_pull");
  motion.duration = seconds;
  Rig rig(rig_spec, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{}), soft());
  const recording::Run alone = rig.run();
  // The same wheel on the same soil: what differs is how the load swings as the machine sets off.
  for (const char* c : {"drawbar_pull", "driving_torque", "sinkage"})
    EXPECT_NEAR(mean(run, std::string("front_") + c), mean(alone, c), 2e-3 * std::abs(mean(alone, c))) << c;
  EXPECT_NEAR(mean(run, "front_slip"), mean(alone, "slip"), 1e-3);
}

// What a quarter of the default step gives, to a hundredth of each wheel's load and of its sinkage.
TEST(VehicleOnSoil, DefaultStepIsFineEnough) {
  for (const auto& name : {"rocker-bogie-rover", "skid-steer-robot"}) {
    SCOPED_TRACE(name);
    std::vector<recording::Run> runs;
    for (const double share : {1.0, 0.25}) {
      VehicleOptions options;
      options.time_step *= share;
      Vehicle v(machine(name), options, soft());
      Script script(move(4.0, 0.1, 0.2));
      runs.push_back(v.run(script, 4.0));
    }
    for (const auto& wheel : machine(name).wheels) {
      const auto both = [&](const char* channel) {
        const std::string key = wheel.name + "_" + channel;
        return std::array{mean_of_last(runs[0].find(key)->values, 0.4), mean_of_last(runs[1].find(key)->values, 0.4)};
      };
      const auto load = both("normal_load"), pull = both("drawbar_pull"), sinkage = both("sinkage");
      EXPECT_NEAR(pull[0], pull[1], 0.01 * load[1]) << wheel.name;
      EXPECT_NEAR(sinkage[0], sinkage[1], 0.01 * sinkage[1]) << wheel.name;
    }
  }
}

// The steady wheel's largest pull over slips up to 0.9 for a load, and so the slope at which the weight along it is all
// that the wheels can pull: sum of D(W_i) = m g sin(slope), with the loads W_i of a body that leans back.
TEST(VehicleOnSoil, SlopeLimitFollowsFromTheSingleWheelsPull) {
  VehicleSpec spec = skid_steer_robot();
  spec.hitch = Vec3(-0.25, 0.0, 0.02);
  // Rear wheels beside the ruts of the front ones.
  for (auto& w : spec.wheels) {
    w.drive.kind = DriveKind::speed;
    if (w.centre.x() < 0.0) w.centre.y() *= 0.55;
  }
  const double radius = spec.wheels[0].shape.radius, wheelbase = 0.36, weight = spec.mass() * g;
  const bekker::SteadyWheel single({radius, spec.wheels[0].shape.width}, soil().soil, soil().angles);
  const auto best = [&](double load) {
    bekker::SteadyState out;
    out.drawbar_pull = -1e9;
    for (double s = 0.3; s < 0.91; s += 0.05) {
      bekker::Operating at;
      at.slip = s;
      at.normal_load = load;
      const bekker::SteadyState state = single.solve(at);
      if (state.drawbar_pull > out.drawbar_pull) out = state;
    }
    return out;
  };
  double height = 0.0;  // of the centre of mass over the axles
  for (const BodySpec& b : spec.bodies) height += b.mass * b.position.z() / spec.mass();
  for (const auto& w : spec.wheels) height += w.mass * w.centre.z() / spec.mass();
  height -= radius;
  double slope = 0.3;
  for (int i = 0; i < 50; ++i) {
    double shift = 0.0;  // of load from front to rear, each axle
    double pull = 0.0;
    for (int k = 0; k < 20; ++k) {
      const bekker::SteadyState f = best(0.25 * weight * std::cos(slope) - 0.5 * shift);
      const bekker::SteadyState r = best(0.25 * weight * std::cos(slope) + 0.5 * shift);
      pull = 2.0 * (f.drawbar_pull + r.drawbar_pull);
      shift = (weight * std::sin(slope) * height + 2.0 * (f.driving_torque + r.driving_torque)) / wheelbase;
    }
    slope = std::asin(pull / weight);
  }
  EXPECT_GT(slope, 0.2);
  for (const double share : {0.95, 1.05}) {
    VehicleOptions options;
    options.gravity = g * Vec3(-std::sin(share * slope), 0.0, -std::cos(share * slope));
    options.immobile_time = 2.0;
    options.immobile_share = 0.5;
    Vehicle robot(spec, options, soft());
    Script script(move(8.0, 0.2));
    robot.run(script, 8.0);
    if (share < 1.0) {
      EXPECT_EQ(robot.end(), RunEnd::duration);
      EXPECT_GT(robot.last().speed, 0.15);
    } else {
      EXPECT_EQ(robot.end(), RunEnd::immobilised);
    }
  }
}

}  // namespace
}  // namespace terrode::vehicle
