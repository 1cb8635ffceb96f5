#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"k0", 2e7}, {"A_u", 0.0}}}; }

const Info& info() {
  static const Info out{
      "unloading",
      Class::compaction,
      "elastic unloading and reloading",
      "Unloaded soil springs back along a stiff line, so the wheel touches behind its lowest point by the "
      "rebound.",
      "p = p_u - (k0 + A_u z_u)(z_u - z); rebound z_e = p_u/(k0 + A_u z), p_u = 1.5 W/(b r theta_f); lambda = min(z_e/z, 1.5) "
      "in theta_r = -acos(1 - lambda z/r): smooth in the root of 1/k0",
      "line of Wong, Terramechanics and Off-Road Vehicle Engineering 2010 (as public codes have it); rebound as an exit "
      "angle constructed here",
      {{"k0", "N/m^3", kInfinity, 1e4, 1e12, 2e7, 1e-6, Scale::inverse, true, "unloading stiffness at zero sinkage"},
       {"A_u", "N/m^4", 0, 0, 1e12, 0, 1e8, Scale::linear, false, "its growth with the sinkage before unloading", false}},
      "contact geometry; state of nodes",
      {1, 0, -1, false, false, false, false, false,
       "as contact behind the lowest point, by an amount that the plate test gives"},
      {"rear_contact"},
      "unload and reload a plate; repeated passes",
      {},
      {.starts = starts}};
  return out;
}

class Unloading final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kContact; }
  void contact(const bekker::Context& c, bekker::ContactShape& shape) const override {
    if (c.sinkage <= 0) return;
    // Pressure at the lowest point that the rebound is computed from: the mean that carries the load over the arc.
    const double arc = shape.radius * std::acos(std::max(-1.0, 1.0 - c.sinkage / shape.radius));
    const double pressure = 1.5 * shape.normal_load / (c.width * arc);
    shape.rear_fraction += std::min(1.5, pressure / ((p(0) + p(1) * c.sinkage) * c.sinkage));
  }
};

}  // namespace

EffectType unloading() { return detail::type_of<Unloading, info>(); }

}  // namespace terrode::effects
