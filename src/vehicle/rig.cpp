#include "vehicle/rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "vehicle/ramp.h"

namespace terrode::vehicle {

using multibody::Body;
using multibody::Hinge;
using multibody::MassProperties;
using multibody::Slider;

namespace {

constexpr double rim_over_carriage = 5.0;  // longest rim travel in carriage distances
// A wheel let go on grains rests when it has moved slower than this [m/s] for this long [s], or after the longest time.
constexpr double rest_speed = 5e-3, rest_time = 0.02, longest_rest = 0.5;

double lifted_mass(const RigSpec& s) {
  return s.lifted_mass ? *s.lifted_mass : std::max(s.normal_load / s.gravity, 1.1 * s.wheel_mass);
}

bool pulled(RigMode m) { return m == RigMode::force_controlled || m == RigMode::pull_ramp; }

}  // namespace

// Less is carried by no wheel that a rig could hold, and its weight would be too light a body for ODE.
constexpr double kSmallestLoad = 1e-6;  // N

Problems RigSpec::validate() const {
  Problems p;
  require(p, "rig.wheel_mass", wheel_mass, "kg", wheel_mass >= multibody::kLightest, "a mass of 1e-9 kg or more");
  require(p, "rig.normal_load", normal_load, "N", normal_load >= kSmallestLoad, "a load of 1e-6 N or more");
  if (lifted_mass)
    require(p, "rig.lifted_mass", *lifted_mass, "kg", *lifted_mass > wheel_mass, "more than the wheel's mass");
  require(p, "rig.carriage_mass", carriage_mass, "kg", carriage_mass > 0.0, "a mass above 0");
  require(p, "rig.gravity", gravity, "m/s^2", gravity > 0.0 && gravity <= multibody::kStrongestGravity, "an acceleration above 0, at most 1e5 m/s^2");
  require(p, "rig.slope", slope, "rad", std::abs(slope) < 1.2, "an angle within 1.2 rad");
  require(p, "rig.time_step", time_step, "s", time_step >= multibody::kShortestStep && time_step <= 0.1, "a time from 1e-9 to 0.1 s");
  require(p, "rig.sample_interval", sample_interval, "s", sample_interval >= 0.0, "a time, 0 or more");
  require(p, "rig.ramp_time", ramp_time, "s", ramp_time >= 0.0, "a time, 0 or more");
  require(p, "rig.lowering_speed", lowering_speed, "m/s", lowering_speed > 0.0, "a speed above 0");
  require(p, "rig.touchdown_tolerance", touchdown_tolerance, "-",
          touchdown_tolerance > 0.0 && touchdown_tolerance < 1.0, "a share between 0 and 1");
  require(p, "rig.touchdown_time", touchdown_time, "s", touchdown_time > 0.0, "a time above 0");
  require(p, "rig.bearing_torque", bearing_torque, "N m", bearing_torque >= 0.0, "a torque, 0 or more");
  require(p, "rig.start_x", start_x, "m", true, "a finite position");
  require(p, "rig.start_y", start_y, "m", true, "a finite position");
  return p;
}

Problems RigMotion::validate() const {
  Problems p;
  const bool locked = angular_velocity == 0.0;
  require(p, "motion.angular_velocity", angular_velocity, "rad/s", mode == RigMode::towed || angular_velocity >= 0.0,
          "0 (a locked wheel) or more");
  if (mode == RigMode::imposed_slip && !locked)
    require(p, "motion.slip", slip, "-", slip <= 1.0, "at most 1 (s = 1 - v/(omega r))");
  if (mode == RigMode::towed || (mode == RigMode::imposed_slip && locked)) {
    if (!forward_velocity)
      p.push_back(
          {{}, 0, 0, "motion.forward_velocity", "is missing", "the speed at which the wheel is towed or dragged"});
    else
      require(p, "motion.forward_velocity", *forward_velocity, "m/s", *forward_velocity > 0.0, "a speed above 0");
  }
  if (pulled(mode)) {
    require(p, "motion.pull", pull, "N", true, "a finite force");
    if (locked)
      p.push_back({{}, 0, 0, "motion.angular_velocity", "is 0 rad/s", "a turning wheel where it has to pull"});
    require(p, "motion.slip_limit", slip_limit, "-", slip_limit > 0.0, "a slip above 0");
  }
  if (mode == RigMode::pull_ramp)
    require(p, "motion.final_pull", final_pull, "N", final_pull != pull, "a force other than the first");
  require(p, "motion.distance", distance, "m", distance > 0.0, "a distance above 0");
  if (duration) require(p, "motion.duration", *duration, "s", *duration > 0.0, "a time above 0");
  return p;
}

struct Rig::Parts {
  multibody::World world;
  Body& carriage;
  Body& hub;
  Body& wheel;
  Slider& rail;
  Slider& lift;
  Hinge& axle;
  double load_force;  // N on the hub beside its weight, positive up

