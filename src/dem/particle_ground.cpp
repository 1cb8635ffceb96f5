#include "dem/particle_ground.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "wheel/body.h"

namespace terrode::dem {

Problems DemTerrainParams::validate() const {
  Problems problems;
  if (prism.grains.empty()) problems.push_back({{}, 0, 0, "prism", "has no grains", "a settled bed"});
  if (tiles_y < 1) problems.push_back({{}, 0, 0, "tiles_y", "is below 1", "1 or more"});
  const auto positive = [&](const char* key, double value, const char* unit) {
    require(problems, key, value, unit, value > 0.0, "above 0");
  };
  positive("window_ahead", window_ahead, "m");
  positive("window_behind", window_behind, "m");
  positive("shell_diameter", shell_diameter, "m");
  require(problems, "shell_spacing", shell_spacing, "-", shell_spacing > 0.0 && shell_spacing <= 1.5,
          "above 0, at most 1.5");
  positive("gravity", gravity, "m/s2");
  require(problems, "full_length", full_length, "m", full_length >= 0.0, "0 (none) or more");
  if (full_length > 0.0) {
    require(problems, "full_behind", full_behind, "m", full_behind > 0.0 && full_behind < full_length,
            "above 0, below the bed's length");
    require(problems, "border", border, "m", border >= 0.0 && 2.0 * border < full_length && 2.0 * border < prism.length * tiles_y,
            "0 or more, below half the bed");
  }
  require(problems, "time_step", time_step, "s", time_step >= 0.0, "0 (suggested) or more");
  for (const Problems& more : {soil.validate(), wheel.validate(), floor.validate()})
    problems.insert(problems.end(), more.begin(), more.end());
  return problems;
}

double surface_level(const Bed& bed) {
  constexpr int n = 24;
  double sum = 0.0;
  const auto nearest = [](double d, double period) { return d - period * std::nearbyint(d / period); };
  for (int k = 0; k < n * n; ++k) {
    const int column = k % n, row = k / n;
    const double x = (column + 0.5) / n * bed.width, y = (row + 0.5) / n * bed.length;
    double top = 0.0;
    for (const Grain& g : bed.grains) {
      const double dx = nearest(g.position.x() - x, bed.width), dy = nearest(g.position.y() - y, bed.length);
      const double below = g.radius * g.radius - dx * dx - dy * dy;
      if (below > 0.0) top = std::max(top, g.position.z() + std::sqrt(below));
    }
    sum += top / (n * n);
  }
  return sum;
}

ParticleGround::ParticleGround(DemTerrainParams params) : params_(std::move(params)) {
  throw_if_any(params_.validate());
  depth_ = surface_level(params_.prism);
  double top = 0.0;
  for (const Grain& g : params_.prism.grains) {
    largest_ = std::max(largest_, 2.0 * g.radius);
    top = std::max(top, g.position.z() + g.radius);
  }
  roughness_ = top - depth_;
}

terrain::BodyId ParticleGround::keep(std::shared_ptr<const wheel::Body> shape) {
  bodies_.push_back({std::move(shape), false, {}, {}});
  results_.emplace_back();
  return static_cast<terrain::BodyId>(bodies_.size()) - 1;
}

ParticleGround::Announced& ParticleGround::known(terrain::BodyId body) {
  if (body < 0 || static_cast<std::size_t>(body) >= bodies_.size()) throw InputError("a body that is not on this ground");
  return bodies_[static_cast<std::size_t>(body)];
}

void ParticleGround::begin_step(double t, double h) {
  if (in_step_) throw RunError("the step before was not ended");
  if (!std::isfinite(t) || !std::isfinite(h) || !(h > 0.0)) throw InputError("a step needs a length above 0");
  step_length_ = h;
  in_step_ = true;
  computed_ = false;
  for (Announced& b : bodies_) b.announced = false;
}

void ParticleGround::set_motion(terrain::BodyId body, const Pose& pose, const Twist& twist) {
  if (!in_step_) throw RunError("a motion outside a step");
  terrain::require_finite(pose, twist, "the particle ground");
  Announced& b = known(body);
  const bool same = b.announced && b.pose.p_W == pose.p_W && b.pose.R_WB.coeffs() == pose.R_WB.coeffs() &&
                    b.twist.v_W == twist.v_W && b.twist.w_W == twist.w_W;
  if (same) return;
  if (computed_) {
    take_back();
    computed_ = false;
  }
  b.announced = true;
  b.pose = pose;
  b.twist = twist;
}

terrain::ContactResult ParticleGround::wrench(terrain::BodyId body, const Pose& pose, const Twist& twist) {
  set_motion(body, pose, twist);
  if (!computed_) {
    advance();
    computed_ = true;
  }
  return results_[static_cast<std::size_t>(body)];
}

void ParticleGround::end_step() {
  if (!in_step_) throw RunError("no step to end");
  if (!computed_) advance();  // bodies that were announced, or none: the grains go on by themselves
  kept_chord_ = half_chord();
  in_step_ = false;
}

long ParticleGround::stretches() const { return std::max(1L, std::lround(params_.prism.width / params_.prism.length)); }

long ParticleGround::stretch_of(double x) const { return static_cast<long>(std::floor(x / stretch())); }

std::optional<ParticleGround::Range> ParticleGround::window() const {
  double from = 0.0, to = 0.0;
  bool any = false;
  for (const Announced& b : bodies_) {
    if (!b.announced) continue;
    const double x = b.pose.p_W.x();
    from = any ? std::min(from, x) : x;
    to = any ? std::max(to, x) : x;
    any = true;
  }
  if (!any) return std::nullopt;
  const double chord = half_chord();
  return Range{stretch_of(from - std::max(params_.window_behind, chord)), stretch_of(to + std::max(params_.window_ahead, chord))};
}

double ParticleGround::half_chord() const {
  double out = kept_chord_;
  for (const Announced& b : bodies_) {
    if (!b.announced) continue;
    const double radius = b.shape->outer_radius(), above = b.pose.p_W.z() - largest_;
    if (std::abs(above) < radius) out = std::max(out, above > 0.0 ? std::sqrt(radius * radius - above * above) : radius);
  }
  return out;
}

double ParticleGround::reach(const Announced& body) const { return body.shape->outer_radius() + largest_; }

Twist ParticleGround::following(const Announced& body, const Pose& at) const {
  Twist out;
  if (!body.announced) return out;
  constexpr double share = 0.2;
  out.v_W = body.twist.v_W + share / step_length_ * (body.pose.p_W - at.p_W);
  const Eigen::AngleAxisd turn(body.pose.R_WB * at.R_WB.conjugate());
  double angle = turn.angle();
  if (angle > std::numbers::pi) angle -= 2.0 * std::numbers::pi;
  out.w_W = body.twist.w_W + share / step_length_ * angle * turn.axis();
  return out;
}

void ParticleGround::answer(std::size_t k, const Wrench& mean, const Pose& at, const Twist& twist, int contacts) {
  terrain::ContactResult& r = results_[k];
  r = {};
  r.wrench = mean;
  const Announced& b = bodies_[k];
  if (!b.announced) return;
  const Vec3 lowest = at.R_WB * b.shape->support(at.R_WB.conjugate() * -Vec3::UnitZ());
  r.max_sinkage = std::max(0.0, -(at.p_W.z() + lowest.z()));
  r.contact_count = contacts;
  r.plastic_power = std::max(0.0, -(mean.F_W.dot(twist.v_W) + mean.M_W.dot(twist.w_W)));
}

}  // namespace terrode::dem
