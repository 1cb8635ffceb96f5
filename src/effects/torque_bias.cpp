#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"torque_bias",
                        Class::rig,
                        "offset of the torque channel",
                        "The torque channel has a zero that is off.",
                        "T = T + offset",
                        "zero error of a torque sensor",
                        {{"offset", "N m", 0, -100, 100, 0.3, 0.5, Scale::linear, true, "constant"}},
                        "sensor",
                        {0, 1, 0, false, false, false, false, false, "torque off by the same amount in all runs"},
                        {"drive_friction"},
                        "turn the wheel in air both ways: friction changes sign",
                        {},
                        {.exact = true}};
  return out;
}

class TorqueBias final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample&, Reading& r, SensorState&) const override { r.driving_torque += p(0); }
};

}  // namespace

EffectType torque_bias() { return detail::type_of<TorqueBias, info>(); }

}  // namespace terrode::effects
