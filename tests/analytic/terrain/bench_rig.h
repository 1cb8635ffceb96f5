// The smallest rig that tests of grounds need: a wheel with imposed forward speed and rotation, free to move up and
// down under a load. Symplectic Euler on the vertical, the wrench of the pose before the step.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "terrain/implicit_step.h"
#include "terrain/terrain.h"
#include "wheel/wheel.h"

namespace terrode::test {

struct RigRun {
  double slip = 0.3;                     // s = 1 - v/(omega r)
  double angular_velocity = 17.0 * std::numbers::pi / 180.0;  // [rad/s]
  double load = 115.0;                   // [N]
  double mass = 3.2;                     // [kg]
  double step = 1e-3;                    // [s]
  double duration = 6.0;                 // [s]
  double average = 2.0;                  // [s] at the end
  double start_x = 0.0, start_y = 0.0, yaw = 0.0;
  double start_sinkage = 0.0;            // [m]
  std::optional<double> forward_velocity;  // [m/s] in place of what slip gives
  double lateral_velocity = 0.0;           // [m/s] towards the axle's direction
  bool implicit = true;                  // takes the contact's stiffness and damping implicitly
};

struct RigResult {
  double pull = 0.0, torque = 0.0, sinkage = 0.0, normal = 0.0, side = 0.0;  // means over the window
  double pull_ripple = 0.0, normal_ripple = 0.0, torque_ripple = 0.0, sinkage_ripple = 0.0;  // half of peak to peak
  double work_in = 0.0, plastic = 0.0, slip = 0.0, damping = 0.0, stored = 0.0, kinetic = 0.0;  // [J], whole run
  std::vector<double> sinkages;
};

inline RigResult drive(terrain::Terrain& ground, terrain::BodyId id, double radius, const RigRun& run, double start_time = 0.0) {
  const double v = run.forward_velocity.value_or((1.0 - run.slip) * run.angular_velocity * radius), side = run.lateral_velocity;
  const Vec3 heading(std::cos(run.yaw), std::sin(run.yaw), 0.0), axle(-std::sin(run.yaw), std::cos(run.yaw), 0.0);
  const double ground0 = ground.undisturbed_height(run.start_x, run.start_y);
  double z = ground0 + radius - run.start_sinkage, vz = 0.0;
  RigResult out;
  const int steps = static_cast<int>(std::lround(run.duration / run.step));
  const int from = steps - static_cast<int>(std::lround(run.average / run.step));
  double lo[4] = {1e300, 1e300, 1e300, 1e300}, hi[4] = {-1e300, -1e300, -1e300, -1e300};
  int count = 0;
  for (int i = 0; i < steps; ++i) {
    const double t = i * run.step;
    Pose pose;
    pose.p_W = Vec3(run.start_x, run.start_y, z) + v * t * heading + side * t * axle;
    pose.R_WB = Quat(Eigen::AngleAxisd(run.yaw, Vec3::UnitZ())) * Quat(Eigen::AngleAxisd(run.angular_velocity * t, Vec3::UnitY()));
    Twist twist;
    twist.v_W = v * heading + side * axle + vz * Vec3::UnitZ();
    twist.w_W = run.angular_velocity * axle;
    ground.begin_step(start_time + t, run.step);
    const terrain::ContactResult r = ground.wrench(id, pose, twist);
    const double F = r.wrench.F_W.z() - run.load;
    const terrain::StepResistance taken = run.implicit ? terrain::step_resistance(r, run.step, run.mass) : terrain::StepResistance{};
    const double B = taken.inertial(2, 2), C = taken.releasing(2, 2), h = run.step;
    const double vz1 = vz + h * (F - C * vz) / (run.mass + h * (B + C));
    ground.end_step();
    const double pull = r.wrench.F_W.dot(heading), torque = -r.wrench.M_W.dot(axle);
    // Work done on the wheel by drive, carriage and load, at the velocities that act over the step.
    const double vm = 0.5 * (vz + vz1);
    out.work_in += h * (torque * run.angular_velocity - pull * v - r.wrench.F_W.dot(axle) * side - run.load * vm);
    out.plastic += h * r.plastic_power;
    out.slip += h * r.slip_power;
    out.damping += h * r.damping_power;
    out.stored = r.stored_energy;
    vz = vz1;
    z += h * vz;
    out.kinetic = 0.5 * run.mass * vz * vz;
    const double sinkage = ground0 + radius - z;
    out.sinkages.push_back(sinkage);
    if (i < from) continue;
    ++count;
    out.pull += pull;
    out.torque += torque;
    out.sinkage += sinkage;
    out.normal += r.wrench.F_W.z();
    out.side += r.wrench.F_W.dot(axle);
    const double all[4] = {pull, r.wrench.F_W.z(), torque, sinkage};
    for (int k = 0; k < 4; ++k) {
      lo[k] = std::min(lo[k], all[k]);
      hi[k] = std::max(hi[k], all[k]);
    }
  }
  for (double* mean : {&out.pull, &out.torque, &out.sinkage, &out.normal, &out.side}) *mean /= count;
  out.pull_ripple = 0.5 * (hi[0] - lo[0]);
  out.normal_ripple = 0.5 * (hi[1] - lo[1]);
  out.torque_ripple = 0.5 * (hi[2] - lo[2]);
  out.sinkage_ripple = 0.5 * (hi[3] - lo[3]);
  return out;
}

}  // namespace terrode::test
