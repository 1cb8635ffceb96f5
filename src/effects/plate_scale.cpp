#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "plate_scale",
      Class::compaction,
      "plate-to-wheel scale",
      "The wheel's contact has another size and shape than the plate that k was measured with, so its k "
      "differs by one factor.",
      "k_wheel = factor k_plate",
      "one factor, constructed here; that a flat plate misjudges wheels of small diameter: Meirion-Griffith & Spenko 2011, J. "
      "Terramechanics 48:149",
      {{"factor", "-", 1, 0.05, 20, 0.8, 0.3, Scale::linear, true, "k of the wheel over k of the plate"}},
      "pressure",
      {0, 0, 1, false, false, false, false, false, "one factor on k in all runs: only a plate test disagrees"},
      {"gravity", "hard_layer"},
      "two wheel diameters or plate sizes"};
  return out;
}

class PlateScale final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context&, bekker::LocalSoil& s) const override { s.k *= p(0); }
};

}  // namespace

EffectType plate_scale() { return detail::type_of<PlateScale, info>(); }

}  // namespace terrode::effects
