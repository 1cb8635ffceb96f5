#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  std::vector<Start> out;
  for (const double share : {0.23, 0.77}) out.push_back({{"gain", 0.1}, {"length", share * at.radius}});
  return out;
}

const Info& info() {
  static const Info out{
      "wall_effect",
      Class::bed,
      "stiffer soil near the ends of the bin",
      "Soil confined by the end walls is stiffer; the effect decays with the distance to the nearer end.",
      "k = k [1 + gain (exp(-x/L) + exp(-(X - x)/L))], X the length of the travel",
      "constructed here",
      {{"gain", "-", 0, -0.5, 10, 0.5, 0.5, Scale::linear, true, "relative stiffening at the wall"},
       {"length", "m", 0.1, 0.01, 1, 0.08, 0.1, Scale::log, false, "over which it decays"}},
      "pressure, by position",
      {0, 0, -1, false, false, true, false, false, "less sinkage near both ends, the same in every run"},
      {"density_gradient", "run_in"},
      "start elsewhere in the bin; measure beyond three widths from the walls",
      {},
      {.starts = starts}};
  return out;
}

class WallEffect final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context& c, bekker::LocalSoil& s) const override {
    const double far = c.travel_length > 0 ? std::exp(-std::max(0.0, c.travel_length - c.position) / p(1)) : 0.0;
    s.k *= 1.0 + p(0) * (std::exp(-std::max(0.0, c.position) / p(1)) + far);
  }
};

}  // namespace

EffectType wall_effect() { return detail::type_of<WallEffect, info>(); }

}  // namespace terrode::effects
