#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings&) { return {{{"lambda", 0.03}}}; }

const Info& info() {
  static const Info out{
      "rear_contact",
      Class::compaction,
      "contact behind the lowest point",
      "The rut springs back or soil is carried round: the wheel still touches behind its lowest point, and "
      "the pressure there pushes forward.",
      "theta_r = -acos(1 - lambda z/r), near zero -sqrt(2 lambda z/r): smooth in the root of lambda",
      "Ishigami, Miwa, Nagatani & Yoshida 2007, J. Field Robotics 24:233 (as public codes have it)",
      {{"lambda", "-", 0, 0, 1.5, 0.1, 0.2, Scale::linear, true, "height of rear contact over sinkage"}},
      "contact geometry",
      {1, 0, -1, false, false, false, false, false,
       "pull up by an almost constant amount and sinkage down at every slip; torque nearly the same"},
      {"plate_scale", "unloading", "slip_sinkage"},
      "rut depth behind the wheel; unloading the plate",
      {},
      {.starts = starts}};
  return out;
}

class RearContact final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kContact; }
  void contact(const bekker::Context&, bekker::ContactShape& shape) const override { shape.rear_fraction += p(0); }
};

}  // namespace

EffectType rear_contact() { return detail::type_of<RearContact, info>(); }

}  // namespace terrode::effects
