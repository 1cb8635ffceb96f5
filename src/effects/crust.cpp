#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  std::vector<Start> out;
  for (const double share : {0.015, 0.05}) out.push_back({{"strength", 500.0}, {"depth", share * at.radius}});
  return out;
}

const Info& info() {
  static const Info out{
      "crust",
      Class::compaction,
      "crust that breaks",
      "A stiff skin carries load until it breaks: pressure rises to the crust's strength within its depth "
      "and falls after.",
      "sigma = sigma + strength (z/depth) exp(1 - z/depth)",
      "constructed here; a critical pressure at which the surface mat breaks is seen in plate tests: Wong, Terramechanics and "
      "Off-Road Vehicle Engineering 2010, ch. 4 (abstract)",
      {{"strength", "Pa", 0, 0, 1e7, 5e3, 5e3, Scale::linear, true, "pressure the skin carries at most"},
       {"depth", "m", 0.003, 0.0003, 0.3, 0.005, 0.005, Scale::log, false, "sinkage at which it breaks"}},
      "pressure",
      {0, 0, -1, false, false, false, false, false, "light loads sink too little, heavy ones as expected"},
      {"hard_layer", "plate_scale"},
      "a plate test past the break; light loads",
      {},
      {.starts = starts, .in_soil_tests = true}};
  return out;
}

class Crust final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kPressure; }
  double pressure(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil&,
                  double sigma) const override {
    return sigma + p(0) * (q.sinkage / p(1)) * std::exp(1.0 - q.sinkage / p(1));
  }
};

}  // namespace

EffectType crust() { return detail::type_of<Crust, info>(); }

}  // namespace terrode::effects
