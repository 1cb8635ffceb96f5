#include "terrain/rim_shear.h"

#include <algorithm>

namespace terrode::terrain {

RimShear::RimShear(int strips) : strips_(static_cast<std::size_t>(strips)), marks_(strips_ * kMarkers) {}

void RimShear::clear() {
  from_ = to_ = first_ = 0;
  uniform_ = true;
}

void RimShear::advance(const RimShear& kept, RimShear& trial, std::span<const bekker::ContactArc> arcs,
                       std::span<const double> entry_before, std::span<const double> offsets, bool uniform, const RimMotion& motion, double facing, double angle,
                       double memory) {
  static const Mark none{};
  trial.facing_ = facing;
  trial.angle_ = angle;
  trial.stretch_ = motion.stretch;
  trial.uniform_ = uniform && kept.uniform_ && motion.yaw == 0 && motion.roll == 0;
  double front = 0.0, back = 1e300;
  for (const auto& arc : arcs) {
    front = std::max(front, arc.theta_f);
    back = std::min(back, arc.theta_r);
  }
  const double lo = motion.stretch * (facing > 0 ? back : -front), hi = motion.stretch * (facing > 0 ? front : -back);
  trial.from_ = static_cast<int>(std::floor((lo + angle) / kStep)) - 1;
  trial.to_ = static_cast<int>(std::ceil((hi + angle) / kStep)) + 2;
  trial.first_ = turn(trial.from_);
  const std::size_t strips = trial.uniform_ ? 1 : trial.strips_;
  for (int m = trial.from_; m < trial.to_; ++m) {
    const double theta = facing * (m * kStep - angle) / motion.stretch, before = theta + motion.spin / motion.stretch;
    const double mid = 0.5 * (theta + before), c = std::cos(mid), s = std::sin(mid);
    const double along0 = motion.radius * motion.spin - (motion.go * c + motion.up * s);
    const double across = motion.sway + motion.radius * s * motion.yaw;
    const bool known = kept.holds(m);
    const std::size_t at = trial.row(m);
    for (std::size_t k = 0; k < strips; ++k) {
      const bekker::ContactArc& arc = arcs[k];
      Mark& now = trial.marks_[at + k];
      // One marker behind the exit stays, for interpolation up to it.
      const double rear = arc.theta_r - kStep / motion.stretch;
      if (theta >= arc.theta_f || theta < rear) {
        now = none;
        continue;
      }
      const Mark& old = known ? kept.marks_[at + (kept.uniform_ ? 0 : k)] : none;
      const double y = facing * offsets[k];  // offsets run along the body's axle
      const double a = facing * (along0 + y * (motion.yaw * c - motion.roll * s)), b = facing * across;
      if (!old.active) {
        double share = motion.known ? 1.0 : 0.0;  // of the motion that was made in contact
        const double outside = before - entry_before[k], inside = arc.theta_f - theta;
        if (outside > 0 && theta > 0) share = inside / (outside + inside);
        else if (before < rear && motion.spin < 0) share = (rear - theta) * motion.stretch / motion.spin;
        now.along = share * a;
        now.across = share * b;
      } else {
        const ShearPath carried = carried_on({old.along, old.across}, {a, b}, memory);
        now.along = carried.along;
        now.across = carried.across;
      }
      now.active = true;
    }
  }
}

}  // namespace terrode::terrain
