// The force callback: what any ground answers when a rigid body touches it.
//
// A simulation loop that advances bodies from t to t + h calls, in this order,
//
//     ground.begin_step(t, h);
//     ground.set_motion(b, pose_b, twist_b);                    // every body, where there are several
//     ContactResult r = ground.wrench(b, pose_b, twist_b);      // any number of times, any body, any trial pose
//     ... apply r.wrench over [t, t + h], advance the bodies ...
//     ground.end_step();                                        // exactly once
//
// What is evaluated when. `pose` and `twist` are those at t, before the bodies move. A ground whose sampling() is
// `point_value` answers the wrench at t. One whose sampling() is `step_mean` (particles) carries its own smaller steps
// through [t, t + h], the bodies moving with their twists held (from where it left them at t, so that none jumps), and
// answers the mean over the step of force and of moment about the body's origin. Both are what a solver that takes a
// force as constant over a step needs: its multipliers are step means, too.
//
// What may change. wrench() is a trial: history (sinkage, shear displacement, passes, particles) is read and never
// written, so calling it twice with the same arguments gives the same bits, and the order of trials does not matter.
// The last trial of each body in a step is the one that end_step() commits, once; bodies without a trial since
// begin_step() do not touch the ground in that step. A ground may commit from pose to pose: history then advances over
// the motion from the last committed pose to the last trial's.
//
// Several bodies. Each has an id from add_body(). A ground in which bodies feel each other within a step needs the
// motions of all before the first wrench(): set_motion() announces one, wrench() announces its own body's.
//
// Threads. One ground belongs to one simulation; different grounds may run in different threads. Results are bit-equal
// for any number of threads a ground uses inside.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/frames.h"

namespace terrode::wheel {
class Body;
}

namespace terrode::terrain {

using Mat6 = Eigen::Matrix<double, 6, 6>;
using BodyId = int;

enum class Sampling { point_value, step_mean };

// What a body feels from the ground, and where the work goes. World axes; moments about the body's origin.
struct ContactResult {
  Wrench wrench;  // [N, N m] on the body

  // Minus the derivative of (force; moment about the origin) with respect to a small (translation; rotation) of the
  // body [N/m ...] and to its (velocity; angular velocity) [N s/m ...]; for a step that takes them implicitly:
  // F(t + h) ~ F(t) - (stiffness h + damping) v(t + h) + damping v(t). Zero where a ground does not know them;
  // positive on the diagonal. stiffness(2, 2) is the vertical contact stiffness.
  Mat6 stiffness = Mat6::Zero();
  Mat6 damping = Mat6::Zero();
  // How hard the contact lets go when the body moves out of the ground along `normal_W` within a step [N/m]: of ground that
  // yields and unloads stiffly this is far above stiffness(2, 2), and which of the two acts turns with the motion.
  // terrain/implicit_step.h says how a step takes it.
  double release_stiffness = 0.0;
  Vec3 normal_W = Vec3::UnitZ();
  // Of soil that the body's surface does not slide on but carries along [N/m], at `grip_W` from the body's origin.
  double stick_stiffness = 0.0;
  Vec3 grip_W = Vec3::Zero();

  Wrench shear;  // the part of `wrench` whose work is slip_power; zero where a ground does not know it

  double max_sinkage = 0.0;            // [m] of the body's lowest contact below the undisturbed surface
  double contact_area = 0.0;           // [m2] of the body's loaded surface
  double compaction_resistance = 0.0;  // [N] horizontal part of the normal stress, positive against the motion
  double stored_energy = 0.0;          // [J] elastic energy in the ground under this body

  // Work that the body does on the ground per time and that does not come back [W], none negative:
  double plastic_power = 0.0;  // compaction and soil pushed aside
  double slip_power = 0.0;     // shear along the body's surface
  double damping_power = 0.0;  // viscous and rate terms

  int contact_count = 0;  // nodes or particles that carry load
};

// One loaded node, for pictures and tests.
struct PatchNode {
  Vec3 p_W = Vec3::Zero();       // where the force acts [m]
  Vec3 n_W = Vec3::Zero();       // out of the body's surface, into the ground
  double area = 0.0;             // [m2] of the body's surface that the node carries
  double pressure = 0.0;         // [Pa] normal stress
  Vec3 shear_W = Vec3::Zero();   // [Pa] shear stress on the body
  double sinkage = 0.0;          // [m] below the undisturbed surface
  double shear_displacement = 0.0;  // [m] length of the vector
  int passes = 0;                // finished earlier contacts of the node
};

class Terrain {
 public:
  virtual ~Terrain() = default;

  // Puts a body on the ground and returns its id: 0, 1, 2, ... Throws InputError for a shape that this ground cannot
  // touch. `shape` is shared and never changes.
  virtual BodyId add_body(std::shared_ptr<const wheel::Body> shape) = 0;

  virtual Sampling sampling() const = 0;

  // Starts the step from t [s] of length h [s]. Throws InputError unless h is above 0 and both are finite, RunError
  // when the last step was not ended.
  virtual void begin_step(double t, double h) = 0;

  // Announces a body's motion at t; enough for a body whose wrench is not asked in this step.
  virtual void set_motion(BodyId body, const Pose& pose, const Twist& twist) = 0;

  // The contact of a body at a trial pose. Throws RunError outside a step and where pose or twist are not finite;
  // InputError for an unknown body.
  virtual ContactResult wrench(BodyId body, const Pose& pose, const Twist& twist) = 0;

  // Commits the last trial of each body and ends the step. Throws RunError outside a step.
  virtual void end_step() = 0;

  // Height of the surface as it is now, ruts included [m], and as it was before anything touched it.
  virtual double height(double x, double y) const = 0;
  virtual double undisturbed_height(double x, double y) const = 0;
  // How far the undisturbed surface stands out above undisturbed_height() at most [m]: coarse grains, whose mean that is.
  // What is set down begins above it.
  virtual double roughness() const { return 0.0; }

  // The loaded nodes of the body's last trial; empty for a ground that has none to show.
  virtual std::vector<PatchNode> patch(BodyId body) const {
    (void)body;
    return {};
  }

  // All history as bytes, and back, bit for bit: a simulation restored between two steps goes on as if never left.
  // snapshot() only between end_step() and begin_step(); restore() also within a step, as after an error in it: the step
  // is then as if never begun. restore() throws InputError for bytes of another ground.
  virtual std::vector<std::uint8_t> snapshot() const = 0;
  virtual void restore(std::span<const std::uint8_t> bytes) = 0;

  // A 64-bit digest of snapshot(): equal histories have equal digests on every machine.
  std::uint64_t hash() const;

  // One name, as in a scenario: "rigid", "node-spring", "dem", "mpi".
  virtual std::string name() const = 0;
};

// FNV-1a (Fowler, Noll, Vo 1991) over bytes, 64 bits.
std::uint64_t digest(std::span<const std::uint8_t> bytes);

// Throws RunError naming `who` unless every number of pose and twist is finite and the rotation has length 1.
void require_finite(const Pose& pose, const Twist& twist, const char* who);

}  // namespace terrode::terrain
