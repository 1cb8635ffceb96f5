#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"angle", 0.03}}}; }

const Info& info() {
  static const Info out{
      "skew",
      Class::wheel,
      "skew (slip angle)",
      "The wheel points a little across the travel: shear is shared between forward and sideways, and the "
      "side force has a part along the rail.",
      "j_y = r (1 - s)(theta_f - theta) tan(beta), the share j/|(j, j_y)| of tau drives, the share j_y/|(j, j_y)| across it "
      "gives F_y, and DP = DP - |F_y| sin(beta) (cos(beta) taken as 1)",
      "Ishigami et al. 2007, J. Field Robotics 24:233 (lateral displacement)",
      {{"angle", "rad", 0, 0, 0.35, 0.05, 0.05, Scale::linear, true, "between heading and travel"}},
      "shear and wedge forces",
      {-1, -1, 0, false, false, false, false, false, "small loss of pull, growing with load; a side force"},
      {"slope", "bulldozing"},
      "measure the side force; turn the wheel the other way",
      {},
      {.starts = starts}};
  return out;
}

class Skew final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear | kTraction; }
  double shear(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil&, double,
               double tau) const override {
    const double jy = lateral(c, q), j = q.shear_displacement;
    if (!std::isfinite(j) || jy <= 0) return tau;
    const double resultant = std::sqrt(j * j + jy * jy);
    return resultant > 0 ? tau * j / resultant : tau;
  }
  void traction(const bekker::Context& c, const bekker::Point& q, const bekker::LocalSoil& s,
                bekker::Stress& out) const override {
    const double jy = lateral(c, q), j = q.shear_displacement;
    const double resultant = std::sqrt(j * j + jy * jy);
    if (!(resultant > 0) || !std::isfinite(resultant)) return;
    const double tau = (s.cohesion + out.sigma * s.tan_phi) * (1.0 - std::exp(-resultant / s.shear_modulus));
    out.drag += tau * (jy / resultant) * sin_angle_;
  }

 private:
  double lateral(const bekker::Context& c, const bekker::Point& q) const {
    if (!std::isfinite(c.slip)) return 0.0;
    return c.radius * std::max(0.0, 1.0 - c.slip) * std::max(0.0, q.entry_angle - q.theta) * tan_angle_;
  }

  double tan_angle_ = std::tan(p(0)), sin_angle_ = std::sin(p(0));
};

}  // namespace

EffectType skew() { return detail::type_of<Skew, info>(); }

}  // namespace terrode::effects
