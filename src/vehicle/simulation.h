// The loop that lets rigid bodies and a ground act on each other, for any ground behind terrain::Terrain: one that
// answers with the force at t_n, and one that carries smaller steps of its own through [t_n, t_n + h] (particles).
//
// One step: ground.begin_step -> wrench of every body at its pose at t_n -> external loads -> World::step ->
// ground.end_step. The ground's stiffness and damping, and how hard it lets go, are taken implicitly:
// terrain/implicit_step.h.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "multibody/world.h"
#include "terrain/terrain.h"
#include "wheel/body.h"

namespace terrode::vehicle {

// One body on the ground, after a step.
struct GroundContact {
  multibody::Body* body = nullptr;
  terrain::BodyId id = 0;
  multibody::SoilDamper* damper = nullptr;
  std::shared_ptr<const wheel::Body> shape;

  terrain::ContactResult result;  // as the ground answered at t_n
  Wrench wrench;                  // what the ground exerted: mean over the step, implicit part included [N, N m]

  // Sums since the start [J]: work that the body did on the ground, and where the ground says it went.
  // `numerical` is the work of what the step takes implicitly (terrain/implicit_step.h).
  double work = 0.0, plastic = 0.0, slip = 0.0, damping = 0.0, numerical = 0.0;
};

struct SimulationState {
  std::vector<double> world;
  std::vector<std::uint8_t> ground;
  std::vector<double> contacts;
};

class Simulation {
 public:
  // World and ground must outlive it.
  Simulation(multibody::World& world, terrain::Terrain& ground) : world_(world), ground_(ground) {}

  // Puts a body on the ground; the shape's frame is the body's frame. Returns its index.
  std::size_t add(multibody::Body& body, std::shared_ptr<const wheel::Body> shape);

  // Advances by h [s]. External loads of the drives are added to the bodies before. Throws what world and ground throw.
  void step(double h);

  const std::vector<GroundContact>& contacts() const { return contacts_; }
  multibody::World& world() { return world_; }
  terrain::Terrain& ground() { return ground_; }
  double time() const { return world_.time(); }

  // Between steps; a simulation of the same make restored to it goes on bit by bit.
  SimulationState snapshot() const;
  void restore(const SimulationState& state);

 private:
  multibody::World& world_;
  terrain::Terrain& ground_;
  std::vector<GroundContact> contacts_;
  std::vector<Twist> before_;
};

// The matrices of one implicit contact: a point p (world) that is resisted by D, and a rotational rest R; the best fit
// of this form to the 6 x 6 matrix B (forces; moments about `origin_W`). D and R may have negative eigenvalues.
struct PointResistance {
  Vec3 p_W = Vec3::Zero();
  Mat3 D = Mat3::Zero();
  Mat3 R = Mat3::Zero();
};
PointResistance point_resistance(const terrain::Mat6& B, const Vec3& origin_W);

}  // namespace terrode::vehicle
