#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"factor", 10.0}}}; }

const Info& info() {
  static const Info out{
      "side_friction",
      Class::shear,
      "friction on the sunk side walls",
      "The sides of a sunk wheel rub on the soil beside them.",
      "tau_side = factor K0 gamma D^2 tan(phi) cos(theta)/b, K0 = 1 - sin(phi), D the depth; form 0: tau += tau_side x mobilised "
      "share; form 1: the sides hold the wheel back, the torque grows by tau_side and the pull falls by as much; form 2: the sides "
      "shear as the wheel slips over the whole sunk segment, torque and pull grow by 2 tau_side sign(s)(1 - exp(-|s|/0.05))",
      "constructed here from earth pressure at rest (Jaky 1944); the slip law of form 2 as that of grousers",
      {{"factor", "-", 0, 0, 500, 1, 30, Scale::linear, true, "times earth pressure at rest"},
       {"form", "-", 0, 0, 2, 0, 1, Scale::choice, false, "0: the sides shear with the rim, 1: they drag, 2: they shear as the wheel slips"}},
      "shear",
      {1, 1, 0, false, false, false, false, false, "more torque and pull where the wheel is deep"},
      {"grousers", "interface_friction", "curved_failure_envelope"},
      "a narrow and a wide wheel at the same depth",
      {},
      {.starts = starts}};
  return out;
}

class SideFriction final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return p(1) == 0.0 ? kShear : kTraction; }
  void traction(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil& s, bekker::Stress& out) const override {
    const double side = on_sides(c, q, s);
    if (p(1) == 2.0) {  // the whole sunk segment, of which the arc in contact is the front half
      const double engaged = std::isfinite(c.slip) ? 1.0 - std::exp(-std::abs(c.slip) / 0.05) : 1.0;
      out.drive += (c.slip < 0 ? -2.0 : 2.0) * side * engaged;
      return;
    }
    out.drive += side;
    out.drag += 2.0 * side;
  }
  double shear(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil& s, double sigma,
               double tau) const override {
    const double base = s.cohesion + sigma * s.tan_phi;
    const double share = base > 0 ? tau / base : 0.0;
    return tau + on_sides(c, q, s) * share;
  }

 private:
  // Shear on both side walls per area of rim, Pa.
  double on_sides(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil& s) const {
    const double k0 = 1.0 - s.tan_phi / std::sqrt(1.0 + s.tan_phi * s.tan_phi);
    return p(0) * k0 * s.unit_weight * q.depth * q.depth * s.tan_phi * q.cos_theta / c.width;
  }
};

}  // namespace

EffectType side_friction() { return detail::type_of<SideFriction, info>(); }

}  // namespace terrode::effects
