#include <gtest/gtest.h>

#include <set>

#include "bekker/steady_wheel.h"
#include "effects/effect.h"

namespace terrode::effects {
namespace {

TEST(Effects, EveryIdOfTheDiagnosisContractIsThereOnce) {
  const std::set<std::string> contract = {
      "slip_sinkage", "rear_contact", "unloading", "multi_pass", "plate_scale", "hard_layer", "crust", "penetration_rate",
      "density_gradient", "run_in", "gravity", "pressure_dependent_K", "peak_shear", "interface_friction", "shear_rate",
      "curved_failure_envelope", "side_friction", "grousers", "periodic_failure", "bulldozing", "wall_effect", "bed_drift",
      "undulation", "wheel_flexibility", "slip_offset", "eccentricity", "skew", "slope", "crosstalk", "drawbar_bias",
      "torque_bias", "drive_friction", "guide_friction", "sensor_drift", "sensor_lag", "sensor_gain", "sinkage_datum",
      "carriage_resonance", "node_ripple", "undamped_bed"};
  std::set<std::string> ours;
  for (const EffectType& t : all_effects()) EXPECT_TRUE(ours.emplace(t.info->id).second) << t.info->id;
  EXPECT_EQ(ours, contract);
}

TEST(Effects, NullValuesLeaveAnEmptySet) {
  std::map<std::string, std::map<std::string, double>> nulls;
  for (const EffectType& t : all_effects())
    for (const Parameter& p : t.info->parameters)
      if (p.strength) nulls[std::string(t.info->id)][std::string(p.name)] = p.null_value;
  EXPECT_TRUE(EffectSet(nulls).empty());
}

TEST(Effects, RefusesWhatItDoesNotKnow) {
  using Wanted = std::map<std::string, std::map<std::string, double>>;
  EXPECT_THROW(EffectSet(Wanted{{"slip_sinkag", {}}}), InputError);
  EXPECT_THROW(EffectSet(Wanted{{"slip_sinkage", {{"n2", 0.1}}}}), InputError);
  EXPECT_THROW(EffectSet(Wanted{{"slip_sinkage", {{"n1", 99.0}}}}), InputError);
}

}  // namespace
}  // namespace terrode::effects
