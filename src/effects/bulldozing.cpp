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
      "form 0: R_b = factor b (gamma z^2 N_phi/2 + 2 c z sqrt(N_phi)); form 1: R_b = factor b (cot Xc + tan(Xc + phi)) [c z + gamma z^2/2 "
      "(cot Xc + cot^2 Xc tan phi)], Xc = 45 deg - phi/2; as a pressure dR_b/(b dz) on the projected front",
      "form 0: Bekker 1956 (as public codes have it), passive earth pressure (Rankine); form 1: Hegedus 1960 (as Ishigami et al. 2007 use it)",
      {{"factor", "-", 0, 0, 30, 1, 2, Scale::linear, true, "times the passive force of a wedge of wheel width"},
       {"form", "-", 0, 0, 1, 0, 1, Scale::choice, false, "0: Rankine's wedge, 1: Hegedus' blade"}},
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
    const double root = bekker::passive_pressure_root(s.tan_phi);  // cot Xc and tan(Xc + phi) as well
    const double weight = p(1) == 0.0 ? root : 2.0 * root * (1.0 + root * s.tan_phi);
    out.drag += p(0) * (s.unit_weight * q.depth * weight + 2.0 * s.cohesion) * root * q.sin_theta;
  }
};

}  // namespace

EffectType bulldozing() { return detail::type_of<Bulldozing, info>(); }

}  // namespace terrode::effects
