#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"curved_failure_envelope",
                        Class::shear,
                        "curved failure envelope",
                        "The friction angle falls as the normal stress rises.",
                        "phi = phi0 - dphi log10(sigma/10 kPa), within 0 and 80 deg, sigma taken as 1 Pa at least",
                        "form of Duncan 2004, Friction Angles for Sand, Gravel and Rockfill (lecture): a fall of phi for "
                        "every tenfold of stress (there the minor principal stress over the atmosphere's)",
                        {{"dphi", "rad", 0, -0.2, 0.4, 0.07, 0.07, Scale::linear, true,
                          "fall of the friction angle per decade of stress"}},
                        "shear",
                        {-1, -1, 0, false, false, false, false, false, "pull over load falls with load"},
                        {"interface_friction"},
                        "loads over a factor of five; a shear box from 1 to 20 kPa",
      {},
      {.in_soil_tests = true}};
  return out;
}

class CurvedFailureEnvelope final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear; }
  double shear(const bekker::Context&, const bekker::Point&, const bekker::LocalSoil& s, double sigma,
               double tau) const override {
    const double base = s.cohesion + sigma * s.tan_phi;
    return base > 0 ? tau * (s.cohesion + sigma * tan_less(s.tan_phi, per_fold_ * std::log(std::max(sigma, 1.0) / 1e4))) / base : tau;
  }

 private:
  // Tangent of the friction angle less `fall`, the angle held within 0 and 1.4 rad.
  static double tan_less(double tan_phi, double fall) {
    constexpr double kLargest = 5.797883715482887;  // tan(1.4)
    if (std::abs(fall) > 0.5) return std::tan(std::clamp(std::atan(tan_phi) - fall, 0.0, 1.4));
    // tan(fall) as a Pade approximant, to 2e-15 here.
    const double x = fall * fall, sine = fall * (135135.0 - x * (17325.0 - x * (378.0 - x))),
                 cosine = 135135.0 - x * (62370.0 - x * (3150.0 - 28.0 * x));
    const double over = tan_phi * cosine - sine, under = cosine + tan_phi * sine;
    return over <= 0 ? 0.0 : over < kLargest * under ? over / under : kLargest;
  }

  double per_fold_ = p(0) / std::numbers::ln10;
};

}  // namespace

EffectType curved_failure_envelope() { return detail::type_of<CurvedFailureEnvelope, info>(); }

}  // namespace terrode::effects
