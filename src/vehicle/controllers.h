// Ways to drive a machine: a script of manoeuvres, a path of waypoints, a function of one's own.
#pragma once

#include "vehicle/vehicle.h"

namespace terrode::vehicle {

// One stretch of a script. It ends after `duration` or `distance` (path of the machine's origin), whichever is given
// and first reached; the values it names are reached over `ramp` seconds from those in force, along 3 u^2 - 2 u^3.
struct Manoeuvre {
  std::optional<double> duration;  // s
  std::optional<double> distance;  // m
  double ramp = 0.5;               // s
  double speed = 0.0;              // m/s of the origin
  double curvature = 0.0;          // 1/m, left positive
  double yaw_rate = 0.0;           // rad/s; not 0: turn in place, speed and curvature must be 0
  double hitch_pull = 0.0;         // N
  double torque = 0.0;             // N m, the command of torque drives
  Problems validate(const std::string& key) const;
};

// Manoeuvres one after the other; finished after the last.
class Script final : public Controller {
 public:
  // Throws InputError with every problem.
  explicit Script(std::vector<Manoeuvre> manoeuvres);
  void command(Vehicle& vehicle) override;
  bool finished(const Vehicle&) const override { return index_ >= manoeuvres_.size(); }
  std::vector<double> state() const override;
  void set_state(const std::vector<double>& state) override;

 private:
  std::vector<Manoeuvre> manoeuvres_;
  std::size_t index_ = 0;
  bool started_ = false;
  double begin_time_ = 0.0, begin_travel_ = 0.0;
  // In force when the manoeuvre began, and now.
  double from_[5] = {0, 0, 0, 0, 0}, now_[5] = {0, 0, 0, 0, 0};
};

// Pure pursuit (Coulter 1992): steers along the arc through the point `lookahead` ahead on the path,
// curvature = 2 y/d^2 with y its offset to the left and d its distance; finished within `tolerance` of the last point.
class PathFollower final : public Controller {
 public:
  struct Options {
    double speed = 0.05;             // m/s
    double lookahead = 0.5;          // m
    double largest_curvature = 2.0;  // 1/m
    double tolerance = 0.1;          // m
    double ramp = 1.0;               // s in which the speed rises
    Problems validate() const;
  };
  PathFollower(std::vector<Eigen::Vector2d> waypoints, const Options& options);
  void command(Vehicle& vehicle) override;
  bool finished(const Vehicle&) const override { return done_; }
  std::vector<double> state() const override { return {static_cast<double>(next_), done_ ? 1.0 : 0.0, begin_time_}; }
  void set_state(const std::vector<double>& state) override;

 private:
  std::vector<Eigen::Vector2d> waypoints_;
  Options options_;
  std::size_t next_ = 0;
  bool done_ = false;
  double begin_time_ = -1.0;
};

// Calls a function of one's own at the beginning of each step.
class FunctionController final : public Controller {
 public:
  explicit FunctionController(std::function<void(Vehicle&)> function) : function_(std::move(function)) {}
  void command(Vehicle& vehicle) override { function_(vehicle); }

 private:
  std::function<void(Vehicle&)> function_;
};

}  // namespace terrode::vehicle
