#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "capillary_cohesion",                      // id: what files and reports say
      Class::shear,
      "capillary cohesion",                      // the field's name
      "Water between the grains pulls them together: a little moisture adds to the cohesion.",
      "c = c0 + suction tan(phi)",
      "constructed here: suction counts as a normal stress that the load does not see",
      {{"suction", "Pa", 0, 0, 2e4, 1e3, 1e3, Scale::linear, true, "effective suction of the pore water"}},
      "shear",                                   // where it acts
      {1, 1, 0, false, false, false, false, false, "pull and torque up by an amount that grows less than the load"},
      {"drawbar_bias", "interface_friction"},    // confused with
      "a shear box on the moist soil; lighter loads"};
  return out;
}

class CapillaryCohesion final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kSoil; }
  void soil(const bekker::Context&, bekker::LocalSoil& s) const override {
    s.cohesion += p(0) * s.tan_phi;
  }
};

}  // namespace

EffectType capillary_cohesion() { return detail::type_of<CapillaryCohesion, info>(); }

}  // namespace terrode::effects
