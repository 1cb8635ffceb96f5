#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"drawbar_bias",
                        Class::rig,
                        "offset of the drawbar channel",
                        "The drawbar channel has a zero that is off.",
                        "DP = DP + offset",
                        "zero error of a load cell",
                        {{"offset", "N", 0, -1000, 1000, 3, 5, Scale::linear, true, "constant"}},
                        "sensor",
                        {1, 0, 0, false, false, false, false, false, "pull off by the same amount in all runs"},
                        {"slope", "crosstalk", "bulldozing"},
                        "a run in air; two loads",
                        {},
                        {.exact = true}};
  return out;
}

class DrawbarBias final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample&, Reading& r, SensorState&) const override { r.drawbar_pull += p(0); }
};

}  // namespace

EffectType drawbar_bias() { return detail::type_of<DrawbarBias, info>(); }

}  // namespace terrode::effects
