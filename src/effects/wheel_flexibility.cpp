#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"stiffness", 1e5}}}; }

const Info& info() {
  static const Info out{
      "wheel_flexibility",
      Class::wheel,
      "elastic wheel",
      "A wheel or tyre that flattens under load touches along a longer and flatter arc, as a larger rigid "
      "wheel would.",
      "r* = r (1 + min(f/z, 3)), f = W/stiffness: r* has at depth z the chord that r has at z + f",
      "constructed here: a rigid circle that touches as the flattened wheel does",
      {{"stiffness", "N/m", kInfinity, 1e2, 1e9, 2e5, 1e-5, Scale::inverse, true, "radial stiffness of the wheel"}},
      "contact geometry",
      {1, 1, -1, false, false, false, false, false,
       "less sinkage, more pull and torque (dDP r/dT about 0.4), growing with load"},
      {"plate_scale", "crosstalk"},
      "three loads or more; a radius sensor; load-deflection on a hard floor",
      {},
      {.starts = starts}};
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
