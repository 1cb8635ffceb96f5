// Runs of a machine: what is recorded, when it counts as lost, how much more it could pull, its state.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/random.h"
#include "vehicle/vehicle.h"
#include "vehicle/vehicle_parts.h"

namespace terrode::vehicle {

using multibody::Body;
using multibody::Slider;

namespace {

constexpr double overturned_cos = 0.25;  // of the angle between the machine's up and the ground's

struct WheelChannel {
  const char* name;
  const char* unit;
  double WheelSample::*field;
};

constexpr WheelChannel wheel_channels[] = {
    {"drawbar_pull", "N", &WheelSample::drawbar_pull},
    {"driving_torque", "N m", &WheelSample::driving_torque},
    {"sinkage", "m", &WheelSample::sinkage},
    {"normal_load", "N", &WheelSample::normal_load},
    {"lateral_force", "N", &WheelSample::lateral_force},
    {"angular_velocity", "rad/s", &WheelSample::angular_velocity},
    {"forward_velocity", "m/s", &WheelSample::forward_velocity},
    {"slip", "", &WheelSample::slip},
    {"power", "W", &WheelSample::power},
    {"electric_power", "W", &WheelSample::electric_power},
    {"energy", "J", &WheelSample::energy},
    {"steering_angle", "rad", &WheelSample::steering_angle},
};

struct BodyChannel {
  const char* name;
  const char* unit;
  double (*value)(const VehicleSample&);
};

constexpr BodyChannel body_channels[] = {
    {"position_x", "m", [](const VehicleSample& s) { return s.pose.p_W.x(); }},
    {"position_y", "m", [](const VehicleSample& s) { return s.pose.p_W.y(); }},
    {"position_z", "m", [](const VehicleSample& s) { return s.pose.p_W.z(); }},
    {"heading", "rad", [](const VehicleSample& s) { return s.heading; }},
    {"pitch", "rad", [](const VehicleSample& s) { return s.pitch; }},
    {"roll", "rad", [](const VehicleSample& s) { return s.roll; }},
    {"forward_velocity", "m/s", [](const VehicleSample& s) { return s.speed; }},
    {"yaw_rate", "rad/s", [](const VehicleSample& s) { return s.twist.w_W.z(); }},
    {"travel", "m", [](const VehicleSample& s) { return s.travel; }},
    {"hitch_pull", "N", [](const VehicleSample& s) { return s.hitch_pull; }},
    {"power", "W",
     [](const VehicleSample& s) {
       double p = 0.0;
       for (const WheelSample& w : s.wheels) p += w.power;
       return p;
     }},
};

}  // namespace

std::string Vehicle::immobile_reason() const {
  const double weight = spec_.mass() * options_.gravity.norm();
  constexpr double hung = 0.1;  // of the weight: what a belly carries then counts
  for (std::size_t k = 0; k < bellies_.size(); ++k) {
    const double F = simulation_->contacts()[wheels_.size() + k].wrench.F_W.z();
    if (F > hung * weight)
      return fmt::format("its body '{}' hangs on the ground with {:.3g} % of the weight", bellies_[k], 100.0 * F / weight);
  }
  const Vec3 ahead = chassis_->pose().R_WB * Vec3::UnitX();
  constexpr double held = 0.02;  // of the weight against the motion
  for (const auto& [name, b] : bodies_) {
    const double against = -std::copysign(1.0, commanded_speed_) * b->contact_load().F_W.dot(ahead);
    const auto is_it = [&sought = name](const auto& x) { return x.name == sought; };  // clang 14 captures no bindings
    const bool own = std::any_of(spec_.bodies.begin(), spec_.bodies.end(), is_it) ||
                     std::any_of(spec_.wheels.begin(), spec_.wheels.end(), is_it);
    if (own && against > held * weight) return fmt::format("a rock holds '{}' with {:.3g} N", name, against);
  }
  int driven = 0, spinning = 0, limited = 0;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    if (spec_.wheels[i].drive.kind == DriveKind::free) continue;
    ++driven;
    if (last_.wheels[i].slip > 0.8) ++spinning;
    if (last_.wheels[i].limited && std::abs(last_.wheels[i].angular_velocity) < 0.1 * std::abs(wheels_[i].command))
      ++limited;
  }
  if (2 * limited > driven) return "its motors stall at their limit";
  if (2 * spinning > driven) return "its wheels spin: the soil's shear strength is used up";
  return "its wheels neither spin nor stall: it is held by its load or by the slope";
}

