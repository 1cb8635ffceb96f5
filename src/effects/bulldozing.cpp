#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "bulldozing",
      Class::wedge,
      "bulldozing resistance",
      "The wheel pushes a wedge of soil in front of it that fails passively.",
      "R_b = factor b (gamma z^2 N_phi/2 + 2 c z sqrt(N_phi)), as a pressure factor (gamma depth N_phi + 2 "
      "c sqrt(N_phi)) on the projected front",
      "Bekker 1956 (as public codes have it); passive earth pressure (Rankine)",
      {{"factor", "-", 0, 0, 30, 1, 2, Scale::linear, true, "times the passive force of a wedge of wheel width"}},
      "wedge forces",
      {-1, 0, 0, false, false, false, false, false,
       "pull falls, torque and sinkage stay; grows as the square of sinkage"},
      {"slope", "crosstalk", "drawbar_bias"},
      "three loads; reverse the run: a slope changes sign, a wedge does not"};
  return out;
}

class Bulldozing final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kTraction | kLowestCorner; }
  void traction(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil& s,
                bekker::Stress& out) const override {
    if (q.theta <= 0) return;
    const double root = bekker::passive_pressure_root(s.tan_phi);
    out.drag += p(0) * (s.unit_weight * q.depth * root + 2.0 * s.cohesion) * root * q.sin_theta;
  }
};

}  // namespace

EffectType bulldozing() { return detail::type_of<Bulldozing, info>(); }

}  // namespace terrode::effects
