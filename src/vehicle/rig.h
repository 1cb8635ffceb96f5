// The single-wheel rig: carriage on a rail along x, hub that slides freely up and down on it, driven wheel on the hub.
//
// How a run goes. (1) Touchdown: with carriage and wheel at rest the hub is lowered by a servo whose speed falls with
// the load still missing, min(lowering_speed, (W - F)/(10 h K)), K the larger of the ground's own contact stiffness and
// F/sinkage, so that it comes to rest at static equilibrium without overshoot; then the servo lets go. Grains never
// carry just the load: on a ground of step means (particles) the servo lets go once they carry it, and the wheel comes to
// rest by its own weight, for half a second at most (as Smith et al. give it). (2) Rim and carriage speed rise together by 10 u^3 - 15 u^4 + 6 u^5 over `ramp_time`, so that slip is the commanded one from the
// start and no acceleration jumps.
// (3) The run proper. Time zero and the first sample are at the start of (2).
//
// What a sample is. Forces come from the joints' multipliers, means over a step for the pose before it, with the
// inertia of what hangs on the joint taken out: drawbar_pull = d(sum m v_x)/dt - rail force - other applied forces,
// that is the ground's force on the wheel; driving_torque = axle torque - I_yy d(omega)/dt. A sample is the mean over
// `sample_interval`, stamped with the mean of its steps' beginnings.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "recording/checkpoint.h"
#include "recording/recording.h"
#include "vehicle/simulation.h"

namespace terrode::vehicle {

struct RigSpec {
  double wheel_mass = 3.2;              // kg
  double normal_load = 115.0;           // N, static, weight of wheel and hub included
  std::optional<double> lifted_mass;    // kg that moves up and down (wheel and hub); absent: the load as dead weight,
                                        // normal_load/gravity, at least 1.1 times the wheel
  double carriage_mass = 5.0;           // kg, felt where the carriage is not imposed its speed
  double gravity = 9.81;                // m/s2
  double slope = 0.0;                   // rad; positive where the rail climbs along +x
  double time_step = 1e-3;              // s
  double sample_interval = 5e-3;        // s, rounded to whole steps; at most one step below: every step
  double ramp_time = 0.5;               // s
  double lowering_speed = 0.05;         // m/s
  double touchdown_tolerance = 1e-3;    // of the load
  double touchdown_time = 10.0;         // s after which touchdown has failed
  double bearing_torque = 0.0;          // N m, Coulomb friction of the axle, felt in towed runs
  double start_x = 0.0, start_y = 0.0;  // m, where the wheel is set down

  Problems validate() const;
};

enum class RigMode {
  imposed_slip,      // rim and carriage speed imposed
  towed,             // carriage speed imposed, axle free
  force_controlled,  // rim speed imposed, carriage free under a resisting pull
  pull_ramp,         // as force_controlled, the pull rising slowly: one run gives the drawbar-slip curve
};

struct RigMotion {
  RigMode mode = RigMode::imposed_slip;
  // imposed_slip: s = 1 - v/(omega r), below or equal 1. With angular_velocity 0 (locked wheel) forward_velocity rules.
  double slip = 0.2;
  double angular_velocity = 0.3;           // rad/s
  std::optional<double> forward_velocity;  // m/s: towed and locked wheels; absent elsewhere
  double pull = 0.0;                       // N resisting (positive backwards); pull_ramp: where it begins
  double final_pull = 60.0;                // N, pull_ramp: where it ends
  double slip_limit = 0.95;                // pull_ramp and force_controlled end beyond it
  // Length of the run after the ramp: the carriage's travel [m], but no more than five times it at the rim.
  double distance = 0.7;
  std::optional<double> duration;  // s after the ramp; overrides distance

  Problems validate() const;
};

// One step (or the mean over several).
struct RigSample {
  double time = 0.0;                   // s
  double forward_velocity = 0.0;       // m/s of the carriage
  double angular_velocity = 0.0;       // rad/s
  double slip = 0.0;                   // 1 - v/(omega r); the commanded one while the rim stands
  double sinkage = 0.0;                // m, undisturbed surface under the axle to the rim's lowest point
  double drawbar_pull = 0.0;           // N
  double driving_torque = 0.0;         // N m
  double normal_load = 0.0;            // N, the ground's vertical force
  double lateral_force = 0.0;          // N, the ground's force along y
  double compaction_resistance = 0.0;  // N, as the ground reports
  double position = 0.0;               // m travelled by the carriage since time zero
  double wheel_angle = 0.0;            // rad turned since time zero
  double vertical_velocity = 0.0;      // m/s of the hub
  double contact_count = 0.0;
};

// Energy since touchdown began [J]; closed when residual() is small against `drive`.
struct RigEnergy {
  double drive = 0.0;                                             // work of motors, load and gravity on the machine
  double axle = 0.0, rail = 0.0;                                  // of it what the axle's motor did, and the carriage's drive or pull
  double kinetic = 0.0;                                           // gain of kinetic energy
  double ground = 0.0;                                            // work done on the ground
  double stored = 0.0, plastic = 0.0, slip = 0.0, damping = 0.0;  // where the ground says it went
  double numerical = 0.0;                                         // what the step's implicit part took
  double machine_residual() const { return drive - kinetic - ground; }
  double ground_residual() const { return ground - stored - plastic - slip - damping - numerical; }
  // What motor, carriage, load and gravity gave, each by its net work, and what they took with what moves now.
  double work_in() const { return std::max(axle, 0.0) + std::max(rail, 0.0) + std::max(drive - axle - rail, 0.0); }
  double work_out() const { return work_in() - drive + kinetic; }
  // What is left of work_in() after everything it went to, over it: 0 where the books close. The work comes from the
  // joints' multipliers, where it went from the ground: nothing makes them agree but the equations of motion.
  double audit() const {
    const double in = work_in();
    return in > 0.0 ? (machine_residual() + ground_residual()) / in : 0.0;
  }
};

struct RigState {
  SimulationState simulation;
  std::vector<double> numbers;
};

class Rig {
 public:
  // The shape must roll (wheel::Body::rolling). Throws InputError with every problem.
  Rig(const RigSpec& spec, const RigMotion& motion, std::shared_ptr<const wheel::Body> shape,
      std::unique_ptr<terrain::Terrain> ground);
  ~Rig();