namespace {

constexpr const char* axis_names[] = {"x", "y", "z"};

struct BodyMotionChannel {
  const char* name;
  const char* unit;
};
constexpr BodyMotionChannel body_motion[] = {
    {"position_x", "m"},           {"position_y", "m"},           {"position_z", "m"},   {"quaternion_w", ""},
    {"quaternion_x", ""},          {"quaternion_y", ""},          {"quaternion_z", ""},  {"velocity_x", "m/s"},
    {"velocity_y", "m/s"},         {"velocity_z", "m/s"},         {"angular_velocity_x", "rad/s"},
    {"angular_velocity_y", "rad/s"}, {"angular_velocity_z", "rad/s"},
};
constexpr std::size_t motion_count = std::size(body_motion);

}  // namespace

void Vehicle::begin_recording(std::size_t samples) {
  run_ = {};
  run_.id = spec_.name;
  run_.time.reserve(samples);
  const auto add = [samples](recording::Run& run, const std::string& name, const char* unit) {
    run.channels.push_back({name, unit, {}});
    run.channels.back().values.reserve(samples);
  };
  for (const BodyChannel& c : body_channels) add(run_, c.name, c.unit);
  for (const VehicleWheelSpec& w : spec_.wheels)
    for (const WheelChannel& c : wheel_channels) add(run_, w.name + "_" + c.name, c.unit);
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const SensorSpec& s = spec_.sensors[i];
    const auto three = [&](const char* quantity, const char* unit) {
      for (const char* a : axis_names) add(run_, fmt::format("{}_{}_{}", s.name, quantity, a), unit);
    };
    if (s.kind == SensorKind::imu) {
      three("acceleration", "m/s^2");
      three("angular_velocity", "rad/s");
    } else if (s.kind == SensorKind::joint_load) {
      three("force", "N");
      three("moment", "N m");
    } else {
      const bool slides = dynamic_cast<const Slider*>(sensors_[i].axis) != nullptr;
      add(run_, s.name + "_position", slides ? "m" : "rad");
      add(run_, s.name + "_rate", slides ? "m/s" : "rad/s");
    }
  }
  body_runs_.clear();
  recorded_bodies_.clear();
  for (const auto& b : world_->bodies()) {
    recorded_bodies_.push_back(b.get());
    recording::Run motion;
    motion.id = b->name();
    motion.time.reserve(samples);
    for (const BodyMotionChannel& c : body_motion) add(motion, c.name, c.unit);
    body_runs_.push_back(std::move(motion));
  }
  sums_.assign(run_.channels.size() + motion_count * recorded_bodies_.size(), 0.0);
  margins_.clear();
}

// Motion of all bodies, at a step's beginning.
void Vehicle::add_motions() {
  double* at = sums_.data() + run_.channels.size();
  for (const Body* b : recorded_bodies_) {
    const Pose pose = b->pose();
    const Twist u = b->twist();
    // Of the two quaternions of a rotation the one nearest to what the sum holds.
    const Quat& q = pose.R_WB;
    const double sign = q.w() * at[3] + q.x() * at[4] + q.y() * at[5] + q.z() * at[6] < 0.0 ? -1.0 : 1.0;
    const double values[motion_count] = {pose.p_W.x(), pose.p_W.y(), pose.p_W.z(), sign * q.w(), sign * q.x(),
                                         sign * q.y(), sign * q.z(), u.v_W.x(),    u.v_W.y(),    u.v_W.z(),
                                         u.w_W.x(),    u.w_W.y(),    u.w_W.z()};
    for (std::size_t i = 0; i < motion_count; ++i) at[i] += values[i];
    at += motion_count;
  }
}

void Vehicle::add_measures() {
  std::size_t k = 0;
  for (const BodyChannel& c : body_channels) sums_[k++] += c.value(last_);
  for (const WheelSample& w : last_.wheels)
    for (const WheelChannel& c : wheel_channels) sums_[k++] += w.*c.field;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const Sensor& s = sensors_[i];
    if (spec_.sensors[i].kind == SensorKind::encoder) {
      sums_[k++] += s.motion_before.x();
      sums_[k++] += s.motion_before.y();
      continue;
    }
    for (int a = 0; a < 3; ++a) sums_[k++] += s.force[a];
    for (int a = 0; a < 3; ++a) sums_[k++] += s.moment[a];
  }
}

