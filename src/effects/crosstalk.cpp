#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "crosstalk",
      Class::rig,
      "cross-talk of the load cell",
      "A share of the load leaks into the drawbar channel.",
      "DP = DP + fraction W",
      "linear cross-talk of a multi-axis load cell",
      {{"fraction", "-", 0, -0.3, 0.3, 0.02, 0.02, Scale::linear, true, "of the load in the drawbar channel"}},
      "sensor",
      {1, 0, 0, false, false, false, false, false, "pull off by a share of the load"},
      {"slope", "drawbar_bias"},
      "dead weights on three axes; reverse the run",
      {},
      {.exact = true}};
  return out;
}

class Crosstalk final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    r.drawbar_pull += p(0) * m.context.normal_load;
  }
};

}  // namespace

EffectType crosstalk() { return detail::type_of<Crosstalk, info>(); }

}  // namespace terrode::effects
