#include "terrain/rigid.h"

#include <algorithm>
#include <cmath>

#include "wheel/body.h"

namespace terrode::terrain {

Problems RigidGroundParams::validate() const {
  Problems p;
  require(p, "stiffness", stiffness, "N/m", stiffness > 0, "a stiffness above 0");
  require(p, "damping", damping, "N s/m", damping >= 0, "a damping of 0 or more");
  require(p, "friction", friction, "-", friction >= 0, "a coefficient of 0 or more");
  require(p, "sliding_scale", sliding_scale, "m/s", sliding_scale > 0, "a velocity above 0");
  require(p, "height", height, "m", true, "a height");
  return p;
}

RigidTerrain::RigidTerrain(const RigidGroundParams& params) : params_(params) { throw_if_any(params.validate()); }

BodyId RigidTerrain::add_body(std::shared_ptr<const wheel::Body> shape) {
  if (!shape) throw InputError("rigid ground: no shape given for a body");
  shapes_.push_back(std::move(shape));
  patches_.emplace_back();
  patches_.back().reserve(2);
  return static_cast<BodyId>(shapes_.size()) - 1;
}

void RigidTerrain::check_body(BodyId body) const {
  if (body < 0 || static_cast<std::size_t>(body) >= shapes_.size())
    throw InputError("rigid ground: there is no body " + std::to_string(body));
}

void RigidTerrain::begin_step(double t, double h) {
  if (!std::isfinite(t) || !std::isfinite(h) || h <= 0) throw InputError("rigid ground: a step needs a finite length above 0");
  if (in_step_) throw RunError("rigid ground: a step was begun before the last one ended");
  in_step_ = true;
}

void RigidTerrain::set_motion(BodyId body, const Pose& pose, const Twist& twist) {
  check_body(body);
  require_finite(pose, twist, "rigid ground");
}

ContactResult RigidTerrain::wrench(BodyId body, const Pose& pose, const Twist& twist) {
  check_body(body);
  if (!in_step_) throw RunError("rigid ground: a wrench was asked for outside a step");
  require_finite(pose, twist, "rigid ground");
  auto& patch = patches_[static_cast<std::size_t>(body)];
  patch.clear();
  ContactResult r;
  const wheel::Body& shape = *shapes_[static_cast<std::size_t>(body)];
  // A cylinder's lowest point jumps from edge to edge as the wheel tilts; both edges with half of the stiffness each
  // make a contact that turns with it.
  const Vec3 axle = pose.R_WB * Vec3::UnitY();
  const Vec3 down = -Vec3::UnitZ() + axle.z() * axle;
  const bool two_edges = shape.plain_cylinder() && down.norm() > 0.1;
  const int count = two_edges ? 2 : 1;
  for (int i = 0; i < count; ++i) {
    Vec3 arm;
    if (two_edges) {
      const wheel::Rolling& rim = *shape.rolling();
      arm = rim.radius * down.normalized() + (i == 0 ? 0.5 : -0.5) * rim.width * axle;
    } else {
      arm = pose.R_WB * shape.support(pose.R_WB.conjugate() * -Vec3::UnitZ());
    }
    point(1.0 / count, arm, pose, twist, r, patch);
  }
  return r;
}

// Adds the contact of one point of the body, with a share of the stiffness and damping.
void RigidTerrain::point(double share, const Vec3& arm, const Pose& pose, const Twist& twist, ContactResult& r,
                         std::vector<PatchNode>& patch) const {
  const double depth = params_.height - (pose.p_W.z() + arm.z());
  if (depth <= 0) return;
  const double stiffness = share * params_.stiffness, damping = share * params_.damping;
  const Vec3 v = twist.v_W + twist.w_W.cross(arm);
  const double push = stiffness * depth - damping * v.z();
  r.max_sinkage = std::max(r.max_sinkage, depth);
  r.stored_energy += 0.5 * stiffness * depth * depth;
  if (push <= 0) return;
  const Vec3 slide(v.x(), v.y(), 0.0);
  const double speed = slide.norm();
  Vec3 F(0.0, 0.0, push);
  // Friction over sliding speed: the secant, which for a force that flattens out damps no less than the tangent.
  const double drag = params_.friction * push *
                      (speed > 1e-9 * params_.sliding_scale ? std::tanh(speed / params_.sliding_scale) / speed
                                                            : 1.0 / params_.sliding_scale);
  F -= drag * slide;
  r.wrench.F_W += F;
  r.wrench.M_W += arm.cross(F);
  // Resistance of the contact point, whose velocity is A (v; w).
  Eigen::Matrix<double, 3, 6> A;
  A << Mat3::Identity(), (Mat3() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0).finished();
  r.damping += A.transpose() * Vec3(drag, drag, damping).asDiagonal() * A;
  r.stiffness += A.transpose() * Vec3(0, 0, stiffness).asDiagonal() * A;
  r.slip_power -= F.dot(slide);
  r.damping_power += damping * v.z() * v.z();
  ++r.contact_count;
  PatchNode node;
  node.p_W = pose.p_W + arm;
  node.n_W = -Vec3::UnitZ();
  node.sinkage = depth;
  patch.push_back(node);
}

void RigidTerrain::end_step() {
  if (!in_step_) throw RunError("rigid ground: a step was ended that was not begun");
  in_step_ = false;
}

std::vector<PatchNode> RigidTerrain::patch(BodyId body) const {
  check_body(body);
  return patches_[static_cast<std::size_t>(body)];
}

std::vector<std::uint8_t> RigidTerrain::snapshot() const { return {'r', 'i', 'g', 'i', 'd'}; }

void RigidTerrain::restore(std::span<const std::uint8_t> bytes) {
  in_step_ = false;
  const auto own = snapshot();
  if (!std::equal(bytes.begin(), bytes.end(), own.begin(), own.end()))
    throw InputError("rigid ground: the snapshot is of another ground");
}

}  // namespace terrode::terrain
