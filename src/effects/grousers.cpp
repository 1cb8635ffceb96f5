#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  // Lugs cannot hide from a series: without a line at a whole order there are none.
  if (at.lugs == 0 && at.lugs_would_show) return {};
  return {{{"height", 0.002}, {"count", at.lugs > 0 ? at.lugs : 24.0}}};
}

const Info& info() {
  static const Info out{
      "grousers",
      Class::wedge,
      "grousers (lugs)",
      "Lugs push the soil between them: each adds the passive force on its face, and the pull ripples as "
      "they enter one after another.",
      "form 0: drive = (count h/(2 pi r)) [N_phi (gamma (depth + h)/2 + 0.06 sigma) + 2 c sqrt(N_phi) + 0.4 k (h/b)^n] "
      "sign(s)(1 - exp(-|s|/0.1)) (1 + 0.1 sin(count psi)); form 1: drive = (h/(2 r)) tau, with the same law of slip and ripple",
      "passive earth pressure (Rankine) on the face of each lug, spread over the rim, the bearing of the lug's face (0.4 of a plate "
      "pushed as deep as the lug is high), the share of sigma and the slip law constructed here; ripple of lugs: Irani, "
      "Bauer & Warkentin 2011, J. Terramechanics 48:307; form 1: the soil shears at r + h/2 (Ding et al. 2011), its torque and pull "
      "grown in proportion",
      {{"height", "m", 0, 0, 0.2, 0.008, 0.01, Scale::linear, true, "of a lug above the rim"},
       {"count", "-", 24, 1, 500, 24, 1, Scale::choice, false, "lugs around the wheel"},
       {"form", "-", 0, 0, 1, 0, 1, Scale::choice, false, "0: wedges behind the lugs, 1: a shearing radius"}},
      "wedge forces",
      {1, 1, 0, false, false, false, false, true,
       "pull and torque grow with slip and then stay; a line at the whole order `count` of the wheel"},
      {"slip_offset", "interface_friction", "peak_shear"},
      "order spectrum at ten times the lug rate; slips above 0.2",
      {},
      {.starts = starts}};
  return out;
}

class Grousers final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kTraction; }
  void traction(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil& s,
                bekker::Stress& out) const override {
    const double a = std::isfinite(c.slip) ? 1.0 - std::exp(-std::abs(c.slip) / 0.1) : 1.0;
    const double ripple = c.phase_average ? 1.0 : 1.0 + 0.1 * std::sin(p(1) * c.wheel_angle);
    const double engaged = (c.slip < 0 ? -a : a) * ripple;
    if (p(2) != 0.0) {
      out.drive += 0.5 * p(0) / c.radius * out.tau * engaged;
      return;
    }
    const double root = bekker::passive_pressure_root(s.tan_phi);
    const double face = root * (root * (0.5 * s.unit_weight * (q.depth + p(0)) + 0.06 * out.sigma) + 2.0 * s.cohesion) +
                        0.4 * s.k * std::exp(s.n * std::log(p(0) / s.plate_width));
    out.drive += p(1) * p(0) / (2.0 * std::numbers::pi * c.radius) * face * engaged;
  }
};

}  // namespace

EffectType grousers() { return detail::type_of<Grousers, info>(); }

}  // namespace terrode::effects
