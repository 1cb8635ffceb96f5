#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  std::vector<Start> out;
  for (const double share : {0.05, 0.1}) out.push_back({{"stiffening", 0.2}, {"depth", share * at.radius}});
  return out;
}

const Info& info() {
  static const Info out{
      "hard_layer",
      Class::compaction,
      "hard layer below",
      "A firmer layer or the bin's floor lies below: pressure rises faster than the power law beyond a "
      "depth.",
      "sigma = sigma [1 + stiffening (z - depth)/depth], z > depth",
      "constructed here",
      {{"stiffening", "-", 0, 0, 50, 1, 1, Scale::linear, true, "relative rise of pressure per depth"},
       {"depth", "m", 0.006, 0.001, 1, 0.006, 0.006, Scale::log, false, "where it begins"}},
      "pressure",
      {0, 0, -1, false, false, false, false, false, "sinkage grows less with load than the power law says"},
      {"plate_scale"},
      "loads that sink the wheel deeper; a plate test to depth",
      {},
      {.starts = starts, .in_soil_tests = true}};
  return out;
}

class HardLayer final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kPressure; }
  double corner() const override { return p(1); }
  double pressure(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil&,
                  double sigma) const override {
    return q.sinkage > p(1) ? sigma * (1.0 + rise_ * (q.sinkage - p(1))) : sigma;
  }

 private:
  double rise_ = p(0) / p(1);
};

}  // namespace

EffectType hard_layer() { return detail::type_of<HardLayer, info>(); }

}  // namespace terrode::effects
