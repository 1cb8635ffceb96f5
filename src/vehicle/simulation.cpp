#include "vehicle/simulation.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "terrain/implicit_step.h"

namespace terrode::vehicle {

namespace {

Mat3 cross(const Vec3& p) {
  Mat3 m;
  m << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
  return m;
}

void check_answer(const GroundContact& c, const Pose& pose, double t, double h) {
  const terrain::ContactResult& r = c.result;
  const char* what = !r.wrench.F_W.allFinite() || !r.wrench.M_W.allFinite() ? "force"
                     : !r.damping.allFinite() || !r.stiffness.allFinite()   ? "stiffness or damping"
                                                                            : nullptr;
  if (what == nullptr) return;
  throw RunError(fmt::format("body '{}' at t = {:.6g} s: the {} of the ground on it is not finite (at x = {:.4g}, y = {:.4g}, "
                             "z = {:.4g} m): try a time step below {:.3g} s, then check the soil's parameters",
                             c.body->name(), t, what, pose.p_W.x(), pose.p_W.y(), pose.p_W.z(), h));
}

}  // namespace

PointResistance point_resistance(const terrain::Mat6& B, const Vec3& origin_W) {
  const terrain::Mat6 S = 0.5 * (B + B.transpose());
  PointResistance out;
  out.D = S.topLeftCorner<3, 3>();
  const Mat3 coupling = S.bottomLeftCorner<3, 3>();
  // Least squares of p x D = coupling, column by column; directions along which p does not matter stay zero.
  Mat3 normal = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  for (int j = 0; j < 3; ++j) {
    const Mat3 a = -cross(out.D.col(j));
    normal += a.transpose() * a;
    right += a.transpose() * coupling.col(j);
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(normal);
  Vec3 p = Vec3::Zero();
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] > 1e-9 * eigen.eigenvalues()[2])
      p += eigen.eigenvectors().col(i) * (eigen.eigenvectors().col(i).dot(right) / eigen.eigenvalues()[i]);
  const Mat3 c = cross(p);
  out.p_W = origin_W + p;
  out.R = S.bottomRightCorner<3, 3>() - c * out.D * c.transpose();
  return out;
}

std::size_t Simulation::add(multibody::Body& body, std::shared_ptr<const wheel::Body> shape) {
  GroundContact c;
  c.body = &body;
  c.shape = shape;
  c.id = ground_.add_body(std::move(shape));
  c.damper = &world_.add_soil_damper("ground:" + body.name(), body);
  contacts_.push_back(std::move(c));
  before_.emplace_back();
  return contacts_.size() - 1;
}

void Simulation::step(double h) {
  ground_.begin_step(world_.time(), h);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    before_[i] = contacts_[i].body->twist();
    if (contacts_.size() > 1) ground_.set_motion(contacts_[i].id, contacts_[i].body->pose(), before_[i]);
  }
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    GroundContact& c = contacts_[i];
    const Pose pose = c.body->pose();
    const Twist& u = before_[i];
    c.result = ground_.wrench(c.id, pose, u);
    check_answer(c, pose, world_.time(), h);
    const terrain::StepResistance own = terrain::step_resistance(c.result, h, c.body->mass());
    const PointResistance r = point_resistance(own.inertial + own.releasing, pose.p_W);
    c.damper->set(r.p_W, r.D, r.R);
    const Vec3 arm = r.p_W - pose.p_W;
    const Vec3 F = c.damper->translational() * (u.v_W + u.w_W.cross(arm));
    c.wrench = c.result.wrench;
    c.wrench += Wrench{F, arm.cross(F) + c.damper->rotational() * u.w_W};
    // The damper holds both parts back by all of their velocity; the inertial one acts on its change alone.
    Eigen::Matrix<double, 6, 1> now;
    now << u.v_W, u.w_W;
    const Eigen::Matrix<double, 6, 1> released = own.releasing * now;
    c.wrench.F_W -= released.head<3>();
    c.wrench.M_W -= released.tail<3>();
    c.body->add_wrench(c.wrench);
  }
  world_.step(h);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    GroundContact& c = contacts_[i];
    c.wrench += c.damper->load().on_body;
    const Twist after = c.body->twist();
    const Twist mean{0.5 * (before_[i].v_W + after.v_W), 0.5 * (before_[i].w_W + after.w_W)};
    const auto work = [h](const Wrench& w, const Vec3& v, const Vec3& omega) { return -h * (w.F_W.dot(v) + w.M_W.dot(omega)); };
    const double all = work(c.wrench, mean.v_W, mean.w_W), ground = work(c.result.wrench, mean.v_W, mean.w_W);
    c.work += all;
    c.numerical += all - ground;
    c.plastic += h * c.result.plastic_power;
    c.slip += h * c.result.slip_power;
    c.damping += h * c.result.damping_power;
    if (!c.result.shear.F_W.isZero(0.0)) {
      // The ground's powers are for the motion at t_n; what was done is at the mean of the step.
      const Vec3 v = mean.v_W - before_[i].v_W, omega = mean.w_W - before_[i].w_W;
      const double sheared = work(c.result.shear, v, omega);
      c.slip += sheared;
      c.plastic += work(c.result.wrench, v, omega) - sheared;
    }
  }
  ground_.end_step();
}

SimulationState Simulation::snapshot() const {
  SimulationState s{world_.snapshot(), ground_.snapshot(), {}};
  for (const GroundContact& c : contacts_) s.contacts.insert(s.contacts.end(), {c.work, c.plastic, c.slip, c.damping, c.numerical});
  return s;
}

void Simulation::restore(const SimulationState& state) {
  if (state.contacts.size() != 5 * contacts_.size())
    throw InputError(Problem{{}, 0, 0, "snapshot", "is of a simulation with other bodies on the ground", {}});
  world_.restore(state.world);
  ground_.restore(state.ground);
  const double* s = state.contacts.data();
  for (GroundContact& c : contacts_) {
    c.work = s[0];
    c.plastic = s[1];
    c.slip = s[2];
    c.damping = s[3];
    c.numerical = s[4];
    s += 5;
  }
}

}  // namespace terrode::vehicle