void Vehicle::keep_sample(double sample_time, std::size_t steps) {
  const double scale = 1.0 / static_cast<double>(steps);
  run_.time.push_back(sample_time);
  for (std::size_t k = 0; k < run_.channels.size(); ++k) run_.channels[k].values.push_back(sums_[k] * scale);
  // Errors that depend on seed, sensor and time alone, so that a resumed run has the same.
  std::size_t k = std::size(body_channels) + wheels_.size() * std::size(wheel_channels);
  const auto moment = static_cast<std::uint64_t>(std::llround(sample_time / options_.time_step * 16.0));
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const std::size_t count = spec_.sensors[i].kind == SensorKind::encoder ? 2 : 6;
    if (spec_.sensors[i].noise > 0.0) {
      Random random = Random::stream(options_.seed + 1000003 * i, moment);
      for (std::size_t c = 0; c < count; ++c) run_.channels[k + c].values.back() += spec_.sensors[i].noise * random.normal();
    }
    k += count;
  }
  const double* at = sums_.data() + run_.channels.size();
  for (recording::Run& motion : body_runs_) {
    motion.time.push_back(sample_time);
    for (std::size_t i = 0; i < motion_count; ++i) motion.channels[i].values.push_back(at[i] * scale);
    double norm = 0.0;
    for (std::size_t i = 3; i < 7; ++i) norm += motion.channels[i].values.back() * motion.channels[i].values.back();
    for (std::size_t i = 3; i < 7; ++i) motion.channels[i].values.back() /= std::sqrt(norm);
    at += motion_count;
  }
}

// What the last step covered of what it was driven to; true where the machine is immobilised.
bool Vehicle::immobilised() {
  const double h = options_.time_step;
  double reach = 0.0;  // of the wheels about the origin, which turns a yaw rate into a speed
  for (const VehicleWheelSpec& w : spec_.wheels) reach = std::max(reach, w.centre.head<2>().norm());
  window_ += h;
  if (commanded_yaw_ != 0.0) {
    commanded_ += h * reach * std::abs(commanded_yaw_);
    covered_ += h * reach * std::copysign(last_.twist.w_W.z(), last_.twist.w_W.z() * commanded_yaw_);
  } else {
    commanded_ += h * std::abs(commanded_speed_);
    covered_ += h * std::copysign(last_.speed, last_.speed * commanded_speed_);
  }
  if (window_ < options_.immobile_time) return false;
  const bool stuck = commanded_ > 0.0 && covered_ < options_.immobile_share * commanded_;
  if (stuck)
    events_.push_back(fmt::format("immobilised at t = {:.6g} s: {:.3g} m covered of {:.3g} m driven in {:.3g} s; {}",
                                  last_.time, covered_, commanded_, window_, immobile_reason()));
  window_ = commanded_ = covered_ = 0.0;
  return stuck;
}

