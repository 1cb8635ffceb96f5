#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "periodic_failure",
      Class::wedge,
      "periodic failure of the soil",
      "Soil under the wheel fails in blocks: shear stress rises and falls once per block, more often the "
      "more the wheel slips.",
      "tau = tau [1 + amplitude sin(psi r (q + (1 - q)|s|) 2 pi/wavelength)], q = 0.15",
      "sinusoidal pull of smooth wheels: Shikanai et al. 2000, J. Terramechanics 37:21; Irani, Bauer & "
      "Warkentin 2013; rate law constructed here",
      {{"amplitude", "-", 0, 0, 1, 0.1, 0.05, Scale::linear, true, "share of the shear stress"},
       {"wavelength", "m", 0.02, 0.002, 0.5, 0.012, 0.02, Scale::log, false, "slip path from block to block"}},
      "shear, by slip path",
      {0, 0, 0, false, false, false, false, true,
       "a line whose rate rises with slip and is no whole order of the wheel; means stay"},
      {"grousers", "carriage_resonance"},
      "the spectrum at several slips and one speed",
      "a ripple has hardly a mean: what is compared is what it leaves over the averaging window, a hundredth of the ripple",
      {.ripple_alone = true}};
  return out;
}

class PeriodicFailure final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear; }
  double shear(const bekker::Context& c, const bekker::Point&, const bekker::LocalSoil&, double,
               double tau) const override {
    if (c.phase_average) return tau;
    const double rate = std::isfinite(c.slip) ? 0.15 + 0.85 * std::abs(c.slip) : 1.0;
    return tau * (1.0 + p(0) * std::sin(2.0 * std::numbers::pi * c.wheel_angle * c.radius * rate / p(1)));
  }
};

}  // namespace

EffectType periodic_failure() { return detail::type_of<PeriodicFailure, info>(); }

}  // namespace terrode::effects
