#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  return {{{"length", 0.6 * at.radius}}};
}

const Info& info() {
  static const Info out{
      "run_in",
      Class::compaction,
      "run-in",
      "The rut and the heap in front take a distance to form: sinkage and forces approach their steady "
      "value over more than a contact length.",
      "c and tan(phi) times 1 - e/2, k times 1 + e/2, e = exp(-x_rim/length), x_rim = r psi the rim's path",
      "constructed here, after the non-stationary start of single-wheel runs",
      {{"length", "m", 0, 0, 3, 0.1, 0.1, Scale::linear, true, "rim travel over which it settles"}},
      "pressure and shear, by travel",
      {0, 0, 0, false, false, false, true, true, "drift from the start of each run that ends with the distance"},
      {"sensor_drift", "density_gradient"},
      "longer runs; restart in the same rut",
      "the steady wheel is in equilibrium at every instant; a rolling one follows after a contact length",
      {.starts = starts,
       .beside = {{"force_share", -0.5, 1.2, 0.5, 0.4}, {"sinkage_share", -0.5, 1.0, 0.3, 0.3}},
       .needs_series = true}};
  return out;
}

class RunIn final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context& c, bekker::LocalSoil& s) const override {
    if (c.phase_average) return;
    const double left = 0.5 * std::exp(-std::abs(c.wheel_angle) * c.radius / p(0));
    s.k *= 1.0 + left;
    s.cohesion *= 1.0 - left;
    s.tan_phi *= 1.0 - left;
  }
  bool settles() const override { return true; }
  void settle(double rim_path, std::span<const double> beside, Reading& y) const override {
    const double left = std::exp(-rim_path / p(0));
    y.drawbar_pull *= 1.0 - beside[0] * left;
    y.driving_torque *= 1.0 - beside[0] * left;
    y.sinkage *= 1.0 - beside[1] * left;
  }
};

}  // namespace

EffectType run_in() { return detail::type_of<RunIn, info>(); }

}  // namespace terrode::effects
