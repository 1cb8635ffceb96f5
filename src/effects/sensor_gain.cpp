#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "sensor_gain",
      Class::rig,
      "gain of a channel",
      "A channel's scale is off.",
      "y = (1 + gain) y",
      "scale error",
      {{"gain", "-", 0, -0.9, 9, 0.05, 0.05, Scale::linear, true, "relative"},
       {"channel", "-", 0, 0, 2, 0, 1, Scale::choice, false, "0 drawbar pull, 1 driving torque, 2 sinkage"}},
      "sensor",
      {1, 0, 0, false, false, false, false, false, "one channel off in proportion to itself"},
      {"crosstalk", "torque_bias"},
      "dead weights over the range of the channel",
      {},
      {.exact = true}};
  return out;
}

class SensorGain final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample&, Reading& r, SensorState&) const override {
    double& y = p(1) == 0 ? r.drawbar_pull : p(1) == 1 ? r.driving_torque : r.sinkage;
    y *= 1.0 + p(0);
  }
};

}  // namespace

EffectType sensor_gain() { return detail::type_of<SensorGain, info>(); }

}  // namespace terrode::effects