  // Touchdown. Throws RunError when the soil does not carry the load or the wheel is buried to its axle.
  void touch_down(const Progress& progress = {});

  // One step after touchdown. Throws RunError when the wheel is buried or the solution fails.
  void step();
  bool finished() const;
  const RigSample& last() const { return last_; }

  // Touchdown, if not yet done, and all steps; the samples as channels. What ended the run early, or could not be
  // reached, is in `events`. Throws Interrupted when asked to stop.
  recording::Run run(const Progress& progress = {});
  // The samples that run() has taken until now: all there is when it throws.
  const recording::Run& so_far() const { return run_; }
  // Between two samples of run() (in the observers): rig, ground and samples. A rig of the same make that is set to it
  // goes on with run() bit for bit. resume() throws InputError for a state of another rig.
  recording::Checkpoint checkpoint() const;
  void resume(const recording::Checkpoint& checkpoint);
  // Called by run() at time zero and after every sample, between steps: for pictures of the run. It must change nothing.
  void set_observer(std::function<void(Rig&)> observer) { observer_ = std::move(observer); }
  // Called between the steps of a touchdown on grains, which may take long. It must change nothing.
  void set_touchdown_observer(std::function<void(Rig&)> observer) { touchdown_observer_ = std::move(observer); }
  const std::vector<std::string>& events() const { return events_; }

  // Seconds simulated, touchdown included, and planned.
  double simulated_seconds() const;
  double planned_seconds() const { return planned_; }

  RigEnergy energy() const;
  Simulation& simulation() { return *simulation_; }
  const RigSpec& spec() const { return spec_; }
  const wheel::Body& shape() const;
  const RigMotion& motion() const { return motion_; }

  // Seconds simulated in earlier passes over the same ground: kept with a checkpoint, of no effect.
  void set_earlier_seconds(double seconds) { earlier_seconds_ = seconds; }
  double earlier_seconds() const { return earlier_seconds_; }

  // Gives the ground up, ruts and all, for a next pass; the rig is done then.
  std::unique_ptr<terrain::Terrain> release_ground() { return std::move(ground_); }

  // Between steps, bit-exact; samples already taken by run() are not part of it.
  RigState snapshot() const;
  void restore(const RigState& state);

 private:
  struct Parts;
  double ramp(double t) const;
  double target_speed() const;
  void drive(double t1);
  void advance(const char* phase);
  void check_buried(const char* phase) const;

  RigSpec spec_;
  RigMotion motion_;
  double radius_ = 0.0, commanded_slip_ = 0.0;
  std::unique_ptr<terrain::Terrain> ground_;
  std::unique_ptr<Parts> parts_;
  std::unique_ptr<Simulation> simulation_;
  double planned_ = 0.0;
  enum class Phase { lowering, resting, running };
  Phase phase_ = Phase::lowering;
  bool ended_ = false;
  double carried_ = 0.0, contact_stiffness_ = 0.0, release_stiffness_ = 0.0;  // N, N/m, vertical, of the last step
  double missing_ = 0.0, servo_share_ = 1.0;        // of the touchdown's servo: load that is missing [N], of its speed
  double let_go_ = 0.0, still_ = 0.0;               // s: when the servo let go; how long the wheel has been at rest
  double start_time_ = 0.0, start_position_ = 0.0, start_angle_ = 0.0;
  std::uint64_t steps_ = 0;  // since time zero
  double applied_pull_ = 0.0;
  double drive_work_ = 0.0, axle_work_ = 0.0, rail_work_ = 0.0;
  double start_kinetic_ = 0.0;
  double earlier_seconds_ = 0.0;
  RigSample last_;
  recording::Run run_;
  std::vector<std::string> events_;
  std::function<void(Rig&)> observer_, touchdown_observer_;
};

// The condition that a recording of this run has.
recording::Condition condition_of(const RigSpec& spec, const RigMotion& motion);

}  // namespace terrode::vehicle
