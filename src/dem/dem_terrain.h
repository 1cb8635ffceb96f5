// Particles as the ground of a wheel or a vehicle, behind the same callback as every other ground.
//
// Each step of the simulation loop is carried through in smaller steps of the particles, the bodies moving with the
// motion they announced; the answer is the mean of force and moment over the step (Sampling::step_mean). Trials are
// taken back by restoring the particles, so that a trial leaves no trace.
//
// The bed is laid from a settled periodic prism as the bodies reach it and is periodic along y. Only grains within a
// window about the bodies move: those ahead of it are laid but frozen, those behind freeze where they are and thaw when
// a body comes back; the window moves on by about the prism's side across the travel. A full bed, as in the paper, is
// laid at once instead, and moves as a whole but for the grains near its border, which are fixed. The undisturbed surface, the mean height of the topmost grains seen from above, is at z = 0.
#pragma once

#include <memory>
#include <optional>
#include <string>
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

class DemTerrain final : public terrain::Terrain, public terrain::ParticleView {
 public:
  // Throws InputError with every problem of the parameters.
  explicit DemTerrain(DemTerrainParams params);
  ~DemTerrain() override;

  terrain::BodyId add_body(std::shared_ptr<const wheel::Body> shape) override;
  terrain::Sampling sampling() const override { return terrain::Sampling::step_mean; }
  void begin_step(double t, double h) override;
  void set_motion(terrain::BodyId body, const Pose& pose, const Twist& twist) override;
  terrain::ContactResult wrench(terrain::BodyId body, const Pose& pose, const Twist& twist) override;
  void end_step() override;
  double height(double x, double y) const override;
  double undisturbed_height(double, double) const override { return 0.0; }
  double roughness() const override;
  std::vector<std::uint8_t> snapshot() const override;
  void restore(std::span<const std::uint8_t> bytes) override;
  std::string name() const override { return "dem"; }

  // All grains that are laid, in the order of their laying, within the bed's width along y.
  void particles(std::vector<float>& position, std::vector<float>& radius) const override;

  // The particles, for pictures and tests. Positions along y repeat with the bed's width.
  const Simulation& particles() const { return *simulation_; }
  double particle_time_step() const { return time_step_; }
  double bed_width() const;

 private:
  struct Touching {
    std::shared_ptr<const wheel::Body> shape;
    int body = -1;           // in the simulation
    bool announced = false;  // in this step
    Pose pose;
    Twist twist;
  };
  Touching& known(terrain::BodyId body);
  void advance();
  double half_chord() const;
  void lay_window();
  void lay_full();
  std::string state() const;
  void set_state(const std::string& bytes);

  DemTerrainParams params_;
  std::unique_ptr<Simulation> simulation_;
  int soil_ = 0, wheel_material_ = 0;
  double time_step_ = 0.0;
  double depth_ = 0.0;  // m, from the undisturbed surface to the floor
  std::vector<Touching> bodies_;
  std::vector<terrain::ContactResult> results_;
  bool laid_ = false, in_step_ = false, computed_ = false;
  long first_tile_ = 0, last_tile_ = -1;  // laid so far, along x
  long free_from_ = 0, free_to_ = -1;     // stretches that move, of which a tile has a whole number
  double half_chord_ = 0.0;               // m, of the bodies at the surface: the window is never shorter
  double largest_ = 0.0;                  // m, diameter of the largest grain
  double step_start_ = 0.0, step_length_ = 0.0;
  std::string before_;  // the particles at the start of the step
};

// Mean height of a bed's surface above its floor [m]: of the topmost grain over points all over the bed.
double surface_level(const Bed& bed);

// Centres of a shell of overlapping spheres that fills rim and side walls of a cylinder about y.
std::vector<Member> shell_of_spheres(double radius, double width, double diameter, double spacing);

}  // namespace terrode::dem
