#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "slip_offset",
      Class::wheel,
      "slip offset",
      "The radius or a speed is not what the slip was computed from (a tyre of another rolling radius, lugs "
      "that carry, an encoder's scale): every slip is shifted.",
      "s' = min(s + ds, 1)",
      "kinematics; Wong & Reece 1967 for s",
      {{"ds", "-", 0, -0.3, 0.3, 0.03, 0.03, Scale::linear, true, "what the soil sees more than the commanded slip"}},
      "contact geometry",
      {1, 1, 1, false, false, false, false, false,
       "follows the slope of the curves over slip: largest near zero slip, gone on the plateau"},
      {"peak_shear", "grousers", "pressure_dependent_K"},
      "points of zero torque and of zero pull on a hard floor; slips below 0.1"};
  return out;
}

class SlipOffset final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kContact; }
  bool carried_by_rig() const override { return true; }
  void contact(const bekker::Context&, bekker::ContactShape& shape) const override {
    if (std::isfinite(shape.slip)) shape.slip = std::min(1.0, shape.slip + p(0));
  }
};

}  // namespace

EffectType slip_offset() { return detail::type_of<SlipOffset, info>(); }

}  // namespace terrode::effects
