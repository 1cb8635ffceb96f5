#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "shear_rate",
      Class::shear,
      "shear-rate dependence",
      "Shear stress grows with the logarithm of the sliding velocity.",
      "tau = tau [1 + lambda ln(1 + v_s/v0)], at least 0",
      "logarithmic law constructed here; rate effects in wheel-soil shear",
      {{"lambda", "-", 0, -0.2, 0.5, 0.05, 0.05, Scale::linear, true, "relative growth per e-fold"},
       {"v0", "m/s", 0.002, 1e-5, 1, 0.002, 0.01, Scale::log, false, "sliding velocity at which it sets in"}},
      "shear",
      {1, 1, 0, true, false, false, false, false, "pull and torque rise together with speed and with slip"},
      {"pressure_dependent_K", "drive_friction"},
      "three speeds over a decade at one slip",
      {},
      {.in_soil_tests = true}};
  return out;
}

class ShearRate final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear; }
  double shear(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil&, double,
               double tau) const override {
    return tau * std::max(0.0, 1.0 + p(0) * std::log(1.0 + q.slide_speed / p(1)));
  }
};

}  // namespace

EffectType shear_rate() { return detail::type_of<ShearRate, info>(); }

}  // namespace terrode::effects
