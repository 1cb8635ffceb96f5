// An angle of repose with and without rolling resistance.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "dem/soil_tests.h"
#include "coarse_box.h"

namespace terrode::dem {
namespace {

TEST(Repose, RollingResistanceSteepensTheSlope) {
  double angle[2];
  for (int k = 0; k < 2; ++k) {
    ReposeSettings s;
    s.soil = coarse_box().soil;
    s.soil.width = 0.08;
    s.soil.length = 0.03;
    s.soil.contact.rolling = k == 0 ? "none" : "epsd";
    s.soil.settled_energy = 1e-3;
    s.cache = cache();
    const Repose r = angle_of_repose(s);
    angle[k] = r.angle * 180 / M_PI;
    EXPECT_GE(r.x.size(), 5u);
  }
  EXPECT_GT(angle[0], 8.0);
  EXPECT_LT(angle[0], 40.0);
  EXPECT_GT(angle[1], angle[0] + 3.0);
  std::filesystem::remove_all(cache());
}

}  // namespace
}  // namespace terrode::dem
