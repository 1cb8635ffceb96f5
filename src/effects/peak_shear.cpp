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
      "form 0: tau = tau_max Kr {1 + [1/(Kr (1 - 1/e)) - 1] exp(1 - j/Kw)} (1 - exp(-j/Kw)) (blended from the plain "
      "law for Kr from 1 to 0.95); form 1: tau = tau [1 + 2.117 (1/Kr - 1)(1 - exp(-j/Kw)) exp(-j/(3 Kw))], a hump on the plain law "
      "that is highest at j = 1.39 Kw",
      "form 0: Wong 1983; Wong, Theory of Ground Vehicles (as public codes have it), blend constructed here; form 1: constructed here",
      {{"Kr", "-", 1, 0.1, 1, 0.75, 0.3, Scale::linear, true, "residual over peak"},
       {"Kw", "m", 0.004, 1e-4, 0.1, 0.004, 0.01, Scale::log, false, "displacement of the peak"},
       {"form", "-", 0, 0, 1, 0, 1, Scale::choice, false, "0: peak and residual of the strength, 1: a hump that passes"}},
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
    const double fall = std::exp(-x);
    // (1 - u)(u^(1/3)) with u = exp(-x) is highest, 0.4725, at u = 1/4.
    if (p(2) != 0.0) return tau * (1.0 + (1.0 / p(0) - 1.0) / 0.4725 * (1.0 - fall) * std::exp(-x / 3.0));
    const double wong = p(0) * (1.0 + hump_ * fall) * (1.0 - fall);
    return (1.0 - weight_) * tau + weight_ * (s.cohesion + sigma * s.tan_phi) * wong;
  }

 private:
  double hump_ = std::numbers::e * (1.0 / (p(0) * (1.0 - std::exp(-1.0))) - 1.0);
  double weight_ = std::min(1.0, (1.0 - p(0)) / 0.05);
};

}  // namespace

EffectType peak_shear() { return detail::type_of<PeakShear, info>(); }

}  // namespace terrode::effects
