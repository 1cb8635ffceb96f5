#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  std::vector<Start> out;
  for (const double share : {0.95, 0.8, 0.5}) out.push_back({{"delta", std::atan(share * std::tan(at.friction_angle))}, {"adhesion", 0.0}});
  return out;
}

const Info& info() {
  static const Info out{
      "interface_friction",
      Class::shear,
      "friction limit of the wheel's surface",
      "A smooth wheel slides on the soil before the soil shears: shear stress is limited by adhesion and "
      "interface friction.",
      "tau = min(tau, c_a + sigma tan(delta))",
      "Mohr-Coulomb limit of the interface; Shikanai et al. 2000, J. Terramechanics 37:21 compare surfaces",
      {{"delta", "rad", std::numbers::pi / 2, 0.02, std::numbers::pi / 2, 0.45, 0.3, Scale::linear, true, "friction angle of the surface"},
       {"adhesion", "Pa", 0, 0, 1e4, 0, 100, Scale::linear, false, "adhesion of the surface"}},
      "shear",
      {-1, -1, 0, false, false, false, false, false,
       "pull and torque saturate low at high slip, in proportion to load; the shear box disagrees"},
      {"curved_failure_envelope"},
      "a soil-coated wheel; a shear box on the wheel's surface",
      {},
      {.starts = starts}};
  return out;
}

class InterfaceFriction final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kShear | kShearCorner; }
  double shear_corner(const bekker::Context&, const bekker::Point&, const bekker::LocalSoil&, double sigma, double tau) const override {
    const double limit = p(1) + sigma * tan_delta_;
    return limit > 0 ? 1.0 - tau / limit : -1.0;
  }
  double shear(const bekker::Context&, const bekker::Point&, const bekker::LocalSoil&, double sigma, double tau) const override {
    return std::min(tau, std::max(p(1) + sigma * tan_delta_, 0.0));
  }

 private:
  double tan_delta_ = std::tan(p(0));
};

}  // namespace

EffectType interface_friction() { return detail::type_of<InterfaceFriction, info>(); }

}  // namespace terrode::effects
