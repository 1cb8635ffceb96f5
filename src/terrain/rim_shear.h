// Shear displacement that travels with a rim: markers on the rim's circle, each summing how far its material has moved
// along the ground since it came into contact. Along a wheel that rolls at constant speed this is
//   j(theta) = r [(theta_f - theta) - (1 - s)(sin theta_f - sin theta)]        (Smith et al. Eq. 11, s >= 0)
// and across, at slip angle beta, r (1 - s)(theta_f - theta) tan(beta).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "bekker/contact_arc.h"

namespace terrode::terrain {

// Displacement of the rim's surface along the ground [m]: `along` positive where driving (the surface moves back),
// `across` positive towards the axle's direction.
struct ShearPath {
  double along = 0.0, across = 0.0;
};

// Shear displacement j carried on by a step d. Onwards it adds up. Backwards (j . d < 0) the stress lets go at once and
// turns, as soil does: with e = 1 - exp(-|j|/K) along j and the memory length K [m],
//   de = (d/|d| - e) |d|/K,    j = -K ln(1 - |e|) along e,
// which along a straight path onwards is the sum, and on a path there and back takes work.
inline ShearPath carried_on(const ShearPath& j, const ShearPath& d, double memory) {
  if (j.along * d.along + j.across * d.across >= 0) return {j.along + d.along, j.across + d.across};
  const double length = std::sqrt(j.along * j.along + j.across * j.across);
  const double step = std::sqrt(d.along * d.along + d.across * d.across);
  const double share = (1.0 - std::exp(-length / memory)) / length, left = std::exp(-step / memory);
  const double along = d.along / step + (share * j.along - d.along / step) * left;
  const double across = d.across / step + (share * j.across - d.across / step) * left;
  const double e = std::sqrt(along * along + across * across);
  if (e <= 0) return {};
  const double longer = -memory * std::log1p(-std::min(e, 1.0 - 1e-15)) / e;
  return {longer * along, longer * across};
}

// How the rim moved between two poses, in the frame (travel, axle, up) of the later one.
struct RimMotion {
  double spin = 0.0;           // turn about the axle [rad]
  double go = 0.0, sway = 0.0, up = 0.0;  // of the centre [m]
  double yaw = 0.0;            // turn of the heading towards the axle's direction [rad]
  double roll = 0.0;           // rise of the axle's end [rad]
  double radius = 0.0;         // [m]
  double stretch = 1.0;        // radius of the arc in contact over the rim's: material passes a flattened arc's angles faster
  bool known = false;          // false for the first pose: nothing has moved
};

class RimShear {
 public:
  // Half a degree apart: linear interpolation between two markers is off by less than a thousandth of a typical K.
  static constexpr int kMarkers = 720;
  static constexpr double kStep = 2 * std::numbers::pi / kMarkers;

  explicit RimShear(int strips = 0);

  // Puts into `trial` the displacements of `kept` carried on by a motion. `facing` is +1 or -1: travel along or against
  // the heading that marker angles refer to; `angle` the spin angle of the body in that heading. `memory` is the
  // length of carried_on() [m].
  // `entry_before` is the entry angle of each strip at the earlier pose.
  static void advance(const RimShear& kept, RimShear& trial, std::span<const bekker::ContactArc> arcs,
                      std::span<const double> entry_before, std::span<const double> offsets, bool uniform, const RimMotion& motion, double facing, double angle,
                      double memory);

  // At angle theta of the contact within a strip.
  ShearPath at(double theta, std::size_t strip, const bekker::ContactArc& arc) const {
    const double place = (facing_ * stretch_ * theta + angle_) * (1.0 / kStep);
    const double floor = std::floor(place);
    const int m = static_cast<int>(floor);
    const std::size_t k = uniform_ ? 0 : strip;
    const Mark &a = mark(m, k), &b = mark(m + 1, k);
    double along, across;
    if (a.active == b.active) {
      const double w = place - floor;
      along = (1 - w) * a.along + w * b.along;
      across = (1 - w) * a.across + w * b.across;
    } else {
      // One neighbour lies outside the contact. At the front, displacement starts at 0 on theta_f.
      const Mark& in = a.active ? a : b;
      const double theta_in = facing_ * ((a.active ? m : m + 1) * kStep - angle_) / stretch_;
      const double w = theta_in < theta ? (arc.theta_f - theta) / (arc.theta_f - theta_in) : 1.0;
      along = w * in.along;
      across = w * in.across;
    }
    return {facing_ * along, facing_ * across};
  }

  bool uniform() const { return uniform_; }
  void clear();

  // All numbers, for snapshots.
  template <class Writer>
  void write(Writer& out) const {
    out.put(from_);
    out.put(to_);
    out.put(static_cast<std::uint8_t>(uniform_));
    out.put(facing_);
    out.put(angle_);
    out.put(stretch_);
    for (int m = from_; m < to_; ++m)
      for (std::size_t k = 0; k < (uniform_ ? 1 : strips_); ++k) {
        const Mark& x = marks_[row(m) + k];
        out.put(x.along);
        out.put(x.across);
        out.put(static_cast<std::uint8_t>(x.active));
      }
  }
  // False where the bytes make no sense.
  template <class Reader>
  bool read(Reader& in) {
    from_ = in.template get<int>();
    to_ = in.template get<int>();
    uniform_ = in.template get<std::uint8_t>() != 0;
    facing_ = in.template get<double>();
    angle_ = in.template get<double>();
    stretch_ = in.template get<double>();
    if (to_ < from_ || to_ - from_ > kMarkers) return false;
    first_ = turn(from_);
    for (int m = from_; m < to_; ++m)
      for (std::size_t k = 0; k < (uniform_ ? 1 : strips_); ++k) {
        Mark& x = marks_[row(m) + k];
        x.along = in.template get<double>();
        x.across = in.template get<double>();
        x.active = in.template get<std::uint8_t>() != 0;
      }
    return true;
  }

 private:
  struct Mark {
    double along = 0.0, across = 0.0;
    bool active = false;
  };
  static int turn(int m) { return ((m % kMarkers) + kMarkers) % kMarkers; }
  // Of a marker in [from, to); without a division, since every point asks.
  std::size_t row(int m) const {
    const int place = first_ + (m - from_);
    return static_cast<std::size_t>(place >= kMarkers ? place - kMarkers : place) * strips_;
  }
  bool holds(int m) const { return turn(m - from_) < to_ - from_; }
  const Mark& mark(int m, std::size_t k) const {
    static const Mark none{};
    return m >= from_ && m < to_ ? marks_[row(m) + k] : none;
  }

  std::size_t strips_ = 0;
  std::vector<Mark> marks_;  // [marker][strip]
  int from_ = 0, to_ = 0;    // markers that count: [from, to)
  int first_ = 0;            // from_ within a turn
  bool uniform_ = true;      // all strips are alike: the first stands for all
  double facing_ = 1.0, angle_ = 0.0, stretch_ = 1.0;
};

}  // namespace terrode::terrain
