#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"node_ripple",
                        Class::numerics,
                        "ripple of the node spacing",
                        "A simulated bed of separate nodes gives a ripple as the wheel rolls from node to node.",
                        "DP = DP + 0.02 W sin(2 pi x/spacing)",
                        "artefact of discretised terrains; size constructed here",
                        {{"spacing", "m", 0, 0, 0.2, 0.01, 0.01, Scale::linear, true, "of the nodes"}},
                        "numerics, by position",
                        {0, 0, 0, false, false, true, false, false, "a line at speed over spacing in all channels"},
                        {"undulation"},
                        "halve the spacing: the line moves and shrinks"};
  return out;
}

class NodeRipple final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.phase_average) return;
    r.drawbar_pull += 0.02 * m.context.normal_load * std::sin(2.0 * std::numbers::pi * m.position / p(0));
  }
};

}  // namespace

EffectType node_ripple() { return detail::type_of<NodeRipple, info>(); }

}  // namespace terrode::effects
