#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"gain", 0.1}, {"passes", 1.5}}}; }

const Info& info() {
  static const Info out{
      "multi_pass",
      Class::compaction,
      "multi-pass compaction",
      "Ground that was driven over is denser: its sinkage modulus grows with every pass, less each time.",
      "k_N = k [1 + gain (1 - exp(-(N - 1)/passes))]",
      "constructed here",
      {{"gain", "-", 0, -0.5, 20, 0.8, 1, Scale::linear, true, "relative growth of k after many passes"},
       {"passes", "-", 1, 0.3, 10, 1.5, 1, Scale::linear, false, "passes over which most of it happens"}},
      "pressure",
      {0, 0, -1, false, true, false, false, false,
       "nothing on the first pass; sinkage falls from pass to pass, less each time"},
      {"density_gradient"},
      "three passes or more at two slips",
      "the steady wheel rolls on level ground whatever the pass; in a simulation the rut of the pass before is there and has been pressed already",
      {.starts = starts}};
  return out;
}

class MultiPass final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context& c, bekker::LocalSoil& s) const override {
    s.k *= 1.0 + p(0) * (1.0 - std::exp(-(c.pass - 1) / p(1)));
  }
};

}  // namespace

EffectType multi_pass() { return detail::type_of<MultiPass, info>(); }

}  // namespace terrode::effects
