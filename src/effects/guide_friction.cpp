#include <fmt/format.h>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{"guide_friction",
                        Class::rig,
                        "friction of the vertical guide",
                        "The vertical guide carries part of the weight: the load on the soil is not the weight on the "
                        "carriage.",
                        "W_soil = W - F",
                        "constructed here",
                        {{"force", "N", 0, -100, 100, 5, 5, Scale::linear, true, "what the guide carries"}},
                        "rig: load",
                        {-1, -1, -1, false, false, false, false, false,
                         "all channels as at a lower load; the measured load, where there is one, shows it"},
                        {"plate_scale", "bulldozing", "rear_contact"},
                        "measure the load at the axle; dead weights; up and down runs"};
  return out;
}

class GuideFriction final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kContact; }
  bool carried_by_rig() const override { return true; }
  void contact(const bekker::Context&, bekker::ContactShape& shape) const override {
    if (!(shape.normal_load > p(0)))
      throw RunError(fmt::format("guide friction of {:.6g} N carries the whole load of {:.6g} N: nothing is left for the soil", p(0),
                                 shape.normal_load));
    shape.normal_load -= p(0);
  }
};

}  // namespace

EffectType guide_friction() { return detail::type_of<GuideFriction, info>(); }

}  // namespace terrode::effects
