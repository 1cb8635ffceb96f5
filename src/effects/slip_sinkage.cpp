#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "slip_sinkage",
      Class::compaction,
      "slip sinkage",
      "Slip digs: soil under a slipping wheel is carried away and the pressure-sinkage exponent rises with "
      "the slip ratio, so the wheel sinks more at the same load.",
      "form 0: n = n0 + n1 |s|; form 1: the depth at the same pressure times [(1 + |s|)/(1 - |s|/2)]^n1 (beyond s = -1: |s| becomes "
      "2 + 1/s, which ends at 2 for a locked wheel; in form 1 at 1.5)",
      "form 0: Ding et al. 2011, J. Terramechanics 48:27 (exponent that changes with slip); form 1: Lyasko 2010, J. Terramechanics 47:21",
      {{"n1", "-", 0, -0.3, 2, 0.35, 0.4, Scale::linear, true, "growth with slip"},
       {"form", "-", 0, 0, 1, 0, 1, Scale::choice, false, "0: of the exponent, 1: of the depth"}},
      "pressure",
      {0, 0, 1, false, false, false, false, false,
       "sinkage rises with slip, more than in proportion; pull falls at high slip, torque rises a little"},
      {"rear_contact", "penetration_rate", "run_in"},
      "five slips or more up to 0.5 and beyond, with a known sinkage datum"};
  return out;
}

class SlipSinkage final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context& c, bekker::LocalSoil& s) const override {
    const double a = c.slip >= -1 ? std::abs(c.slip) : 2.0 + 1.0 / c.slip;
    if (p(1) == 0.0) {
      s.n += p(0) * a;
    } else {
      const double b = std::min(a, 1.5);
      s.k *= std::pow((1.0 + b) / (1.0 - 0.5 * b), -p(0) * s.n);
    }
  }
};

}  // namespace

EffectType slip_sinkage() { return detail::type_of<SlipSinkage, info>(); }

}  // namespace terrode::effects