recording::Run Vehicle::run(Controller& controller, double duration, const Progress& progress) {
  if (!(duration > 0.0) || !std::isfinite(duration))
    throw InputError(vehicle_problem("duration", fmt::format("is {:.6g} s", duration), "a finite time above 0"));
  const double h = options_.time_step;
  const auto block = static_cast<std::size_t>(std::max(1.0, std::round(options_.sample_interval / h)));
  const auto samples = static_cast<std::size_t>(std::min(duration / h / static_cast<double>(block) + 2.0, 1e6));
  if (!resumed_) begin_recording(samples);
  resumed_ = false;
  end_ = RunEnd::none;
  settle(progress);
  const auto steps = static_cast<std::size_t>(std::llround(duration / h));
  const auto margin_every = static_cast<long>(std::llround(options_.margin_interval / h));
  const double weight = spec_.mass() * options_.gravity.norm();
  for (std::size_t n = 0; n < steps && end_ == RunEnd::none;) {
    if (progress.stop_requested()) throw Interrupted(fmt::format("stopped at t = {:.6g} s", time()));
    std::fill(sums_.begin(), sums_.end(), 0.0);
    double time_sum = 0.0;
    std::size_t taken = 0;
    while (taken < block && n < steps && end_ == RunEnd::none) {
      controller.command(*this);
      if (controller.finished(*this)) {
        end_ = RunEnd::controller;
        break;
      }
      add_motions();
      try {
        step();
      } catch (const Buried& e) {
        events_.push_back(fmt::format("immobilised: {}; the soil does not carry it", e.what()));
        end_ = RunEnd::immobilised;
        break;
      }
      ++taken;
      ++n;
      time_sum += last_.time;
      add_measures();
      if ((last_.pose.R_WB * Vec3::UnitZ()).z() < overturned_cos) {
        events_.push_back(fmt::format("overturned at t = {:.6g} s", last_.time));
        end_ = RunEnd::overturned;
      } else if (immobilised()) {
        end_ = RunEnd::immobilised;
      }
      if (margin_every > 0 && std::llround(time() / h) % margin_every == 0 && commanded_speed_ != 0.0) {
        MarginSample m;
        m.time = time();
        m.travel = travel_;
        const double largest = options_.margin_largest > 0.0 ? options_.margin_largest : weight;
        bool whole = false;
        m.pull = remaining_pull(options_.margin_rate > 0.0 ? options_.margin_rate : 0.1 * weight, largest, &whole);
        m.at_least = whole;
        margins_.push_back(m);
      }
    }
    if (taken == 0) break;
    for (std::size_t k = 0; k < sums_.size(); ++k)
      if (!std::isfinite(sums_[k]))
        throw RunError(fmt::format("machine '{}' at t = {:.6g} s: {} is not finite: try a smaller time step, then check masses and soil",
                                   spec_.name, last_.time, run_.channels[k].name));
    keep_sample(time_sum / static_cast<double>(taken), taken);
    if (observer_) observer_(*this);
    progress.report(static_cast<double>(n) / static_cast<double>(steps), spec_.name);
  }
  if (end_ == RunEnd::none) end_ = RunEnd::duration;
  return run_;
}

double Vehicle::remaining_pull(double rate, double largest, bool* held) {
  Problems p;
  require(p, "remaining_pull.rate", rate, "N/s", rate > 0.0, "above 0");
  require(p, "remaining_pull.largest", largest, "N", largest > 0.0, "above 0");
  throw_if_any(p);
  settle();
  const VehicleState before = snapshot();
  const double pull_before = hitch_pull_, h = options_.time_step;
  // What the wheels gave over a quarter second is the pull plus mass times acceleration: the machine's own inertia
  // still holds some pull after its wheels no longer do.
  const auto window = static_cast<std::size_t>(std::max(1.0, std::round(0.25 / h)));
  const double seconds = static_cast<double>(window) * h, mass = spec_.mass();
  double found = 0.0;
  try {
    while (hitch_pull_ - pull_before < largest) {
      const Vec3 from = chassis_->pose().p_W, v0 = chassis_->twist().v_W;
      const Vec3 heading = chassis_->pose().R_WB * Vec3::UnitX();
      double pull = 0.0;
      for (std::size_t k = 0; k < window; ++k) {
        hitch_pull_ += rate * h;
        step();
        pull += (hitch_pull_ - pull_before) / static_cast<double>(window);
      }
      found = std::max(found, pull + mass * (chassis_->twist().v_W - v0).dot(heading) / seconds);
      if ((chassis_->pose().p_W - from).dot(heading) < 0.05 * commanded_speed_ * seconds) break;
    }
  } catch (const RunError&) {
    // It dug itself in: what it held until then counts.
  }
  if (held != nullptr) *held = found >= largest || hitch_pull_ - pull_before >= largest;
  found = std::min(found, largest);
  restore(before);
  return found;
}

namespace {

// Every number of a sample, in one order for saving and restoring: controllers read them at the next step.
template <class Sample, class Take>
void numbers_of(Sample& s, Take take) {
  take(s.time);
  for (int i = 0; i < 3; ++i) take(s.pose.p_W[i]);
  for (int i = 0; i < 4; ++i) take(s.pose.R_WB.coeffs()[i]);
  for (int i = 0; i < 3; ++i) take(s.twist.v_W[i]);
  for (int i = 0; i < 3; ++i) take(s.twist.w_W[i]);
  for (auto* v : {&s.heading, &s.pitch, &s.roll, &s.speed, &s.travel, &s.hitch_pull}) take(*v);
  for (auto& w : s.wheels) {
    for (const WheelChannel& c : wheel_channels) take(w.*c.field);
    if constexpr (std::is_const_v<Sample>) {
      take(w.limited ? 1.0 : 0.0);
    } else {
      double limited = 0.0;
      take(limited);
      w.limited = limited != 0.0;
    }
  }
}

constexpr std::size_t state_numbers = 14;

}  // namespace

