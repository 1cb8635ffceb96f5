#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"tau", 0.1}}}; }

const Info& info() {
  static const Info out{
      "sensor_lag",
      Class::rig,
      "lag of a channel",
      "A channel answers late, as behind a low-pass filter of first order.",
      "tau dy/dt = x - y",
      "first-order low-pass",
      {{"tau", "s", 0, 0, 10, 0.1, 0.2, Scale::linear, true, "time constant"},
       {"channel", "-", 0, 0, 2, 0, 1, Scale::choice, false, "0 drawbar pull, 1 driving torque, 2 sinkage"}},
      "sensor, by time",
      {0, 0, 0, false, false, false, false, false, "ripple of one channel small and late; means stay"},
      {},
      "phase between channels over frequency; a step",
      {},
      {.starts = starts, .needs_series = true}};
  return out;
}

class SensorLag final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState& state) const override {
    double& y = p(1) == 0 ? r.drawbar_pull : p(1) == 1 ? r.driving_torque : r.sinkage;
    if (!state.started || m.time_step <= 0) {
      state.started = true;
      state.memory[0] = y;
    }
    state.memory[0] += (1.0 - std::exp(-m.time_step / p(0))) * (y - state.memory[0]);
    y = state.memory[0];
  }
};

}  // namespace

EffectType sensor_lag() { return detail::type_of<SensorLag, info>(); }

}  // namespace terrode::effects
