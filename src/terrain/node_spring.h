// Node-spring ground: the dynamic Bekker method. A lattice of nodes carries the body that sinks into it; each node
// answers with the stress that src/bekker gives at its point, along the body's surface, times the area it carries. The
// wrench is the sum over nodes and nothing else. docs/theory/node-spring.md derives and measures what is said here.
//
// Under a body that rolls, with theta from straight down and positive towards the travel:
//   theta_f  where the rim meets the ground as it lies (ruts included), found in each strip of the width;
//   theta_r  where the rim stops pressing: theta_r of ContactAngles (0 by default) plus atan(rise / travel) of the rim's
//            motion, reached over `springback` of relative motion; -theta_f when the wheel is pressed down standing;
//   theta_m  = (a0 + a1 s) theta_f, held within [theta_r, theta_f]; nodes behind it take the pressure of theta_eq
//            (Smith et al. Eqs. 6-8; Wong & Reece 1967);
//   j        the displacement of the rim's material along the ground since it came into contact, integrated from pose
//            to pose in both directions; at constant speed this is Eq. 11 for s >= 0.
#pragma once

#include <memory>
#include <vector>

#include "bekker/contact_arc.h"
#include "bekker/point_law.h"
#include "bekker/steady_wheel.h"
#include "core/problem.h"
#include "terrain/node_grid.h"
#include "terrain/soil_field.h"
#include "terrain/surface.h"
#include "terrain/terrain.h"

namespace terrode::terrain {

// What sets the pressure under a rolling body: the node's own sinkage (Eq. 5), or Wong & Reece's distribution.
enum class PressureDistribution { wong_reece, sinkage };

// What is left of the pressure when the body rises by g above the deepest point it reached:
//   rigid_plastic    p (1 - g/springback): the springback is a numerical length, contact ends at theta_r;
//   elastic_plastic  p - (k0 + A_u z) g (Wong 1989): contact reaches behind the lowest point by the rebound p/(k0 + A_u z);
//   elastic          p of the present sinkage: no memory, as the springs of Smith et al. These ring.
enum class Unloading { rigid_plastic, elastic_plastic, elastic };

// Area of the body's surface that a node carries: spacing^2 / cos(theta), or spacing^2 as Smith et al. take it, which
// loses the factor 1/cos(theta) of the arc and with it some hundredths of the load (docs/theory/node-spring.md).
enum class NodeArea { arc, projected };

// Where shear displacement is kept: with the rim's material as it passes through the contact (the integral of Eq. 11);
// with the ground's nodes (as SCM-type models); or Eq. 11 itself evaluated for the present motion, without history and
// with Eq. 9's signs at s < 0.
enum class ShearHistory { rim, ground, closed_form };

// Soil that the side of a sunk wheel pushes across: nothing, or Hegedus' passive wedge (bekker/bulldozing.h) along the
// edge nodes, built up over K of sideways displacement like shear.
enum class SideWall { none, hegedus };

struct NodeSpringParams {
  double spacing = 0.005;  // [m] between nodes
  bekker::Soil soil;
  bekker::ContactAngles angles;
  PressureDistribution distribution = PressureDistribution::wong_reece;
  Unloading unloading = Unloading::rigid_plastic;
  NodeArea area = NodeArea::arc;
  ShearHistory shear_history = ShearHistory::rim;
  bekker::SkidShear skid_shear = bekker::SkidShear::as_printed;  // for closed_form at s < 0
  SideWall side_wall = SideWall::none;
  double springback = 2e-4;           // [m] rigid_plastic: rise over which a node lets go
  double unloading_k0 = 0.0;          // [Pa/m] k0 of elastic_plastic
  double unloading_au = 0.0;          // [Pa/m2] A_u
  double travel_length = 0.0;         // [m] of the bin or the run, for effects near its ends; 0: unknown
  double damping = 0.0;               // [Pa s/m] dashpot along the surface normal; pressure never falls below 0
  double damping_time = 0.0;          // [s] a dashpot in proportion to the ground's stiffness there (Rayleigh's beta)
  double heap_fraction = 0.0;         // [-] of the soil pushed down that is heaped around the contact; 0: none
  double repose_angle = 0.0;          // [rad] slope to which heaps and rut walls fall; 0: they stand at any slope

