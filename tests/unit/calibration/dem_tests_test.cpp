// Soil tests on the grains of a particle ground.
#include "calibration/dem_tests.h"

#include <gtest/gtest.h>

namespace terrode::calibration {
namespace {

TEST(DemTests, ARecipeOfAGroundHasItsGrainsAndLawAndSmoothWalls) {
  dem::DemTerrainParams ground;
  for (int k = 0; k < 40; ++k) ground.prism.grains.push_back({4e-3 + 2e-5 * k, Vec3(0.01 * k, 0, 0)});
  ground.prism.bulk_density = 1650.0;
  ground.soil.friction = 0.5;
  ground.settling_friction = 0.05;
  ground.gravity = 1.62;
  ground.floor = ground.soil;  // rough, under the wheel
  const dem::BedRecipe r = recipe_of_ground(ground, 7);
  EXPECT_EQ(r.seed, 7u);
  EXPECT_EQ(r.contact.friction, 0.5);
  EXPECT_EQ(r.settling_friction, 0.05);
  EXPECT_EQ(r.bulk_density, 1650.0);
  EXPECT_EQ(r.gravity, 1.62);
  EXPECT_EQ(r.floor.friction, 0.0);
  // Ten classes of four: the middle of each, here its third.
  ASSERT_EQ(r.sizes.diameters.size(), 10u);
  EXPECT_DOUBLE_EQ(r.sizes.diameters.front(), 2.0 * (4e-3 + 2e-5 * 2));
  EXPECT_DOUBLE_EQ(r.sizes.diameters.back(), 2.0 * (4e-3 + 2e-5 * 38));
  ground.prism.grains.resize(9);
  EXPECT_THROW(recipe_of_ground(ground, 7), InputError);
}

}  // namespace
}  // namespace terrode::calibration
