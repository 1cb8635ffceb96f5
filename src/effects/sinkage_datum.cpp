#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"sinkage_datum",
                        Class::rig,
                        "sinkage datum",
                        "The zero of the sinkage channel is off, the same in all runs.",
                        "z = z + offset",
                        "zero error",
                        {{"offset", "m", 0, -0.1, 0.1, 0.003, 0.003, Scale::linear, true, "constant"}},
                        "sensor",
                        {0, 0, 1, false, false, false, false, false, "sinkage off by the same amount in all runs"},
                        {"plate_scale", "rear_contact"},
                        "touch the surface before each run",
                        {},
                        {.exact = true}};
  return out;
}

class SinkageDatum final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample&, Reading& r, SensorState&) const override { r.sinkage += p(0); }
};

}  // namespace

EffectType sinkage_datum() { return detail::type_of<SinkageDatum, info>(); }

}  // namespace terrode::effects
