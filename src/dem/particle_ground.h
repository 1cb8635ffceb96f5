// What grounds of particles have in common, whichever engine carries the grains: the bed laid from a settled prism, the
// order of a step, the motions that bodies announce, the window of grains that move, and how a body is followed.
//
// The undisturbed surface, the mean height of the topmost grains seen from above, is at z = 0. The bed is periodic along y.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "dem/bed.h"
#include "terrain/particle_view.h"
#include "terrain/terrain.h"

namespace terrode::dem {

enum class WheelSurface {
  shape,    // the body's own surface in closed form: cylinder, crown, grousers
  spheres,  // a shell of overlapping spheres, as in the paper (section 4.2.3); wheels only
};

// The soil that moves: beyond a body's centre ahead of it, behind it [m].
struct DemWindow {
  double ahead = 0.16, behind = 0.12;
};

struct DemTerrainParams {
  Bed prism;          // settled, periodic along both sides
  int tiles_y = 5;    // prisms side by side: the bed's width
  Interaction soil;   // grain on grain
  Interaction wheel;  // grain on body; the paper's wheel is covered with soil
  Interaction floor = Interaction::smooth_wall();
  std::optional<double> settling_friction, settling_rolling_friction;  // that the prism was settled with, as BedRecipe
  WheelSurface surface = WheelSurface::shape;
  double shell_diameter = 0.01;  // m, of the spheres of a shell
  double shell_spacing = 0.75;   // of their radius
  double window_ahead = 0.16;    // m beyond a body's centre that moves; at least what it cuts out of the surface
  double window_behind = 0.12;   // m behind it
  double full_length = 0.0;      // m along x of a full bed; 0: the bed follows the window
  double full_behind = 0.2;      // m of it at x < 0
  double border = 0.01;          // m of it all around in which grains are fixed
  double time_step = 0.0;        // s, largest step of the particles; 0: suggested from the Rayleigh time
  double gravity = 9.81;         // m/s2
  int threads = 1;
  Problems validate() const;
};

class ParticleGround : public terrain::Terrain, public terrain::ParticleView {
 public:
  terrain::Sampling sampling() const final { return terrain::Sampling::step_mean; }
  void begin_step(double t, double h) final;
  void set_motion(terrain::BodyId body, const Pose& pose, const Twist& twist) final;
  terrain::ContactResult wrench(terrain::BodyId body, const Pose& pose, const Twist& twist) final;
  void end_step() final;
  double undisturbed_height(double, double) const final { return 0.0; }
  double roughness() const final { return roughness_; }
  double bed_width() const { return params_.prism.length * params_.tiles_y; }

 protected:
  struct Announced {
    std::shared_ptr<const wheel::Body> shape;
    bool announced = false;  // in this step
    Pose pose;
    Twist twist;
  };
  // First and last of a row of stretches along x.
  using Range = std::pair<long, long>;

  // Throws InputError with every problem of the parameters.
  explicit ParticleGround(DemTerrainParams params);

  // Carries the grains through the step and answers for every body.
  virtual void advance() = 0;
  // Puts the grains back to the beginning of the step; throws RunError where the engine cannot.
  virtual void take_back() = 0;

  terrain::BodyId keep(std::shared_ptr<const wheel::Body> shape);
  // A restored ground is between two steps.
  void abandon_step() { in_step_ = false; }
  bool in_step() const { return in_step_; }
  double step_length() const { return step_length_; }
  bool full() const { return params_.full_length > 0.0; }

  // A prism that is long along the travel thaws and freezes in stretches about as long as it is wide: how many a prism has,
  // and their length [m].
  long stretches() const;
  double stretch() const { return params_.prism.width / static_cast<double>(stretches()); }
  long stretch_of(double x) const;
  // The stretches that the window about the announced bodies holds, if there are any.
  std::optional<Range> window() const;
  // Half of what a grain's height above the surface cuts out of the circles that hold the bodies, at the deepest so far [m].
  double half_chord() const;
  // A grain nearer to a body's axis than this [m], less its radius, may be touched before the window moves on.
  double reach(const Announced& body) const;

  // With what velocity the engine's body at `at` follows the announced motion. The loop that calls moves a body with the
  // velocity it finds after this force; what the engine's body is behind or ahead by is made up for in a few steps, so that
  // neither jumps. At rest where no motion was announced.
  Twist following(const Announced& body, const Pose& at) const;
  // What body k feels: the mean wrench of the step, after which the engine has it at `at`, moved by `twist`.
  void answer(std::size_t k, const Wrench& mean, const Pose& at, const Twist& twist, int contacts);

  DemTerrainParams params_;
  double depth_ = 0.0;    // m, from the undisturbed surface to the floor
  double largest_ = 0.0;  // m, diameter of the largest grain
  std::vector<Announced> bodies_;
  double kept_chord_ = 0.0;  // m, half_chord() after the last step: the window is never shorter

 private:
  Announced& known(terrain::BodyId body);
  double roughness_ = 0.0, step_length_ = 0.0;
  bool in_step_ = false, computed_ = false;
  std::vector<terrain::ContactResult> results_;
};

// Mean height of a bed's surface above its floor [m]: of the topmost grain over points all over the bed.
double surface_level(const Bed& bed);

}  // namespace terrode::dem
