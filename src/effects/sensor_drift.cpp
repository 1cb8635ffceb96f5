#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "sensor_drift",
      Class::rig,
      "drift of a channel",
      "A channel drifts linearly in time within each run.",
      "y = y + rate t (N, N m or mm per second)",
      "temperature drift of a bridge",
      {{"rate", "1/s", 0, -100, 100, 0.1, 0.1, Scale::linear, true, "per second, in N, N m or mm"},
       {"channel", "-", 0, 0, 2, 0, 1, Scale::choice, false, "0 drawbar pull, 1 driving torque, 2 sinkage"}},
      "sensor, by time",
      {1, 0, 0, false, false, false, true, false, "one channel linear in time, whatever the speed"},
      {"density_gradient", "bed_drift", "run_in"},
      "two speeds; hold the wheel still at the end of a run"};
  return out;
}

class SensorDrift final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    double& y = p(1) == 0 ? r.drawbar_pull : p(1) == 1 ? r.driving_torque : r.sinkage;
    y += p(0) * m.time * (p(1) == 2 ? 1e-3 : 1.0);
  }
};

}  // namespace

EffectType sensor_drift() { return detail::type_of<SensorDrift, info>(); }

}  // namespace terrode::effects
