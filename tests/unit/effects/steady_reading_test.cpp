#include "effects/steady_reading.h"

#include <gtest/gtest.h>

#include <numbers>

namespace terrode::effects {
namespace {

using Wanted = std::map<std::string, std::map<std::string, double>>;

constexpr double kSolver = 1e-7;  // relative: two solutions of the steady wheel agree to its tolerance

struct Model {
  EffectSet effects;
  bekker::SteadyWheel wheel;
  explicit Model(const Wanted& wanted = {})
      : effects(wanted), wheel({0.13, 0.16}, soil(), {}, {nullptr, nullptr, effects.modifiers()}) {}
  static bekker::Soil soil() {
    bekker::Soil s;
    s.shear_modulus = 0.008;
    return s;
  }
};

bekker::Operating operating() {
  bekker::Operating o;
  o.slip = 0.3;
  o.position = 0.31;
  o.time = 7.3;
  o.wheel_angle = 5.1;
  o.travel_length = 1.0;
  return o;
}

TEST(SteadyReading, WithoutEffectsIsTheSteadySolution) {
  const Model m;
  const bekker::SteadyState s = m.wheel.solve(operating());
  const Reading r = steady_reading(m.wheel, m.effects, operating());
  EXPECT_EQ(r.drawbar_pull, s.drawbar_pull);
  EXPECT_EQ(r.driving_torque, s.driving_torque);
  EXPECT_EQ(r.sinkage, s.sinkage);
  EXPECT_EQ(r.normal_load, s.normal_load);
}

TEST(SteadyReading, MeansDoNotDependOnTheWheelsAngleAndTakeRipplesAsZero) {
  const Model plain;
  for (const char* id : {"periodic_failure", "eccentricity", "undulation", "carriage_resonance", "node_ripple", "undamped_bed",
                         "run_in", "sensor_lag"}) {
    const Model m(Wanted{{id, {}}});
    const Reading base = steady_reading(plain.wheel, plain.effects, operating());
    const Reading r = steady_reading(m.wheel, m.effects, operating());
    EXPECT_NEAR(r.drawbar_pull, base.drawbar_pull, kSolver * 115) << id;
    EXPECT_NEAR(r.driving_torque, base.driving_torque, kSolver * 15) << id;
    EXPECT_NEAR(r.sinkage, base.sinkage, kSolver * base.sinkage) << id;
  }
  const Model lugs(Wanted{{"grousers", {}}});
  bekker::Operating turned = operating();
  turned.wheel_angle += 0.05;
  EXPECT_EQ(steady_reading(lugs.wheel, lugs.effects, operating()).drawbar_pull,
            steady_reading(lugs.wheel, lugs.effects, turned).drawbar_pull);
}

// An instant's readings, averaged over a period, are the mean that steady_reading() gives: to first order in the ripple.
TEST(SteadyReading, InstantsAverageToTheMean) {
  constexpr double kSecondOrder = 0.01;  // of the load: squares of the ripples, which the mean leaves out
  for (const char* id : {"periodic_failure", "eccentricity", "grousers"}) {
    const Model m(Wanted{{id, {}}});
    const Reading mean = steady_reading(m.wheel, m.effects, operating());
    double pull = 0.0, sinkage = 0.0, spread = 0.0;
    constexpr int kCount = 400;
    // Ten turns, which hold whole periods of a lug and of an eccentric and many of a block of soil.
    for (int i = 0; i < kCount; ++i) {
      bekker::Operating o = operating();
      o.wheel_angle = 20.0 * std::numbers::pi * (i + 0.5) / kCount;
      const Reading r = reading_at(m.wheel, m.effects, o);
      pull += r.drawbar_pull / kCount;
      sinkage += r.sinkage / kCount;
      spread = std::max(spread, std::abs(r.drawbar_pull - mean.drawbar_pull) + 1e3 * std::abs(r.sinkage - mean.sinkage));
    }
    EXPECT_NEAR(pull, mean.drawbar_pull, kSecondOrder * 115) << id;
    EXPECT_NEAR(sinkage, mean.sinkage, kSecondOrder * mean.sinkage) << id;
    EXPECT_GT(spread, 0.1) << id;
  }
}

TEST(SteadyReading, TrendsAreTakenAtPlaceAndTime) {
  const Model plain;
  const Reading base = steady_reading(plain.wheel, plain.effects, operating());
  const Model drift(Wanted{{"sensor_drift", {{"rate", 0.5}}}});
  EXPECT_DOUBLE_EQ(steady_reading(drift.wheel, drift.effects, operating()).drawbar_pull, base.drawbar_pull + 0.5 * 7.3);
  const Model bed(Wanted{{"bed_drift", {{"slope", 0.01}}}});
  EXPECT_DOUBLE_EQ(steady_reading(bed.wheel, bed.effects, operating()).sinkage, base.sinkage + 0.01 * 0.31);
  EXPECT_FALSE(bed.effects.soil_varies());
  const Model dense(Wanted{{"density_gradient", {}}});
  EXPECT_LT(steady_reading(dense.wheel, dense.effects, operating()).sinkage, base.sinkage);
  EXPECT_TRUE(dense.effects.soil_varies());
}

}  // namespace
}  // namespace terrode::effects
