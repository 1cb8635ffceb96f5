// A known external load on a wheel must come back from the joints that hold it: the multipliers are the measurement.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/random.h"
#include "multibody/world.h"

namespace terrode::multibody {
namespace {

// Multipliers solved to rounding: what the direct solver leaves of some 40 N over a chain of three joints.
constexpr double exact_tolerance = 1e-12;
// At the default CFM a joint gives way by CFM times its load; the error is CFM m/h times the change of load per step.
constexpr double default_cfm_tolerance = 1e-8;

constexpr double wheel_mass = 3.2, wheel_radius = 0.12, wheel_width = 0.16;
constexpr double hub_mass = 0.8, carriage_mass = 5.0;

enum class Topology { motors, sliders, kinematic_carriage };

struct Case {
  Topology topology;
  double h;
  double cfm;
  bool ramps;
};

std::string case_name(const testing::TestParamInfo<Case>& i) {
  const char* names[] = {"Motors", "Sliders", "KinematicCarriage"};
  return std::string(names[static_cast<int>(i.param.topology)]) + (i.param.h < 5e-4 ? "FineStep" : "CoarseStep") +
         (i.param.cfm == 0.0 ? "ExactCfm" : "DefaultCfm") + (i.param.ramps ? "Ramps" : "Steady");
}

// A wheel held by one of the three topologies, with the imposed motion and the load that its joints report.
class HeldWheel {
 public:
  HeldWheel(Topology topology, double cfm, double v, double omega)
      : topology_(topology), world_(WorldOptions{Vec3(0, 0, -9.81), cfm, 0.2}) {
    const Pose at{Vec3(0, 0, 0.12), Quat::Identity()};
    wheel_ = &world_.add_body("wheel", MassProperties::cylinder(wheel_mass, wheel_radius, wheel_width), at,
                              {Vec3(v, 0, 0), Vec3(0, omega, 0)});
    if (topology == Topology::motors) {
      linear_ = &world_.add_linear_motor("guide", *wheel_, {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()});
      angular_ = &world_.add_angular_motor("drive", *wheel_, {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()});
      return;
    }
    const Twist along{Vec3(v, 0, 0), Vec3::Zero()};
    carriage_ = &world_.add_body("carriage", MassProperties::box(carriage_mass, Vec3(0.3, 0.2, 0.1)), at, along);
    hub_ = &world_.add_body("hub", MassProperties::box(hub_mass, Vec3(0.05, 0.05, 0.05)), at, along);
    if (topology == Topology::kinematic_carriage)
      carriage_->set_kinematic(true);
    else
      slide_x_ = &world_.add_slider("carriage_slide", *carriage_, nullptr, Vec3::UnitX());
    slide_z_ = &world_.add_slider("hub_slide", *hub_, carriage_, Vec3::UnitZ());
    hinge_ = &world_.add_hinge("axle", *wheel_, hub_, at.p_W, Vec3::UnitY());
  }

  void impose(double v, double omega) {
    if (topology_ == Topology::motors) {
      linear_->set_velocity(0, v);
      angular_->set_velocity(1, omega);
      return;
    }
    if (slide_x_ != nullptr)
      slide_x_->set_motor({v});
    else
      carriage_->set_twist({Vec3(v, 0, 0), Vec3::Zero()});
    hinge_->set_motor({omega});
  }

  // Joint force along x and torque about y on the wheel.
  double force() const {
    if (topology_ == Topology::motors) return linear_->load().on_body.F_W.x();
    return topology_ == Topology::sliders ? slide_x_->effort() : slide_z_->load().on_body.F_W.x();
  }
  double torque() const { return topology_ == Topology::motors ? angular_->load().on_body.M_W.y() : hinge_->effort(); }
  // Momentum along x of every body that hangs on the joint whose force is read; each with its own velocity, since
  // joints repair position errors of rounding size by velocities that differ.
  double carried_momentum() const {
    double p = wheel_mass * wheel_->twist().v_W.x();
    if (hub_ != nullptr) p += hub_mass * hub_->twist().v_W.x();
    if (slide_x_ != nullptr) p += carriage_mass * carriage_->twist().v_W.x();
    return p;
  }

  // The weight is carried by an external force, as the ground would.
  void load(double fx, double ty) {
    const double weight = 9.81 * (topology_ == Topology::motors ? wheel_mass : wheel_mass + hub_mass);
    wheel_->add_wrench({Vec3(fx, 0, weight), Vec3(0, ty, 0)});
  }

  World& world() { return world_; }
  Body& wheel() { return *wheel_; }

 private:
  Topology topology_;
  World world_;
  Body *wheel_ = nullptr, *hub_ = nullptr, *carriage_ = nullptr;
  Slider *slide_x_ = nullptr, *slide_z_ = nullptr;
  Hinge* hinge_ = nullptr;
  LinearMotor* linear_ = nullptr;
  AngularMotor* angular_ = nullptr;
};

class RigMultiplier : public testing::TestWithParam<Case> {};

TEST_P(RigMultiplier, ReturnsTheExternalLoad) {
  const Case c = GetParam();
  const double v0 = 0.05, omega0 = 0.55;
  HeldWheel held(c.topology, c.cfm, v0, omega0);
  Random random(7);
  double v = v0, omega = omega0, worst_force = 0.0, worst_torque = 0.0;
  for (int n = 0; n < 2000; ++n) {
    const double t = n * c.h;
    const double fx = -37.5 + 20.0 * std::sin(12.0 * t) + 5.0 * random.uniform(-1.0, 1.0);
    const double ty = -4.2 + 2.0 * std::cos(9.0 * t) + 0.5 * random.uniform(-1.0, 1.0);
    const double v1 = c.ramps ? v0 + 0.4 * (t + c.h) : v0;
    const double omega1 = c.ramps ? omega0 - 2.0 * (t + c.h) : omega0;
    held.impose(v1, omega1);
    held.load(fx, ty);
    const double momentum = held.carried_momentum(), omega_before = held.wheel().twist().w_W.y();
    held.world().step(c.h);
    const double domega = held.wheel().twist().w_W.y() - omega_before;
    const double inertia = 0.5 * wheel_mass * wheel_radius * wheel_radius;
    const double force = (held.carried_momentum() - momentum) / c.h - held.force();
    const double torque = inertia * domega / c.h - held.torque();
    worst_force = std::max(worst_force, std::abs(force - fx) / 37.5);
    worst_torque = std::max(worst_torque, std::abs(torque - ty) / 4.2);
    v = v1;
    omega = omega1;
  }
  EXPECT_NEAR(held.wheel().twist().v_W.x(), v, 1e-9);
  EXPECT_NEAR(held.wheel().twist().w_W.y(), omega, 1e-9);
  const double tolerance = c.cfm == 0.0 ? exact_tolerance : default_cfm_tolerance;
  EXPECT_LT(worst_force, tolerance);
  EXPECT_LT(worst_torque, tolerance);
  RecordProperty("relative_force_error", std::to_string(worst_force * 1e12) + "e-12");
}

std::vector<Case> cases() {
  std::vector<Case> out;
  for (const Topology topology : {Topology::motors, Topology::sliders, Topology::kinematic_carriage})
    for (const double h : {1e-3, 1e-4})
      for (const double cfm : {0.0, WorldOptions{}.cfm})
        for (const bool ramps : {false, true}) out.push_back({topology, h, cfm, ramps});
  return out;
}

INSTANTIATE_TEST_SUITE_P(Ladder, RigMultiplier, testing::ValuesIn(cases()), case_name);

}  // namespace
}  // namespace terrode::multibody
