// The steady Bekker / Wong-Reece wheel: a rigid wheel that rolls straight at constant speed and slip on level ground.
//
// Frames and signs: theta from straight down, positive in front; drawbar pull positive forward, torque positive driving,
// sinkage positive down to the lowest point of the rim.
//   W  = r b int (sigma cos + tau sin) dtheta       (Smith et al. Eq. 2, from theta_r to theta_f)
//   DP = r b int (tau cos - sigma sin) dtheta       (Eq. 3)
//   T  = r^2 b int tau dtheta                       (Eq. 4)
#pragma once

#include <span>
#include <vector>

#include "bekker/point_law.h"
#include "bekker/soil.h"

namespace terrode::bekker {

struct WheelSize {
  double radius = 0.13;  // r, m
  double width = 0.16;   // b, m

  Problems validate() const;
};

// One steady operating point.
struct Operating {
  double slip = 0.0;               // s = 1 - v/(omega r); 1 spins in place, -infinity is a locked wheel that is dragged
  double normal_load = 115.0;      // W, N
  double angular_velocity = 0.3;   // omega, rad/s; matters where stress depends on speed
  double forward_velocity = 0.0;   // v, m/s; read for a locked wheel alone, else it follows from slip
  double position = 0.0;           // x, m; matters where the soil varies along the travel
  double time = 0.0;               // s
  int pass = 1;
  double wheel_angle = 0.0;        // rad
  double travel_length = 0.0;      // m
  bool phase_average = false;      // true: the mean over all phases of what depends on wheel_angle; see Context

  Problems validate() const;
};

// How shear acts at s < 0.
enum class SkidShear {
  // Eq. 9 as printed: against the travel in front of theta_m and along it behind, abs(j) from Eq. 11.
  as_printed,
  // With the sign of j, which changes at Wong & Reece's (1967, part II) transition angle theta_0 of towed wheels:
  // (1 - s) - cos(theta_0) = tan(45 deg - phi/2) sin(theta_0); the normal stress peaks there too.
  along_displacement,
};

struct SteadyOptions {
  SkidShear skid_shear = SkidShear::as_printed;
  // Of forces relative to the load, of torque relative to load times radius; with modifiers up to ten times as much where
  // a corner of their laws is just touched.
  double tolerance = 1e-9;
};

struct SteadyState {
  double entry_angle = 0.0;      // theta_f, rad
  double peak_angle = 0.0;       // theta_m, rad
  double exit_angle = 0.0;       // theta_r, rad
  bool peak_clamped = false;     // theta_m of Eq. 7 lay outside [theta_r, theta_f] and was moved to the nearer end
  double normal_load = 0.0;      // N, of the integral at the angle found
  double drawbar_pull = 0.0;     // N
  double driving_torque = 0.0;   // N m
  double sinkage = 0.0;          // m
  double compaction_resistance = 0.0;  // r b int sigma sin(theta), N
  double drag = 0.0;             // part of the drawbar pull taken by soil pushed in front, N
  int evaluations = 0;           // of the stress law
};

// Stress at one angle of the solution.
struct ProfilePoint {
  double theta = 0.0;               // rad
  double sinkage = 0.0;             // effective, Eq. 6, m
  double sigma = 0.0;               // Pa
  double tau = 0.0;                 // Pa, positive where it gives thrust
  double shear_displacement = 0.0;  // j, m, signed as in Eq. 11
};

class SteadyWheel {
 public:
  // Throws InputError naming every parameter that is out of range. Modifiers act in the order given and must outlive it.
  SteadyWheel(const WheelSize& wheel, const Soil& soil, const ContactAngles& angles, PointLaw law = {},
              SteadyOptions options = {});

  // The entry angle at which the soil carries the load, and the forces there. Throws InputError for a bad operating
  // point, RunError when the wheel would sink to its axle before the soil carries the load. Allocates nothing.
  // Cost: a few microseconds without modifiers.
  SteadyState solve(const Operating& operating) const;

  // Forces at a given entry angle in (0, pi/2], whatever load results (for a wheel held at a depth).
  SteadyState at_entry_angle(const Operating& operating, double entry_angle) const;

  // Stresses at `points.size()` angles spread evenly from the exit to the entry angle of a solved state.
  void profile(const Operating& operating, const SteadyState& state, std::span<ProfilePoint> points) const;

  // What effects see of an operating point; the sinkage in it is 0.
  Context context(const Operating& operating) const;

  const Soil& soil() const { return soil_; }
  const WheelSize& wheel() const { return wheel_; }

 private:
  WheelSize wheel_;
  Soil soil_;
  LocalSoil local_;
  ContactAngles angles_;
  PreparedLaw law_;
  SteadyOptions options_;
};

}  // namespace terrode::bekker
