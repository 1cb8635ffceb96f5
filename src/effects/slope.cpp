#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"slope",
                        Class::rig,
                        "slope of bed or rail",
                        "The bed or the rail is tilted: part of the weight pulls along the travel.",
                        "DP = DP - W sin(angle)",
                        "statics",
                        {{"angle", "rad", 0, -0.5, 0.5, 0.0175, 0.02, Scale::linear, true, "uphill positive"}},
                        "rig",
                        {-1, 0, 0, false, false, false, false, false,
                         "pull off by a share of the load at every slip; torque and sinkage stay"},
                        {"crosstalk", "drawbar_bias", "bulldozing"},
                        "reverse the run: a slope changes sign, cross-talk does not",
                        {},
                        {.exact = true},
                        "the load is lifted: W v sin(angle)"};
  return out;
}

class Slope final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    r.drawbar_pull -= m.context.normal_load * std::sin(p(0));
  }
};

}  // namespace

EffectType slope() { return detail::type_of<Slope, info>(); }

}  // namespace terrode::effects
