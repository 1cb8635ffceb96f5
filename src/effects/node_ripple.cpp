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
                        "z = z + spacing^2/(16 r) cos(2 pi x/spacing), DP = DP + W dz/dx",
                        "artefact of discretised terrains; first harmonic of a circle that rolls from point to point, a bound from above",
                        {{"spacing", "m", 0, 0, 0.2, 0.01, 0.01, Scale::linear, true, "of the nodes"}},
                        "numerics, by position",
                        {0, 0, 0, false, false, true, false, false, "a line at speed over spacing"},
                        {"undulation"},
                        "halve the spacing: the line moves and shrinks",
                        {},
                        {.ripple_alone = true},
                        "the load rises and falls: none over a node"};
  return out;
}

class NodeRipple final : public Effect {
 public:
  using Effect::Effect;
  bool measures() const override { return true; }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (m.context.phase_average) return;
    const double phase = 2.0 * std::numbers::pi * m.position / p(0);
    r.sinkage += p(0) * p(0) / (16.0 * m.context.radius) * std::cos(phase);
    r.drawbar_pull -= m.context.normal_load * std::numbers::pi * p(0) / (8.0 * m.context.radius) * std::sin(phase);
  }
};

}  // namespace

EffectType node_ripple() { return detail::type_of<NodeRipple, info>(); }

}  // namespace terrode::effects