VehicleState Vehicle::snapshot(const Controller* controller) const {
  VehicleState s;
  s.simulation = simulation_->snapshot();
  s.numbers = {settled_ ? 1.0 : 0.0, zero_time_, travel_, commanded_speed_, commanded_yaw_, hitch_pull_, drive_work_,
               gravity_work_, hitch_work_, spring_work_, start_kinetic_, window_, commanded_, covered_};
  for (const WheelParts& w : wheels_) s.numbers.insert(s.numbers.end(), {w.command, w.target_angle, w.energy});
  numbers_of(last_, [&](const double v) { s.numbers.push_back(v); });
  if (controller != nullptr) s.controller = controller->state();
  return s;
}

recording::Checkpoint Vehicle::checkpoint(const Controller& controller) const {
  recording::Checkpoint c;
  const VehicleState state = snapshot(&controller);
  c.numbers["world"] = state.simulation.world;
  c.numbers["contacts"] = state.simulation.contacts;
  c.numbers["vehicle"] = state.numbers;
  c.numbers["controller"] = state.controller;
  c.bytes["ground"] = state.simulation.ground;
  c.put_samples(run_);
  std::vector<double>& bodies = c.numbers["bodies"];
  for (const recording::Run& motion : body_runs_)
    for (const recording::Channel& channel : motion.channels)
      bodies.insert(bodies.end(), channel.values.begin(), channel.values.end());
  std::vector<double>& margins = c.numbers["margins"];
  for (const MarginSample& m : margins_) margins.insert(margins.end(), {m.time, m.travel, m.pull, m.at_least ? 1.0 : 0.0});
  return c;
}

void Vehicle::resume(const recording::Checkpoint& c, Controller& controller) {
  begin_recording(0);
  c.take_samples(run_);
  const std::vector<double>&bodies = c.number("bodies"), &margins = c.number("margins");
  if (bodies.size() != body_runs_.size() * motion_count * run_.time.size() || margins.size() % 4 != 0)
    throw InputError(vehicle_problem("checkpoint", "is of another machine", "one of " + spec_.name));
  const double* at = bodies.data();
  for (recording::Run& motion : body_runs_) {
    motion.time = run_.time;
    for (recording::Channel& channel : motion.channels) {
      channel.values.assign(at, at + run_.time.size());
      at += run_.time.size();
    }
  }
  for (std::size_t i = 0; i + 3 < margins.size(); i += 4)
    margins_.push_back({margins[i], margins[i + 1], margins[i + 2], margins[i + 3] != 0.0});
  restore({{c.number("world"), c.byte("ground"), c.number("contacts")}, c.number("vehicle"), c.number("controller")},
          &controller);
  resumed_ = true;
}

void Vehicle::restore(const VehicleState& state, Controller* controller) {
  std::size_t count = state_numbers + 3 * wheels_.size();
  numbers_of(std::as_const(last_), [&](const double) { ++count; });
  if (state.numbers.size() != count)
    throw InputError(vehicle_problem("snapshot", "is of another machine", "one of " + spec_.name));
  simulation_->restore(state.simulation);
  const double* s = state.numbers.data();
  settled_ = *s++ != 0.0;
  for (double* v : {&zero_time_, &travel_, &commanded_speed_, &commanded_yaw_, &hitch_pull_, &drive_work_,
                    &gravity_work_, &hitch_work_, &spring_work_, &start_kinetic_, &window_, &commanded_, &covered_})
    *v = *s++;
  for (WheelParts& w : wheels_) {
    w.command = *s++;
    w.target_angle = *s++;
    w.energy = *s++;
  }
  numbers_of(last_, [&](double& v) { v = *s++; });
  if (controller != nullptr) controller->set_state(state.controller);
}

}  // namespace terrode::vehicle
