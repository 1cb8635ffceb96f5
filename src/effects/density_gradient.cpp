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
      "form 0: k = k0 (1 + g x), at least 0.02 k0; form 1: k = k0 exp(g x), from 0.02 k0 to 50 k0",
      "constructed here",
      {{"g", "1/m", 0, -5, 20, 1, 1, Scale::linear, true, "relative change of k per metre"},
       {"form", "-", 0, 0, 1, 0, 1, Scale::choice, false, "0: linear along the travel, 1: exponential"}},
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
  void soil(const bekker::Context& c, bekker::LocalSoil& s) const override {
    s.k *= p(1) == 0.0 ? std::max(0.02, 1.0 + p(0) * c.position) : std::clamp(std::exp(p(0) * c.position), 0.02, 50.0);
  }
};

}  // namespace

EffectType density_gradient() { return detail::type_of<DensityGradient, info>(); }

}  // namespace terrode::effects
