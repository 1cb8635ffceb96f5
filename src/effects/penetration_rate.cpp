#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "penetration_rate",
      Class::compaction,
      "penetration-rate dependence",
      "Soil resists fast penetration more: pressure grows with the velocity at which the wheel's surface "
      "enters.",
      "sigma = sigma [(v_n + 1e-5 m/s)/(0.01 m/s)]^m, v_n at the point that sets the pressure",
      "power law, reference velocity and floor constructed here; that resistance grows with the rate of penetration is "
      "measured in clay: Rate effects on penetrometer resistance in kaolin, 2009 (abstract)",
      {{"m", "-", 0, -0.3, 0.5, 0.05, 0.05, Scale::linear, true, "exponent"}},
      "pressure",
      {0, 0, 1, true, false, false, false, false, "sinkage falls with speed (more than without the effect below an entry of 0.01 m/s, less above), forces hardly change"},
      {"slip_sinkage", "plate_scale"},
      "three speeds over a decade; plate tests at three rates",
      {},
      {.in_soil_tests = true}};
  return out;
}

class PenetrationRate final : public Effect {
 public:
  using Effect::Effect;
  unsigned hooks() const override { return kPressure; }
  double pressure(const bekker::Context&, const bekker::Point& q, const bekker::LocalSoil&,
                  double sigma) const override {
    return sigma * std::exp(p(0) * std::log((q.penetration_speed + 1e-5) / 0.01));  // half the time of pow
  }
};

}  // namespace

EffectType penetration_rate() { return detail::type_of<PenetrationRate, info>(); }

}  // namespace terrode::effects
