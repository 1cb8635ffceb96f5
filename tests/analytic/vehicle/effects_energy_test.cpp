// Books of energy of a rig on node-spring ground with each effect of soil, wheel, wedges and bed.
#include <gtest/gtest.h>

#include "effects/effect.h"
#include "terrain/node_spring.h"
#include "terrain/surface.h"
#include "vehicle/rig.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {
namespace {

// The ground's height as the effects of the bed shape it.
class Bed final : public terrain::Surface {
 public:
  explicit Bed(const effects::EffectSet& effects) : effects_(effects) {}
  double height(double x, double) const override { return effects_.bed_height(x); }
  Eigen::Vector2d gradient(double x, double) const override {
    return {(effects_.bed_height(x + 1e-5) - effects_.bed_height(x - 1e-5)) / 2e-5, 0.0};
  }

 private:
  const effects::EffectSet& effects_;
};

TEST(EffectsInTime, BooksOfEnergyCloseWithEach) {
  int held = 0;
  for (const auto& type : effects::all_effects()) {
    SCOPED_TRACE(std::string(type.info->id));
    const effects::EffectSet set(std::map<std::string, std::map<std::string, double>>{{std::string(type.info->id), {}}});
    const effects::EffectSet ground = set.for_ground();
    if (ground.modifiers().empty() && !ground.has_bed()) continue;
    bekker::PointLaw law;
    law.modifiers = ground.modifiers();
    terrain::NodeSpringParams params;
    params.spacing = 0.01;
    params.soil.shear_modulus = 0.008;
    params.travel_length = 0.1;
    std::shared_ptr<const terrain::Surface> surface;
    if (ground.has_bed()) surface = std::make_shared<Bed>(ground);
    RigMotion motion;
    motion.slip = 0.3;
    motion.duration = 2.0;
    Rig rig({}, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{0.13, 0.16, 0.0, {}}),
            std::make_unique<terrain::NodeSpringTerrain>(params, law, surface));
    rig.touch_down();
    while (!rig.finished()) rig.step();
    const RigEnergy e = rig.energy();
    constexpr double audit = 2e-3;  // of the work put in: forces are taken as even over a step of 1 ms
    EXPECT_NEAR(e.machine_residual(), 0.0, audit * e.drive);
    EXPECT_NEAR(e.ground_residual(), 0.0, audit * e.ground);
    EXPECT_GT(e.plastic, 0.0);
    EXPECT_GT(e.slip, 0.0);
    ++held;
  }
  EXPECT_GE(held, 20);
}

}  // namespace
}  // namespace terrode::vehicle
