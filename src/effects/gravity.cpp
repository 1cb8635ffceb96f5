#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "gravity",
      Class::compaction,
      "gravity",
      "At another gravity than believed, the frictional part of the sinkage modulus and the soil's weight "
      "change in proportion.",
      "k = k g/9.81, gamma = gamma g/9.81, where soil tests were made at 9.81",
      "proportional scaling of the frictional modulus; constructed here",
      {{"g", "m/s^2", 9.81, 0.1, 100, 1.62, 3, Scale::linear, true, "gravity that acts on the soil"}},
      "pressure",
      {0, 0, 1, false, false, false, false, false, "one factor on k"},
      {"plate_scale"},
      "soil tests at the same gravity as the wheel"};
  return out;
}

class Gravity final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context&, bekker::LocalSoil& s) const override {
    s.k *= p(0) / 9.81;
    s.unit_weight *= p(0) / 9.81;
  }
};

}  // namespace

EffectType gravity() { return detail::type_of<Gravity, info>(); }

}  // namespace terrode::effects
