#include "core/units.h"

#include <gtest/gtest.h>

#include <numbers>

namespace terrode {
namespace {

struct Case {
  const char* text;
  const char* si;
  double value;
};

class Quantity : public testing::TestWithParam<Case> {};

TEST_P(Quantity, ReadsToSi) {
  const QuantityText q = parse_quantity(GetParam().text, GetParam().si);
  EXPECT_EQ(q.error, "");
  EXPECT_NEAR(q.value, GetParam().value, 1e-12 * std::abs(GetParam().value));
}

INSTANTIATE_TEST_SUITE_P(
    Units, Quantity,
    testing::Values(Case{"130 mm", "m", 0.13}, Case{"0.13", "m", 0.13}, Case{"17 deg/s", "rad/s", 17 * std::numbers::pi / 180},
                    Case{"115 N", "N", 115}, Case{"2.5 kPa", "Pa", 2500}, Case{"1e3 mm", "m", 1.0}, Case{"3 N mm", "N m", 3e-3},
                    Case{"3 mN m", "N m", 3e-3}, Case{"1.6 g/cm^3", "kg/m^3", 1600}, Case{"16 kN/m3", "N/m^3", 16000},
                    Case{"30 %", "-", 0.3}, Case{"3 rpm", "rad/s", std::numbers::pi / 10}, Case{"5 cm²", "m^2", 5e-4},
                    Case{"15.6 kN/m^2.1", "N/m^2.1", 15600}, Case{"9.81 m/s^2", "m/s^2", 9.81}, Case{"2 N/(m s)", "N/m/s", 2},
                    Case{"-4e-3 m", "m", -4e-3}, Case{"5 kg m s^-2", "N", 5}));

TEST(Quantity, RefusesWhatIsNotTheQuantity) {
  for (const char* bad : {"", "x", "nan", "inf", "1e999", "130 kg", "130 mn", "130 m m", "130 m^", "3 (m", "-", "1 m^99"})
    EXPECT_NE(parse_quantity(bad, "m").error, "") << bad;
  EXPECT_NE(parse_quantity("3 deg", "-").error, "");
  EXPECT_EQ(parse_quantity("3 deg", "rad").error, "");
}

TEST(Number, ReadsWholeTextOnly) {
  EXPECT_EQ(parse_number(" 1.5 "), 1.5);
  EXPECT_EQ(parse_number("+2e-3"), 2e-3);
  for (const char* bad : {"", "1.5x", "1,5", "nan", "inf", "0x10", "1e400"}) EXPECT_FALSE(parse_number(bad)) << bad;
}

}  // namespace
}  // namespace terrode
