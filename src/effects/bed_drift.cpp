#include <algorithm>
#include <cmath>
#include <numbers>

#include "effects/effect.h"

namespace terrode::effects {
namespace {

const Info& info() {
  static const Info out{
      "bed_drift",
      Class::bed,
      "surface not parallel to the rail",
      "The soil's surface falls away from or rises to the rail, so that the measured sinkage grows along "
      "the travel.",
      "z_measured = z + slope x; a surface that falls: DP = (1 + e) DP + W slope, T = (1 + e) T, e = slope DP/W",
      "geometry",
      {{"slope", "-", 0, -0.1, 0.1, 0.005, 0.005, Scale::linear, true, "sinkage per metre of travel"},
       {"grade", "-", 1, 0, 1, 1, 1, Scale::choice, false, "1: the surface falls, and the wheel rolls down it; 0: the rail rises, and the sinkage is measured from it"}},
      "bed",
      {0, 0, 1, false, false, true, false, false,
       "sinkage linear along the travel, the same in every run; pull up by a small share of the load, torque nearly the same"},
      {"density_gradient", "sensor_drift"},
      "an unloaded pass with the sinkage sensor"};
  return out;
}

class BedDrift final : public Effect {
 public:
  using Effect::Effect;
  bool has_bed() const override { return falls(); }
  double bed_height(double x) const override { return falls() ? -p(0) * x : 0.0; }
  bool measures() const override { return !falls(); }
  void measure(const Sample& m, Reading& r, SensorState&) const override {
    if (!falls()) r.sinkage += p(0) * m.position;
  }
  void quasi_static(const Sample& m, Reading& r) const override {
    if (!falls()) return;
    // The pull is inclined with the bed and so presses or lifts the wheel; forces are taken in proportion to the load.
    const double share = r.drawbar_pull * p(0) / m.context.normal_load;
    r.sinkage += p(0) * m.position;
    r.driving_torque *= 1.0 + share;
    r.drawbar_pull = (1.0 + share) * r.drawbar_pull + m.context.normal_load * p(0);
  }

 private:
  bool falls() const { return p(1) == 1.0; }
};

}  // namespace

EffectType bed_drift() { return detail::type_of<BedDrift, info>(); }

}  // namespace terrode::effects
