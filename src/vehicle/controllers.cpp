#include "vehicle/controllers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace terrode::vehicle {

Problems Manoeuvre::validate(const std::string& key) const {
  Problems p;
  if (!duration && !distance) p.push_back({{}, 0, 0, key, "never ends", "a duration or a distance"});
  if (duration) require(p, key + ".duration", *duration, "s", *duration > 0.0, "above 0");
  if (distance) require(p, key + ".distance", *distance, "m", *distance > 0.0, "above 0");
  require(p, key + ".ramp", ramp, "s", ramp >= 0.0, "0 or more");
  require(p, key + ".speed", speed, "m/s", true, "a finite speed");
  require(p, key + ".curvature", curvature, "1/m", true, "a finite curvature");
  require(p, key + ".yaw_rate", yaw_rate, "rad/s", yaw_rate == 0.0 || (speed == 0.0 && curvature == 0.0),
          "0 where there is a speed or curvature");
  require(p, key + ".hitch_pull", hitch_pull, "N", true, "a finite force");
  require(p, key + ".torque", torque, "N m", true, "a finite torque");
  return p;
}

Script::Script(std::vector<Manoeuvre> manoeuvres) : manoeuvres_(std::move(manoeuvres)) {
  Problems p;
  if (manoeuvres_.empty()) p.push_back({{}, 0, 0, "script", "is empty", "at least one manoeuvre"});
  for (std::size_t i = 0; i < manoeuvres_.size(); ++i)
    for (const Problem& q : manoeuvres_[i].validate(fmt::format("script[{}]", i))) p.push_back(q);
  throw_if_any(p);
}

void Script::command(Vehicle& vehicle) {
  const double t = vehicle.time(), travel = vehicle.last().travel;
  if (!started_) {
    started_ = true;
    begin_time_ = t;
    begin_travel_ = travel;
  }
  while (index_ < manoeuvres_.size()) {
    const Manoeuvre& m = manoeuvres_[index_];
    const bool over =
        (m.duration && t - begin_time_ >= *m.duration - 1e-9) || (m.distance && travel - begin_travel_ >= *m.distance);
    if (!over) break;
    ++index_;
    begin_time_ = t;
    begin_travel_ = travel;
    std::copy(std::begin(now_), std::end(now_), std::begin(from_));
  }
  if (index_ >= manoeuvres_.size()) return;
  const Manoeuvre& m = manoeuvres_[index_];
  const double u = m.ramp > 0.0 ? std::min(1.0, (t - begin_time_) / m.ramp) : 1.0;
  const double share = u * u * (3.0 - 2.0 * u);
  const double to[5] = {m.speed, m.curvature, m.yaw_rate, m.hitch_pull, m.torque};
  for (int i = 0; i < 5; ++i) now_[i] = from_[i] + share * (to[i] - from_[i]);
  // Between turning in place and driving both are small for a while; the larger one rules.
  if (std::abs(now_[2]) > 0.0 && std::abs(now_[0]) <= std::abs(now_[2]))
    vehicle.turn_in_place(now_[2]);
  else
    vehicle.drive_path(now_[0], now_[1]);
  vehicle.set_hitch_pull(now_[3]);
  for (std::size_t i = 0; i < vehicle.spec().wheels.size(); ++i)
    if (vehicle.spec().wheels[i].drive.kind == DriveKind::torque) vehicle.drive(i, now_[4]);
}

std::vector<double> Script::state() const {
  std::vector<double> s = {static_cast<double>(index_), started_ ? 1.0 : 0.0, begin_time_, begin_travel_};
  s.insert(s.end(), std::begin(from_), std::end(from_));
  s.insert(s.end(), std::begin(now_), std::end(now_));
  return s;
}

void Script::set_state(const std::vector<double>& s) {
  if (s.size() != 14 || !(s[0] >= 0.0 && s[0] <= static_cast<double>(manoeuvres_.size()))) throw InputError(Problem{{}, 0, 0, "snapshot", "is not of a script", {}});
  index_ = static_cast<std::size_t>(s[0]);
  started_ = s[1] != 0.0;
  begin_time_ = s[2];
  begin_travel_ = s[3];
  std::copy(s.begin() + 4, s.begin() + 9, std::begin(from_));
  std::copy(s.begin() + 9, s.end(), std::begin(now_));
}

Problems PathFollower::Options::validate() const {
  Problems p;
  require(p, "path.speed", speed, "m/s", speed > 0.0, "above 0");
  require(p, "path.lookahead", lookahead, "m", lookahead > 0.0, "above 0");
  require(p, "path.largest_curvature", largest_curvature, "1/m", largest_curvature > 0.0, "above 0");
  require(p, "path.tolerance", tolerance, "m", tolerance > 0.0, "above 0");
  require(p, "path.ramp", ramp, "s", ramp >= 0.0, "0 or more");
  return p;
}

PathFollower::PathFollower(std::vector<Eigen::Vector2d> waypoints, const Options& options)
    : waypoints_(std::move(waypoints)), options_(options) {
  Problems p = options.validate();
  if (waypoints_.empty()) p.push_back({{}, 0, 0, "path.waypoints", "is empty", "at least one point"});
  for (const auto& w : waypoints_)
    if (!w.allFinite()) p.push_back({{}, 0, 0, "path.waypoints", "has a point that is not finite", "finite numbers"});
  throw_if_any(p);
}

void PathFollower::command(Vehicle& vehicle) {
  if (begin_time_ < 0.0) begin_time_ = vehicle.time();
  const Eigen::Vector2d at = vehicle.last().pose.p_W.head<2>();
  while (next_ + 1 < waypoints_.size() && (waypoints_[next_] - at).norm() < options_.lookahead) ++next_;
  if (next_ + 1 == waypoints_.size() && (waypoints_[next_] - at).norm() < options_.tolerance) done_ = true;
  if (done_) {
    vehicle.drive_path(0.0, 0.0);
    return;
  }
  // The point `lookahead` ahead on the leg from the last waypoint to the next, where the leg is near; else its end.
  Eigen::Vector2d target = waypoints_[next_];
  if (next_ > 0) {
    const Eigen::Vector2d a = waypoints_[next_ - 1], leg = waypoints_[next_] - a;
    const double length = leg.norm();
    if (length > 0.0) {
      const double along = std::clamp((at - a).dot(leg) / length + options_.lookahead, 0.0, length);
      target = a + leg * (along / length);
    }
  }
  const double heading = vehicle.last().heading;
  const Eigen::Vector2d d = target - at;
  const double left = -std::sin(heading) * d.x() + std::cos(heading) * d.y();
  const double curvature = std::clamp(2.0 * left / std::max(d.squaredNorm(), 1e-12), -options_.largest_curvature,
                                      options_.largest_curvature);
  const double u = options_.ramp > 0.0 ? std::min(1.0, (vehicle.time() - begin_time_) / options_.ramp) : 1.0;
  vehicle.drive_path(options_.speed * u * u * (3.0 - 2.0 * u), curvature);
}

void PathFollower::set_state(const std::vector<double>& s) {
  if (s.size() != 3 || !(s[0] >= 0.0 && s[0] < static_cast<double>(waypoints_.size()))) throw InputError(Problem{{}, 0, 0, "snapshot", "is not of a path follower", {}});
  next_ = static_cast<std::size_t>(s[0]);
  done_ = s[1] != 0.0;
  begin_time_ = s[2];
}

}  // namespace terrode::vehicle
