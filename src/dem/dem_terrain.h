// Particles as the ground of a wheel or a vehicle, behind the same callback as every other ground.
//
// Each step of the simulation loop is carried through in smaller steps of the particles, the bodies moving with the
// motion they announced; the answer is the mean of force and moment over the step (Sampling::step_mean). Trials are
// taken back by restoring the particles, so that a trial leaves no trace.
//
// The bed is laid from a settled periodic prism as the bodies reach it and is periodic along y. Only grains within a
// window about the bodies move: those ahead of it are laid but frozen, those behind freeze where they are and thaw when
// a body comes back; the window moves on by about the prism's side across the travel. A full bed, as in the paper, is
// laid at once instead, and moves as a whole but for the grains near its border, which are fixed.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dem/particle_ground.h"

namespace terrode::dem {

class DemTerrain final : public ParticleGround {
 public:
  // Throws InputError with every problem of the parameters.
  explicit DemTerrain(DemTerrainParams params);
  ~DemTerrain() override;

  terrain::BodyId add_body(std::shared_ptr<const wheel::Body> shape) override;
  double height(double x, double y) const override;
  std::vector<std::uint8_t> snapshot() const override;
  void restore(std::span<const std::uint8_t> bytes) override;
  std::string name() const override { return "dem"; }

  // All grains that are laid, in the order of their laying, within the bed's width along y.
  void particles(std::vector<float>& position, std::vector<float>& radius) const override;

  // The particles, for pictures and tests. Positions along y repeat with the bed's width.
  const Simulation& particles() const { return *simulation_; }
  double particle_time_step() const { return time_step_; }

 private:
  void advance() override;
  void take_back() override;
  void lay_window();
  void lay_full();
  std::string state() const;
  void set_state(const std::string& bytes);

  std::unique_ptr<Simulation> simulation_;
  int soil_ = 0, wheel_material_ = 0;
  double time_step_ = 0.0;
  std::vector<int> engine_;  // the simulation's number of each body
  bool laid_ = false;
  long first_tile_ = 0, last_tile_ = -1;  // laid so far, along x
  long free_from_ = 0, free_to_ = -1;     // stretches that move, of which a tile has a whole number
  std::string before_;                    // the particles at the start of the step
};

// Centres of a shell of overlapping spheres that fills rim and side walls of a cylinder about y.
std::vector<Member> shell_of_spheres(double radius, double width, double diameter, double spacing);

}  // namespace terrode::dem
