#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"Kr", 0.8}, {"Kw", 0.003}}, {{"Kr", 0.8}, {"Kw", 0.01}}}; }

const Info& info() {
  static const Info out{
      "peak_shear",
      Class::shear,
      "peak and residual shear stress",
      "Dense soil reaches a peak of shear stress and then falls to its residual as it is sheared on.",
      "tau = tau_max Kr {1 + [1/(Kr (1 - 1/e)) - 1] exp(1 - j/Kw)} (1 - exp(-j/Kw)) (blended from the plain "
      "law for Kr from 1 to 0.95)",
      "Wong 1983; Wong, Theory of Ground Vehicles (as public codes have it); blend constructed here",
      {{"Kr", "-", 1, 0.1, 1, 0.75, 0.3, Scale::linear, true, "residual over peak"},
       {"Kw", "m", 0.004, 1e-4, 0.1, 0.004, 0.01, Scale::log, false, "displacement of the peak"}},
      "shear",
      {1, 1, 0, false, false, false, false, false, "pull and torque high at small slip, falling after a peak"},
      {"slip_offset", "pressure_dependent_K", "interface_friction"},
      "the shear box's curve to twenty K; slips below 0.1",
      {},
      {.starts = starts, .in_soil_tests = true}};
  return out;
}

class PeakShear final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear; }
  double shear(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil& s, double sigma,
               double tau) const override {
    const double x = q.shear_displacement / p(1);
    const double rise = std::isfinite(x) ? 1.0 - std::exp(-x) : 1.0;
    const double hump = std::isfinite(x) ? std::exp(1.0 - x) : 0.0;
    const double wong = p(0) * (1.0 + (1.0 / (p(0) * (1.0 - std::exp(-1.0))) - 1.0) * hump) * rise;
    const double weight = std::min(1.0, (1.0 - p(0)) / 0.05);
    return (1.0 - weight) * tau + weight * (s.cohesion + sigma * s.tan_phi) * wong;
  }
};

}  // namespace

EffectType peak_shear() { return detail::type_of<PeakShear, info>(); }

}  // namespace terrode::effects
