#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "undamped_bed",
      Class::numerics,
      "ringing of an undamped bed",
      "A simulated bed of springs without damping rings with the wheel's mass.",
      "z = z + 0.02 z sin(2 pi f t)",
      "artefact of undamped terrains; size constructed here",
      {{"frequency", "Hz", 0, 0, 1000, 20, 20, Scale::linear, true, "sqrt(k_t/m)/(2 pi)"}},
      "numerics, by time",
      {0, 0, 0, false, false, false, true, false, "a line that neither speed nor slip moves, in sinkage first"},
      {"carriage_resonance"},
      "repeat with damping; change the mass",
      {},
      {.ripple_alone = true},
      "to and fro between the wheel and springs of the bed: none over a period"};
  return out;
}

class UndampedBed final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.phase_average) return;
    r.sinkage += 0.02 * m.context.sinkage * std::sin(2.0 * std::numbers::pi * p(0) * m.time);
  }
};

}  // namespace

EffectType undamped_bed() { return detail::type_of<UndampedBed, info>(); }

}  // namespace terrode::effects
