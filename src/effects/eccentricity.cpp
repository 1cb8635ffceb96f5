#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"eccentricity",
                        Class::wheel,
                        "eccentric wheel",
                        "The axle is off the wheel's centre: sinkage and pull swing once per turn.",
                        "z += e cos(psi), DP += W e sin(psi)/(r (1 - s))",
                        "kinematics of a rolling eccentric",
                        {{"offset", "m", 0, 0, 0.05, 0.001, 0.001, Scale::linear, true, "of the axle"}},
                        "rig: position of the axle",
                        {0, 0, 0, false, false, false, false, true, "a line at one per turn, strongest in sinkage"},
                        {"undulation"},
                        "phase against the encoder at two speeds"};
  return out;
}

class Eccentricity final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.phase_average) return;
    r.sinkage += p(0) * std::cos(m.wheel_angle);
    const double travel = std::isfinite(m.context.slip) ? std::max(0.05, 1.0 - m.context.slip) : 1.0;
    r.drawbar_pull += m.context.normal_load * p(0) * std::sin(m.wheel_angle) / (m.context.radius * travel);
  }
};

}  // namespace

EffectType eccentricity() { return detail::type_of<Eccentricity, info>(); }

}  // namespace terrode::effects
