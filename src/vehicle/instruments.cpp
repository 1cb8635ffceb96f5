#include "vehicle/instruments.h"

#include <array>
#include <vector>

namespace terrode::vehicle {

void apply_instruments(const effects::EffectSet& effects, const wheel::Rolling& rim, recording::Run& run) {
  namespace ch = recording::channel;
  if (!effects.measures() && !effects.has_bed()) return;
  const auto values = [&run](const char* name) -> std::vector<double>& {
    for (recording::Channel& c : run.channels)
      if (c.name == name) return c.values;
    throw RunError(std::string("the run has no channel '") + name + "' for its instruments");
  };
  std::vector<double>& pull = values(ch::drawbar_pull);
  std::vector<double>& torque = values(ch::driving_torque);
  std::vector<double>& sinkage = values(ch::sinkage);
  std::vector<double>& load = values(ch::normal_load);
  const std::vector<double>& omega = values(ch::angular_velocity);
  const std::vector<double>& speed = values(ch::forward_velocity);
  const std::vector<double>& position = values("position");
  const std::vector<double>& angle = values("wheel_angle");
  const std::vector<double>& slip = values("slip");
  std::vector<effects::SensorState> states(effects.size());
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    effects::Sample s;
    s.time = run.time[i];
    s.position = position[i];
    s.wheel_angle = angle[i];
    s.time_step = i == 0 ? 0.0 : run.time[i] - run.time[i - 1];
    s.context.slip = slip[i];
    s.context.normal_load = run.condition.normal_load.value_or(load[i]);
    s.context.angular_velocity = omega[i];
    s.context.forward_velocity = speed[i];
    s.context.position = position[i];
    s.context.time = run.time[i];
    s.context.pass = run.condition.pass;
    s.context.radius = rim.radius;
    s.context.width = rim.width;
    s.context.sinkage = sinkage[i];
    s.context.wheel_angle = angle[i];
    sinkage[i] -= effects.bed_height(position[i]);  // the rail is the datum, not the bed
    effects::Reading r{pull[i], torque[i], sinkage[i], load[i]};
    effects.measure(s, r, states);
    pull[i] = r.drawbar_pull;
    torque[i] = r.driving_torque;
    sinkage[i] = r.sinkage;
    load[i] = r.normal_load;
  }
}

}  // namespace terrode::vehicle
