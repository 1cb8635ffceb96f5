// What of the contact law LIGGGHTS takes, in its words, and what is refused by name.
#include "liggghts/law.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "liggghts/liggghts_terrain.h"
#include "liggghts/ranks.h"

namespace terrode::liggghts {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

dem::DemTerrainParams expressible() {
  dem::DemTerrainParams p;
  p.soil.rolling = "epsd2_unprojected";
  p.soil.friction = 0.5;
  p.soil.rolling_friction = 0.2;
  p.wheel = p.soil;
  p.wheel.friction = 0.4;
  p.wheel.rolling_friction = 0.0;
  return p;
}

std::vector<std::string> keys(const dem::DemTerrainParams& p, const std::vector<std::string>& approximate = {}) {
  std::vector<std::string> out;
  for (const Problem& problem : law_problems(p, approximate)) {
    EXPECT_THAT(problem.message, HasSubstr("LIGGGHTS cannot express"));
    EXPECT_FALSE(problem.expected.empty());
    out.push_back(problem.key);
  }
  return out;
}

TEST(LiggghtsLaw, SaysTheSameNumbersInItsWords) {
  const dem::DemTerrainParams p = expressible();
  EXPECT_THAT(keys(p), IsEmpty());
  EXPECT_EQ(law_model(p), "hertz tangential history rolling_friction epsd2");
  const auto lines = law_commands(p);
  EXPECT_THAT(lines, Contains("fix young all property/global youngsModulus peratomtype 70000000 70000000 70000000"));
  EXPECT_THAT(lines, Contains("fix friction all property/global coefficientFriction peratomtypepair 3 0.5 0 0.40000000000000002 0 0 0 "
                              "0.40000000000000002 0 0.40000000000000002"));
  EXPECT_THAT(lines, Contains("fix rolling all property/global coefficientRollingFriction peratomtypepair 3 0.20000000000000001 0 0 0 0 0 0 0 0"));
  EXPECT_EQ(lines.back(), "pair_coeff * *");
  dem::DemTerrainParams plain = p;
  plain.soil.rolling = plain.wheel.rolling = "none";
  EXPECT_EQ(law_model(plain), "hertz tangential history");
}

TEST(LiggghtsLaw, RefusesEachDepartureByItsKeyUnlessItIsNamed) {
  dem::DemTerrainParams p = expressible();
  p.soil.rolling = p.wheel.rolling = "epsd2";
  EXPECT_THAT(keys(p), ::testing::ElementsAre("rolling"));
  EXPECT_THAT(keys(p, {"unprojected_rolling"}), IsEmpty());

  p = expressible();
  p.soil.rolling_rate = p.wheel.rolling_rate = 6.75e8;
  EXPECT_THAT(keys(p), ::testing::ElementsAre("rolling_rate", "wheel_rolling_friction"));
  EXPECT_THAT(keys(p, {"constant_rolling", "wheel_rolling"}), IsEmpty());
  EXPECT_THAT(law_problems(p, {})[0].message, HasSubstr("6.75e+08"));

  p = expressible();
  p.wheel.rolling_friction = 0.2;
  EXPECT_THAT(keys(p), ::testing::ElementsAre("wheel_rolling_friction"));
  EXPECT_THAT(keys(p, {"wheel_rolling"}), IsEmpty());

  p = expressible();
  p.floor = p.soil;
  EXPECT_THAT(keys(p), ::testing::ElementsAre("floor"));
  EXPECT_THAT(keys(p, {"floor_rolling"}), IsEmpty());
  p.floor.rolling_friction = 0.0;  // rough without rolling resistance
  EXPECT_THAT(keys(p), IsEmpty());

  p = expressible();
  p.soil.rolling = p.wheel.rolling = "cdt";
  EXPECT_THAT(keys(p), ::testing::ElementsAre("rolling"));
  EXPECT_THAT(keys(p, {"spring_cdt"}), IsEmpty());
}

TEST(LiggghtsLaw, RefusesWhatNoNameHelps) {
  const std::vector<std::string> all = approximations();
  dem::DemTerrainParams p = expressible();
  p.soil.tangential = "mindlin_capped_sum";
  EXPECT_THAT(keys(p, all), Contains("tangential"));
  p = expressible();
  p.soil.rolling = p.wheel.rolling = "epsd_capped_sum";
  EXPECT_THAT(keys(p, all), ::testing::ElementsAre("rolling"));
  p = expressible();
  p.soil.cohesion = "area";
  EXPECT_THAT(keys(p, all), Contains("soil.cohesion"));
  p = expressible();
  p.surface = dem::WheelSurface::spheres;
  EXPECT_THAT(keys(p, all), ::testing::ElementsAre("wheel_surface"));
  p = expressible();
  p.soil.restitution = 0.05;
  EXPECT_THAT(keys(p, all), ::testing::ElementsAre("restitution"));
  p = expressible();
  p.wheel.printed_shear_modulus = true;
  EXPECT_THAT(keys(p, all), ::testing::ElementsAre("wheel.printed_shear_modulus"));
}

TEST(LiggghtsLaw, UnknownApproximationsAndMissingBuildsAreSaid) {
  LiggghtsParams p;
  p.bed = expressible();
  p.bed.prism.grains = {{0.002, Vec3(0.01, 0.01, 0.01)}};
  p.bed.prism.width = p.bed.prism.length = 0.02;
  p.bed.prism.grain_density = 2500;
  p.approximate = {"everything"};
  ASSERT_EQ(p.validate().size(), 1u);
  EXPECT_THAT(p.validate()[0].text(), HasSubstr("names 'everything', expected of unprojected_rolling, constant_rolling"));
  if (available()) return;
  p.approximate.clear();
  EXPECT_THAT([&] { make_terrain(p); }, ::testing::ThrowsMessage<InputError>(HasSubstr("libliggghts-dev")));
}

}  // namespace
}  // namespace terrode::liggghts
