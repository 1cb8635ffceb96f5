#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"pressure_dependent_K",
                        Class::shear,
                        "shear modulus that grows with pressure",
                        "The displacement needed to mobilise shear grows with the normal stress.",
                        "K = K0 (1 + kappa sigma/10 kPa), at least K0/20",
                        "linear form constructed here; Senatore & Iagnemma 2011 (ISTVS) on K and pressure",
                        {{"kappa", "-", 0, -0.5, 20, 0.5, 0.5, Scale::linear, true, "relative growth of K at 10 kPa"}},
                        "shear",
                        {-1, -1, 0, false, false, false, false, false,
                         "the rise of pull and torque at low slip is slower under heavy load"},
                        {"shear_rate", "peak_shear"},
                        "three loads at slips of 0.02 to 0.2; a shear box at three stresses",
      {},
      {.in_soil_tests = true}};
  return out;
}

class PressureDependentK final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear; }
  double shear(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil& s, double sigma,
               double tau) const override {
    const double j = q.shear_displacement;
    const double softer = s.shear_modulus * std::max(0.05, 1.0 + p(0) * sigma / 1e4);
    // With the rounding of janosi_mobilised(), which the ratio takes out of tau.
    const double before = 1.0 - std::exp(-j / s.shear_modulus);
    return before > 0 ? tau * (1.0 - std::exp(-j / softer)) / before : tau;
  }
};

}  // namespace

EffectType pressure_dependent_K() { return detail::type_of<PressureDependentK, info>(); }

}  // namespace terrode::effects
