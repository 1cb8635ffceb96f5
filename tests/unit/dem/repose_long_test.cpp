// An angle of repose with and without rolling resistance.
// soil_tests_long_test.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "dem/soil_tests.h"

namespace terrode::dem {
namespace {

std::string cache() {
  static const std::string folder =
      (std::filesystem::temp_directory_path() / ("terrode_soil_" + std::to_string(::getpid()))).string();
  return folder;
}

DirectShearSettings coarse_box() {
  DirectShearSettings s;
  s.soil.width = s.soil.length = 0.04;
  s.soil.height = 0.04;
  s.soil.sizes.smallest = 5e-3;
  s.soil.sizes.largest = 7e-3;
  s.rate = 0.05;
  s.travel = 4e-3;
  s.samples = 20;
  s.seating = 0.05;
  s.time_step = 2e-5;
  s.cache = cache();
  return s;
}

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
