// Hard flat ground, the test double of the soft ones: a plane that pushes back with a linear spring and dashpot and
// holds by Coulomb friction, through the same callback.
#pragma once

#include "terrain/terrain.h"
#include "core/problem.h"

namespace terrode::terrain {

struct RigidGroundParams {
  double stiffness = 1e6;        // [N/m] against penetration of the body's lowest point
  double damping = 2e3;          // [N s/m] against approach; the sum of both never pulls
  double friction = 0.6;         // [-] Coulomb coefficient
  double sliding_scale = 1e-3;   // [m/s] at which friction has reached tanh(1) of its limit
  double height = 0.0;           // [m] of the plane z = height

  Problems validate() const;
};

// Per body: penetration d of its lowest point, N = max(0, stiffness d + damping d'), friction
// -friction N tanh(|v_t| / sliding_scale) v_t / |v_t| at that point, v_t its sliding velocity. A plain cylinder touches
// with the lowest points of both its edges, each with half of stiffness and damping. Without history.
class RigidTerrain final : public Terrain {
 public:
  explicit RigidTerrain(const RigidGroundParams& params = {});
  BodyId add_body(std::shared_ptr<const wheel::Body> shape) override;
  Sampling sampling() const override { return Sampling::point_value; }
  void begin_step(double t, double h) override;
  void set_motion(BodyId body, const Pose& pose, const Twist& twist) override;
  ContactResult wrench(BodyId body, const Pose& pose, const Twist& twist) override;
  void end_step() override;
  double height(double, double) const override { return params_.height; }
  double undisturbed_height(double, double) const override { return params_.height; }
  std::vector<PatchNode> patch(BodyId body) const override;
  std::vector<std::uint8_t> snapshot() const override;
  void restore(std::span<const std::uint8_t> bytes) override;
  std::string name() const override { return "rigid"; }

 private:
  void check_body(BodyId body) const;
  void point(double share, const Vec3& arm, const Pose& pose, const Twist& twist, ContactResult& r,
             std::vector<PatchNode>& patch) const;
  RigidGroundParams params_;
  std::vector<std::shared_ptr<const wheel::Body>> shapes_;
  std::vector<std::vector<PatchNode>> patches_;
  bool in_step_ = false;
};

}  // namespace terrode::terrain
