#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "drive_friction",
      Class::rig,
      "friction of bearing and gear",
      "The drive's own friction adds to the torque that the sensor sees, with the sign of the rotation.",
      "T = T + torque sign(omega)",
      "Coulomb friction",
      {{"torque", "N m", 0, -50, 50, 0.3, 0.5, Scale::linear, true, "of bearing and gear"}},
      "rig",
      {0, 1, 0, false, false, false, false, false, "torque off by the same amount in all runs that turn the same way"},
      {"torque_bias"},
      "turn the wheel in air both ways; vary the speed",
      {},
      {},
      "the motor heats bearing and gear: torque |omega|"};
  return out;
}

class DriveFriction final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.angular_velocity != 0) r.driving_torque += m.context.angular_velocity > 0 ? p(0) : -p(0);
  }
};

}  // namespace

EffectType drive_friction() { return detail::type_of<DriveFriction, info>(); }

}  // namespace terrode::effects