  Parts(const RigSpec& s, const wheel::Rolling& rim, double start_height)
      : world({s.gravity * Vec3(-std::sin(s.slope), 0.0, -std::cos(s.slope)), multibody::WorldOptions{}.cfm, 0.2}),
        carriage(world.add_body("carriage", MassProperties::box(s.carriage_mass, Vec3(0.3, 0.3, 0.3)),
                                {Vec3(s.start_x, s.start_y, start_height), Quat::Identity()})),
        hub(world.add_body("hub", MassProperties::box(lifted_mass(s) - s.wheel_mass, Vec3(0.1, 0.1, 0.1)),
                           carriage.pose())),
        wheel(world.add_body("wheel", MassProperties::cylinder(s.wheel_mass, rim.radius, rim.width), carriage.pose())),
        rail(world.add_slider("rail", carriage, nullptr, Vec3::UnitX())),
        lift(world.add_slider("lift", hub, &carriage, Vec3::UnitZ())),
        axle(world.add_hinge("axle", wheel, &hub, carriage.pose().p_W, Vec3::UnitY())),
        load_force(lifted_mass(s) * s.gravity * std::cos(s.slope) - s.normal_load) {}

  double momentum_x() const {
    return carriage.mass() * carriage.twist().v_W.x() + hub.mass() * hub.twist().v_W.x() +
           wheel.mass() * wheel.twist().v_W.x();
  }
  double mass() const { return carriage.mass() + hub.mass() + wheel.mass(); }
  double axle_inertia() const { return wheel.mass_properties().inertia_B(1, 1); }
  double kinetic() const { return carriage.kinetic_energy() + hub.kinetic_energy() + wheel.kinetic_energy(); }
};

Rig::Rig(const RigSpec& spec, const RigMotion& motion, std::shared_ptr<const wheel::Body> shape,
         std::unique_ptr<terrain::Terrain> ground)
    : spec_(spec), motion_(motion), ground_(std::move(ground)) {
  Problems p = spec.validate();
  const Problems more = motion.validate();
  p.insert(p.end(), more.begin(), more.end());
  if (ground_ == nullptr) p.push_back({{}, 0, 0, "rig.ground", "is missing", "a ground under the wheel"});
  const wheel::Rolling* rim = shape != nullptr ? shape->rolling() : nullptr;
  if (rim == nullptr) p.push_back({{}, 0, 0, "rig.wheel", "does not roll", "a wheel with a rim"});
  throw_if_any(p);
  radius_ = rim->radius;
  commanded_slip_ = condition_of(spec, motion).slip;
  const double height = ground_->undisturbed_height(spec.start_x, spec.start_y) + shape->bounding_radius();
  parts_ = std::make_unique<Parts>(spec, *rim, height);
  simulation_ = std::make_unique<Simulation>(parts_->world, *ground_);
  simulation_->add(parts_->wheel, std::move(shape));

  const double rim_speed = std::abs(motion.angular_velocity) * radius_;
  const double speed = pulled(motion.mode) ? rim_speed : std::abs(target_speed());
  const double pace = motion.mode == RigMode::towed ? speed : std::max(speed, rim_speed / rim_over_carriage);
  planned_ = spec.ramp_time + (motion.duration ? *motion.duration : motion.distance / pace);
}

Rig::~Rig() = default;

double Rig::target_speed() const {
  if (motion_.mode == RigMode::towed || motion_.angular_velocity == 0.0) return motion_.forward_velocity.value_or(0.0);
  return motion_.angular_velocity * radius_ * (1.0 - motion_.slip);
}

double Rig::ramp(double t) const { return spec_.ramp_time > 0.0 ? smooth_step(t / spec_.ramp_time) : 1.0; }

// Servo targets and applied pull for the step that ends at t1 after time zero.
void Rig::drive(double t1) {
  Parts& r = *parts_;
  const double share = ramp(t1);
  if (motion_.mode == RigMode::towed) {
    if (spec_.bearing_torque > 0.0)
      r.axle.set_motor({0.0, spec_.bearing_torque, true});
    else
      r.axle.clear_motor();
  } else {
    r.axle.set_motor({share * motion_.angular_velocity});
  }
  if (!pulled(motion_.mode)) {
    r.rail.set_motor({share * target_speed()});
    return;
  }
  r.rail.clear_motor();
  applied_pull_ = share * motion_.pull;
  if (motion_.mode == RigMode::pull_ramp && t1 > spec_.ramp_time)
    applied_pull_ += (motion_.final_pull - motion_.pull) * (t1 - spec_.ramp_time) / (planned_ - spec_.ramp_time);
}

void Rig::check_buried(const char* phase) const {
  const Vec3 p = parts_->wheel.pose().p_W;
  const double sinkage = ground_->undisturbed_height(p.x(), p.y()) - (p.z() - radius_);
  if (sinkage >= radius_)
    throw RunError(
        fmt::format("{} at t = {:.6g} s: the wheel is buried to its axle (sinkage {:.4g} m, radius {:.4g} m); "
                    "the soil does not carry {:.6g} N",
                    phase, parts_->world.time(), sinkage, radius_, spec_.normal_load));
}

// One step with the joints as they are driven now; fills last_.
void Rig::advance(const char* phase) {
  Parts& r = *parts_;
  const double h = spec_.time_step;
  const double momentum = r.momentum_x(), omega0 = r.wheel.twist().w_W.y();
  const double v0 = r.carriage.twist().v_W.x(), vz0 = r.hub.twist().v_W.z();
  const double relative0 = r.axle.rate(), lift0 = r.lift.rate();
  const Vec3 at = r.wheel.pose().p_W;
  const double x0 = r.carriage.pose().p_W.x(), angle0 = r.axle.turned();
  const Vec3 g = r.world.options().gravity;

  r.hub.add_wrench({Vec3(0, 0, r.load_force), Vec3::Zero()});
  r.carriage.add_wrench({Vec3(-applied_pull_, 0, 0), Vec3::Zero()});
  simulation_->step(h);

  const GroundContact& c = simulation_->contacts().front();
  const double omega1 = r.wheel.twist().w_W.y(), v1 = r.carriage.twist().v_W.x(), vz1 = r.hub.twist().v_W.z();
  last_.time = static_cast<double>(steps_) * h;
  last_.forward_velocity = v0;
  last_.angular_velocity = omega0;
  const double rim = omega0 * radius_;
  last_.slip = std::abs(rim) > standstill ? 1.0 - v0 / rim : commanded_slip_;
  last_.sinkage = ground_->undisturbed_height(at.x(), at.y()) - (at.z() - radius_);
  last_.drawbar_pull = (r.momentum_x() - momentum) / h - r.rail.effort() + applied_pull_ - r.mass() * g.x();
  last_.driving_torque = r.axle.effort() - r.axle_inertia() * (omega1 - omega0) / h;
  last_.normal_load = c.wrench.F_W.z();
  last_.lateral_force = c.wrench.F_W.y();
  last_.compaction_resistance = c.result.compaction_resistance;
  last_.position = x0 - start_position_;
  last_.wheel_angle = angle0 - start_angle_;
  last_.vertical_velocity = vz0;
  last_.contact_count = c.result.contact_count;
  carried_ = c.wrench.F_W.z();
  contact_stiffness_ = c.result.stiffness(2, 2);
  release_stiffness_ = c.result.release_stiffness;

  const double axle = 0.5 * h * r.axle.effort() * (relative0 + r.axle.rate());
  const double rail = 0.5 * h * (r.rail.effort() - applied_pull_) * (v0 + v1);
  axle_work_ += axle;
  rail_work_ += rail;
  drive_work_ += axle + rail +
                 0.5 * h *
                     (r.mass() * g.x() * (v0 + v1) + (r.load_force + lifted_mass(spec_) * g.z()) * (vz0 + vz1) +
                      r.lift.effort() * (lift0 + r.lift.rate()));
  check_buried(phase);
}

void Rig::touch_down(const Progress& progress) {
  if (phase_ == Phase::running) return;
  Parts& r = *parts_;
  const double h = spec_.time_step, W = spec_.normal_load;
  r.rail.set_motor({0.0});
  r.axle.set_motor({0.0});
  if (r.world.steps() == 0) start_kinetic_ = r.kinetic();
  const bool grains = ground_->sampling() == terrain::Sampling::step_mean;
  const auto go_on = [&] {
    if (grains || r.world.steps() % 64 == 0) {
      if (progress.stop_requested()) throw Interrupted("stopped during touchdown");
      progress.report(0.0, fmt::format("touchdown: {:.3g} of {:.3g} N at {:.3g} mm", carried_, W, 1e3 * last_.sinkage));
    }
    advance("touchdown");
    still_ = std::abs(r.hub.twist().v_W.z()) < rest_speed ? still_ + h : 0.0;
    if (grains && touchdown_observer_) touchdown_observer_(*this);
  };
  while (phase_ == Phase::lowering) {
    const double F = carried_;
    const double depth = last_.sinkage;
    const double missing = W - F;
    if (F > 0.0 && (std::abs(missing) <= spec_.touchdown_tolerance * W || (grains && missing <= 0.0))) {
      phase_ = grains ? Phase::resting : Phase::running;
      let_go_ = r.world.time();
      still_ = 0.0;
      break;
    }
    // The secant of a law that stiffens with depth is below its tangent; the factor of 10 in the speed covers that.
    double stiffness = std::max(contact_stiffness_, depth > 0.0 ? F / depth : 0.0);
    if (missing < 0.0) stiffness = std::max(stiffness, release_stiffness_);
    // Ground that answers to the velocity itself is passed to and fro: each time, the servo takes smaller steps.
    if (missing * missing_ < 0.0) servo_share_ = std::max(1e-3, 0.8 * servo_share_);
    missing_ = missing;
    double speed = servo_share_ * spec_.lowering_speed;
    if (stiffness > 0.0) speed = std::clamp(missing / (10.0 * h * stiffness), -speed, speed);
    r.lift.set_motor({-speed});
    if (r.world.time() > spec_.touchdown_time)
      throw RunError(
          fmt::format("touchdown: after {:.3g} s the ground carries {:.6g} of {:.6g} N at a sinkage of {:.4g} m; "
                      "the soil does not carry the load, or lowering_speed is too small",
                      r.world.time(), F, W, depth));
    go_on();
  }
  r.lift.clear_motor();
  while (phase_ == Phase::resting) {
    if (still_ >= rest_time || r.world.time() - let_go_ >= longest_rest) {
      phase_ = Phase::running;
      break;
    }
    go_on();
  }
  steps_ = 0;
  start_time_ = r.world.time();
  start_position_ = r.carriage.pose().p_W.x();
  start_angle_ = r.axle.turned();
}

void Rig::step() {
  if (phase_ != Phase::running) touch_down();
  drive((static_cast<double>(steps_) + 1.0) * spec_.time_step);
  advance("run");
  ++steps_;
  if (ended_ || !pulled(motion_.mode) || last_.time < spec_.ramp_time) return;
  if (last_.slip > motion_.slip_limit) {
    ended_ = true;
    events_.push_back(
        fmt::format("slip passed {:.3g} at t = {:.6g} s under a pull of {:.6g} N: the wheel cannot hold it",
                    motion_.slip_limit, last_.time, applied_pull_));
  }
}

bool Rig::finished() const { return ended_ || (static_cast<double>(steps_) + 0.5) * spec_.time_step > planned_; }

double Rig::simulated_seconds() const { return parts_->world.time(); }

RigEnergy Rig::energy() const {
  const GroundContact& c = simulation_->contacts().front();
  RigEnergy e;
  e.drive = drive_work_;
  e.axle = axle_work_;
  e.rail = rail_work_;
  e.kinetic = parts_->kinetic() - start_kinetic_;
  e.ground = c.work;
  e.stored = c.result.stored_energy;
  e.plastic = c.plastic;
  e.slip = c.slip;
  e.damping = c.damping;
  e.numerical = c.numerical;
  return e;
}

recording::Condition condition_of(const RigSpec& spec, const RigMotion& motion) {
  recording::Condition c;
  c.normal_load = spec.normal_load;
  if (motion.mode != RigMode::towed) c.angular_velocity = motion.angular_velocity;
  c.forward_velocity = motion.forward_velocity;
  switch (motion.mode) {
    case RigMode::imposed_slip:
      c.slip = motion.angular_velocity == 0.0 ? -std::numeric_limits<double>::infinity() : motion.slip;
      break;
    case RigMode::towed:
      c.extra["mode"] = "towed";
      break;
    case RigMode::force_controlled:
      c.extra["mode"] = "force_controlled";
      c.extra["pull"] = fmt::format("{:.17g}", motion.pull);
      break;
    case RigMode::pull_ramp:
      c.extra["mode"] = "pull_ramp";
      c.extra["pull"] = fmt::format("{:.17g}", motion.pull);
      c.extra["final_pull"] = fmt::format("{:.17g}", motion.final_pull);
      break;
  }
  return c;
}

namespace {

struct SampleChannel {
  const char* name;
  const char* unit;
  double RigSample::*field;
};

constexpr SampleChannel sample_channels[] = {
    {recording::channel::drawbar_pull, "N", &RigSample::drawbar_pull},
    {recording::channel::driving_torque, "N m", &RigSample::driving_torque},
    {recording::channel::sinkage, "m", &RigSample::sinkage},
    {recording::channel::normal_load, "N", &RigSample::normal_load},
    {recording::channel::angular_velocity, "rad/s", &RigSample::angular_velocity},
    {recording::channel::forward_velocity, "m/s", &RigSample::forward_velocity},
    {"slip", "", &RigSample::slip},
    {"lateral_force", "N", &RigSample::lateral_force},
    {"compaction_resistance", "N", &RigSample::compaction_resistance},
    {"position", "m", &RigSample::position},
    {"wheel_angle", "rad", &RigSample::wheel_angle},
    {"vertical_velocity", "m/s", &RigSample::vertical_velocity},
    {"contact_count", "", &RigSample::contact_count},
};

recording::Run empty_run(recording::Condition condition) {
  recording::Run run;
  run.condition = std::move(condition);
  for (const SampleChannel& c : sample_channels) run.channels.push_back({c.name, c.unit, {}});
  return run;
}

}  // namespace

const wheel::Body& Rig::shape() const { return *simulation_->contacts().front().shape; }

recording::Run Rig::run(const Progress& progress) {
  const bool resumed = !run_.channels.empty() && phase_ == Phase::running;
  if (run_.channels.empty()) run_ = empty_run(condition_of(spec_, motion_));
  touch_down(progress);
  const double h = spec_.time_step;
  const auto block = static_cast<std::uint64_t>(std::max(1.0, std::round(spec_.sample_interval / h)));
  const auto count = static_cast<std::size_t>(planned_ / h / static_cast<double>(block)) + 2;
  recording::Run& run = run_;
  run.time.reserve(count);
  for (recording::Channel& c : run.channels) c.values.reserve(count);
  if (observer_ && !resumed) observer_(*this);
  while (!finished()) {
    if (progress.stop_requested())
      throw Interrupted(fmt::format("stopped at t = {:.6g} of {:.6g} s", last_.time, planned_));
    RigSample sum;
    std::uint64_t taken = 0;
    for (; taken < block && !finished(); ++taken) {
      step();
      sum.time += last_.time;
      for (const SampleChannel& c : sample_channels) sum.*c.field += last_.*c.field;
      progress.report(std::min(1.0, static_cast<double>(steps_) * h / planned_), "rig");
    }
    const double scale = 1.0 / static_cast<double>(taken);
    for (const SampleChannel& c : sample_channels)
      if (std::isnan(sum.*c.field) || (std::isinf(sum.*c.field) && c.field != &RigSample::slip))  // a locked wheel: -inf
        throw RunError(fmt::format("wheel at t = {:.6g} s: its {} is not finite: try a smaller time step, then check the soil's "
                                   "parameters",
                                   last_.time, c.name));
    run.time.push_back(sum.time * scale);
    for (std::size_t i = 0; i < std::size(sample_channels); ++i)
      run.channels[i].values.push_back(sum.*sample_channels[i].field * scale);
    if (observer_) observer_(*this);
  }
  return std::move(run_);
}

recording::Checkpoint Rig::checkpoint() const {
  recording::Checkpoint c;
  const RigState state = snapshot();
  c.numbers["world"] = state.simulation.world;
  c.numbers["contacts"] = state.simulation.contacts;
  c.numbers["rig"] = state.numbers;
  c.numbers["earlier_seconds"] = {earlier_seconds_};
  c.bytes["ground"] = state.simulation.ground;
  c.put_samples(run_);
  return c;
}

void Rig::resume(const recording::Checkpoint& c) {
  recording::Run run = empty_run(condition_of(spec_, motion_));
  c.take_samples(run);
  restore({{c.number("world"), c.byte("ground"), c.number("contacts")}, c.number("rig")});
  if (!c.number("earlier_seconds").empty()) earlier_seconds_ = c.number("earlier_seconds").front();
  run_ = std::move(run);
}

RigState Rig::snapshot() const {
  return {simulation_->snapshot(),
          {static_cast<double>(phase_), ended_ ? 1.0 : 0.0, start_time_, start_position_, start_angle_,
           static_cast<double>(steps_), applied_pull_, drive_work_, start_kinetic_, carried_, contact_stiffness_,
           let_go_, still_, last_.sinkage, release_stiffness_, missing_, servo_share_, axle_work_, rail_work_}};
}

void Rig::restore(const RigState& state) {
  if (state.numbers.size() != 19 || !(state.numbers[0] >= 0.0 && state.numbers[0] <= 2.0) ||
      !(state.numbers[5] >= 0.0 && state.numbers[5] < 1e15) ||
      !std::all_of(state.numbers.begin(), state.numbers.end(), [](double x) { return std::abs(x) < 1e30; }))
    throw InputError(Problem{{}, 0, 0, "snapshot", "is not of a rig", {}});
  simulation_->restore(state.simulation);
  const double* s = state.numbers.data();
  phase_ = static_cast<Phase>(static_cast<int>(s[0]));
  ended_ = s[1] != 0.0;
  start_time_ = s[2];
  start_position_ = s[3];
  start_angle_ = s[4];
  steps_ = static_cast<std::uint64_t>(s[5]);
  applied_pull_ = s[6];
  drive_work_ = s[7];
  start_kinetic_ = s[8];
  carried_ = s[9];
  contact_stiffness_ = s[10];
  let_go_ = s[11];
  still_ = s[12];
  last_.sinkage = s[13];
  release_stiffness_ = s[14];
  missing_ = s[15];
  servo_share_ = s[16];
  axle_work_ = s[17];
  rail_work_ = s[18];
}

}  // namespace terrode::vehicle
