#include "effects/steady_reading.h"

namespace terrode::effects {

Reading reading_of(const bekker::SteadyWheel& wheel, const EffectSet& effects, const bekker::Operating& operating,
                   const bekker::SteadyState& state) {
  Reading reading{state.drawbar_pull, state.driving_torque, state.sinkage, state.normal_load};
  if (effects.empty()) return reading;
  Sample sample;
  sample.context = wheel.context(operating);
  sample.context.sinkage = state.sinkage;
  sample.time = operating.time;
  sample.position = operating.position;
  sample.wheel_angle = operating.wheel_angle;
  effects.quasi_static(sample, reading);
  effects.measure(sample, reading);
  return reading;
}

Reading reading_at(const bekker::SteadyWheel& wheel, const EffectSet& effects, const bekker::Operating& operating) {
  return reading_of(wheel, effects, operating, wheel.solve(operating));
}

Reading steady_reading(const bekker::SteadyWheel& wheel, const EffectSet& effects, bekker::Operating operating) {
  operating.phase_average = true;
  return reading_at(wheel, effects, operating);
}

}  // namespace terrode::effects
