#include "calibration/soil_file.h"

#include <gtest/gtest.h>

#include "scenario/scenario.h"

namespace terrode::calibration {
namespace {

TEST(SoilFile, ScenariosReadItBack) {
  recording::SoilBelief soil;
  soil.name = "a sand";
  soil.bulk_density = 1530;
  soil.cohesion = 12.5;
  soil.friction_angle = 0.51;
  soil.shear_modulus = 0.0123;
  soil.k = 1.25e5;
  soil.plate_width = 0.1;
  soil.n = 0.93;
  soil.a0 = 0.2;
  soil.a1 = 0.4;
  soil.theta_r = -0.05;
  const std::string text = soil_yaml(soil, "made by a test\nin two lines");
  EXPECT_EQ(text.rfind("# made by a test\n# in two lines\n", 0), 0u);
  std::string indented;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    indented += "  " + text.substr(at, end - at) + "\n";
    at = end + 1;
  }
  const scenario::Scenario s =
      scenario::parse_scenario("wheel: {radius: 0.1, width: 0.1}\nrig: {normal_load: 50}\nsoil:\n" + indented, "s.yaml");
  EXPECT_EQ(s.bekker_soil().k, 1.25e5);
  EXPECT_EQ(s.bekker_soil().shear_modulus, 0.0123);
  EXPECT_EQ(s.contact_angles().theta_r, -0.05);
  EXPECT_EQ(*s.soil.bulk_density, 1530);
}

}  // namespace
}  // namespace terrode::calibration
