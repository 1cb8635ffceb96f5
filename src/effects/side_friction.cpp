#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "side_friction",
      Class::shear,
      "friction on the sunk side walls",
      "The sides of a sunk wheel rub on the soil beside them.",
      "tau += factor K0 gamma D^2 tan(phi) cos(theta)/b x mobilised share, K0 = 1 - sin(phi), D the depth",
      "constructed here from earth pressure at rest (Jaky 1944)",
      {{"factor", "-", 0, 0, 10, 1, 1, Scale::linear, true, "times earth pressure at rest"}},
      "shear",
      {1, 1, 0, false, false, false, false, false, "more torque and pull where the wheel is deep"},
      {"interface_friction", "curved_failure_envelope"},
      "a narrow and a wide wheel at the same depth"};
  return out;
}

class SideFriction final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear; }
  double shear(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil& s, double sigma,
               double tau) const override {
    const double base = s.cohesion + sigma * s.tan_phi;
    const double share = base > 0 ? tau / base : 0.0;
    const double k0 = 1.0 - s.tan_phi / std::sqrt(1.0 + s.tan_phi * s.tan_phi);
    return tau + p(0) * k0 * s.unit_weight * q.depth * q.depth * s.tan_phi * q.cos_theta / c.width * share;
  }
};

}  // namespace

EffectType side_friction() { return detail::type_of<SideFriction, info>(); }

}  // namespace terrode::effects