  Problems validate() const;
};

class NodeSpringTerrain final : public Terrain {
 public:
  // `law` names the laws and effects in force (null: k (z/b)^n and Janosi-Hanamoto); what it points to must outlive the
  // ground. `surface` is the ground before anything touched it (null: level at 0), `field` how its soil varies (null:
  // params.soil everywhere), `owner` keeps alive what `law` points to. Throws InputError with every problem of the parameters.
  explicit NodeSpringTerrain(const NodeSpringParams& params, bekker::PointLaw law = {},
                             std::shared_ptr<const Surface> surface = nullptr,
                             std::shared_ptr<const SoilField> field = nullptr, std::shared_ptr<const void> owner = nullptr);
  ~NodeSpringTerrain() override;

  BodyId add_body(std::shared_ptr<const wheel::Body> shape) override;
  Sampling sampling() const override { return Sampling::point_value; }
  void begin_step(double t, double h) override;
  void set_motion(BodyId body, const Pose& pose, const Twist& twist) override;
  ContactResult wrench(BodyId body, const Pose& pose, const Twist& twist) override;
  void end_step() override;
  double height(double x, double y) const override;
  double undisturbed_height(double x, double y) const override;
  std::vector<PatchNode> patch(BodyId body) const override;
  std::vector<std::uint8_t> snapshot() const override;
  void restore(std::span<const std::uint8_t> bytes) override;
  std::string name() const override { return "node-spring"; }

  const NodeSpringParams& params() const { return params_; }
  const NodeGrid& grid() const { return grid_; }
  // Takes a node out of the ground for good: it carries nothing (tests, cavities).
  void remove_node(NodeIndex i) { grid_.touch(i).removed = 1; }
  // Makes the tiles that cover a rectangle, so that driving over it allocates nothing.
  void reserve(double x0, double y0, double x1, double y1);

 private:
  struct BodyState;
  struct Sums;
  struct Roll;
  BodyState& state(BodyId body) const;
  ContactResult evaluate(BodyState& s, const Pose& pose, const Twist& twist, std::vector<PatchNode>* record) const;
  // False where the body lies on its side and is to be taken as any other.
  bool roll(BodyState& s, const Pose& pose, const Twist& twist, std::vector<PatchNode>* record, ContactResult& out) const;
  ContactResult press(BodyState& s, const Pose& pose, const Twist& twist, std::vector<PatchNode>* record) const;
  void commit(BodyState& s);
  void leave(const BodyState& s, NodeIndex index, Node& node) const;
  void heap(const BodyState& s, double volume);
  void settle(int ix0, int iy0, int ix1, int iy1);
  bekker::LocalSoil soil_at(double x, double y, double depth) const {
    bekker::LocalSoil soil = soil_;
    if (field_) field_->at(x, y, depth, soil);
    return soil;
  }
  // How far ground springs back that was pressed to `plastic` [m]. Shallow ruts spring back by half their depth at most,
  // so that the surface never rises to where it was. `width` is the body's.
  double springback(const bekker::LocalSoil& soil, double plastic, double width) const {
    if (plastic <= 0) return 0.0;
    if (params_.unloading != Unloading::elastic_plastic) return plastic < 2 * params_.springback ? 0.5 * plastic : params_.springback;
    const double p = full_pressure(soil, plastic, width);
    const double rebound = p / (params_.unloading_k0 + params_.unloading_au * plastic);
    return rebound < plastic ? rebound : plastic;
  }
  // Of ground pressed to depth z for the first time, by the law of pressure in force [Pa].
  double full_pressure(const bekker::LocalSoil& soil, double z, double width) const {
    if (!law_.pressure_law) return bekker::power_law_pressure(soil, z);
    bekker::Context context;
    context.width = width;
    context.unit_weight = soil.unit_weight;
    return law_.pressure_law->pressure(soil, context, z);
  }
  // d(ln pressure)/d(ln z) [-].
  double exponent(const bekker::LocalSoil& soil, double z) const {
    if (!law_.pressure_law || !(z > 0)) return soil.n;
    constexpr double step = 1e-4;  // of z
    const double p = full_pressure(soil, z, 1.0);  // the width cancels
    return p > 0 ? (full_pressure(soil, z * (1 + step), 1.0) - full_pressure(soil, z * (1 - step), 1.0)) / (2 * step * p) : 1.0;
  }
  bool damps() const { return params_.damping > 0 || params_.damping_time > 0; }

  NodeSpringParams params_;
  std::shared_ptr<const void> owner_;
  bekker::PreparedLaw law_;
  bekker::LocalSoil soil_;
  std::shared_ptr<const SoilField> field_;
  NodeGrid grid_;
  std::vector<std::unique_ptr<BodyState>> bodies_;
  double t_ = 0.0, h_ = 0.0;
  std::uint32_t step_ = 0;
  bool in_step_ = false;
};

}  // namespace terrode::terrain
