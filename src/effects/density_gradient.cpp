#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "density_gradient",
      Class::bed,
      "density gradient along the bed",
      "The soil was prepared denser towards one end: its sinkage modulus changes linearly along the travel.",
      "k = k0 (1 + g x), at least 0.02 k0",
      "constructed here",
      {{"g", "1/m", 0, -5, 20, 1, 1, Scale::linear, true, "relative change of k per metre"}},
      "pressure, by position",
      {0, 0, -1, false, false, true, false, false,
       "sinkage changes along the travel at the same place in every run, pull with it"},
      {"bed_drift", "wall_effect", "sensor_drift"},
      "two speeds, or another starting point: position against time",
      "the steady wheel is in equilibrium at every place; a rolling one lags behind the ground that stiffens by a part of its contact, and is lifted as it goes"};
  return out;
}

class DensityGradient final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context& c, const bekker::Point&, bekker::LocalSoil& s) const override {
    s.k *= std::max(0.02, 1.0 + p(0) * c.position);
  }
};

}  // namespace

EffectType density_gradient() { return detail::type_of<DensityGradient, info>(); }

}  // namespace terrode::effects
