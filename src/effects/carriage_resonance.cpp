#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "carriage_resonance",
      Class::rig,
      "resonance of the carriage",
      "Carriage and belt swing at their own frequency.",
      "DP = DP + amplitude sin(2 pi f t)",
      "spring-mass resonance",
      {{"amplitude", "N", 0, 0, 1e4, 2, 2, Scale::linear, true, "in the drawbar channel"},
       {"frequency", "Hz", 5, 0.05, 500, 5, 5, Scale::log, false, "of the swinging"}},
      "rig, by time",
      {0, 0, 0, false, false, false, true, false, "a line at a fixed frequency at every speed and slip"},
      {"periodic_failure", "grousers"},
      "change the speed; tap the carriage with the wheel lifted",
      {},
      {.ripple_alone = true},
      "to and fro between carriage and belt: none over a period"};
  return out;
}

class CarriageResonance final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.phase_average) return;
    r.drawbar_pull += p(0) * std::sin(2.0 * std::numbers::pi * p(1) * m.time);
  }
};

}  // namespace

EffectType carriage_resonance() { return detail::type_of<CarriageResonance, info>(); }

}  // namespace terrode::effects
