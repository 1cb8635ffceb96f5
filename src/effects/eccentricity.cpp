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
                        "The axle is off the wheel's centre: it rises and falls once per turn, and the drive lifts the load with it. "
                        "The pull stays, but for a modulation of slip by e/r, which is left out.",
                        "z = z + e cos(psi), T = T + W e sin(psi) - DP e cos(psi)",
                        "kinematics and moments about the axle of a rolling eccentric",
                        {{"offset", "m", 0, 0, 0.05, 0.001, 0.001, Scale::linear, true, "of the axle"}},
                        "rig: position of the axle",
                        {0, 0, 0, false, false, false, false, true, "a line at one per turn in sinkage, a quarter turn later in torque"},
                        {"undulation"},
                        "phase against the encoder at two speeds",
                        {},
                        {.ripple_alone = true},
                        "the drive lifts the load and has it back: none over a turn"};
  return out;
}

class Eccentricity final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.phase_average) return;
    r.sinkage += p(0) * std::cos(m.wheel_angle);
    r.driving_torque += p(0) * (m.context.normal_load * std::sin(m.wheel_angle) - r.drawbar_pull * std::cos(m.wheel_angle));
  }
};

}  // namespace

EffectType eccentricity() { return detail::type_of<Eccentricity, info>(); }

}  // namespace terrode::effects
