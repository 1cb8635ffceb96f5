#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

std::vector<Start> starts(const Surroundings& at) {
  std::vector<Start> out;
  // Over a run of several waves a fit finds its way from a length that is off by a tenth.
  for (double share = 0.3; share < 4.0; share *= 1.12) out.push_back({{"amplitude", 5e-4}, {"wavelength", share * at.radius}});
  return out;
}

const Info& info() {
  static const Info out{
      "undulation",
      Class::bed,
      "undulating surface",
      "The surface waves along the travel: the wheel follows it, climbing and descending.",
      "z_measured = z - A sin(2 pi x/L); DP = (1 + e) DP - W dz0/dx, T = (1 + e) T, e = -dz0/dx DP/W",
      "geometry",
      {{"amplitude", "m", 0, 0, 0.05, 0.002, 0.002, Scale::linear, true, "of the wave"},
       {"wavelength", "m", 0.2, 0.01, 5, 0.2, 0.2, Scale::log, false, "along the travel"}},
      "bed",
      {0, 0, 0, false, false, true, false, false, "sinkage and pull wave with position, a quarter wave apart"},
      {"density_gradient"},
      "a profile of the fresh bed",
      "the contact is a third of a wave long and evens it out; the steady wheel takes it as a point",
      {.starts = starts}};
  return out;
}

class Undulation final : public Effect {
 public:
  using Effect::Effect;
  bool has_bed() const override { return true; }
  double bed_height(double x) const override { return p(0) * std::sin(2.0 * std::numbers::pi * x / p(1)); }
  void quasi_static(const Sample& m, Reading& r) const override {
    if (m.context.phase_average) return;
    const double phase = 2.0 * std::numbers::pi * m.position / p(1);
    r.sinkage -= p(0) * std::sin(phase);
    // As on a bed that falls: the inclined pull presses or lifts the wheel.
    const double fall = -p(0) * 2.0 * std::numbers::pi / p(1) * std::cos(phase), share = r.drawbar_pull * fall / m.context.normal_load;
    r.driving_torque *= 1.0 + share;
    r.drawbar_pull = (1.0 + share) * r.drawbar_pull + m.context.normal_load * fall;
  }
};

}  // namespace

EffectType undulation() { return detail::type_of<Undulation, info>(); }

}  // namespace terrode::effects
