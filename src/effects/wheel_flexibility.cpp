#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "wheel_flexibility",
      Class::wheel,
      "elastic wheel",
      "A wheel or tyre that flattens under load touches along a larger arc: the substitute circle grows "
      "with the deflection over the sinkage.",
      "r* = r (1 + f/z), f = W/stiffness",
      "after the substitute circle of Harnisch et al. 2005; first order in f/z, constructed here",
      {{"stiffness", "N/m", kInfinity, 1e2, 1e9, 2e5, 1e-5, Scale::inverse, true, "radial stiffness of the wheel"}},
      "contact geometry",
      {1, 1, -1, false, false, false, false, false,
       "less sinkage, more pull and torque (dDP r/dT about 0.4), growing with load"},
      {"plate_scale", "crosstalk"},
      "three loads or more; a radius sensor; load-deflection on a hard floor"};
  return out;
}

class WheelFlexibility final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kContact; }
  void contact(const bekker::Context& c, bekker::ContactShape& shape) const override {
    if (c.sinkage > 0) shape.radius *= 1.0 + std::min(3.0, shape.normal_load / (p(0) * c.sinkage));
  }
};

}  // namespace

EffectType wheel_flexibility() { return detail::type_of<WheelFlexibility, info>(); }

}  // namespace terrode::effects
