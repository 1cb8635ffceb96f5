#include "bekker/slip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/problem.h"

namespace terrode::bekker {
namespace {

constexpr SlipConvention kAll[] = {SlipConvention::wong_reece, SlipConvention::driving_braking, SlipConvention::printed};

TEST(Slip, ConversionsAreExactInverses) {
  for (const SlipConvention c : kAll)
    for (double s = -5.0; s < 1.0; s += 0.0625)
      EXPECT_NEAR(to_wong_reece(from_wong_reece(s, c), c), s, 1e-14 * (1 + s * s)) << slip_convention_text(c);
}

TEST(Slip, ConventionsAgreeWithTheMotionTheyDescribe) {
  const double r = 0.13;
  for (const double omega : {0.1, 0.3, 1.0})
    for (const double v : {0.01, 0.03, 0.2}) {
      const double s = slip_of_motion(v, omega, r);
      EXPECT_NEAR(from_wong_reece(s, SlipConvention::printed), (omega * r - v) / v, 1e-12 * (1 + omega * r / v));
      const double expected = omega * r > v ? 1 - v / (omega * r) : omega * r / v - 1;
      EXPECT_NEAR(from_wong_reece(s, SlipConvention::driving_braking), expected, 1e-12);
    }
}

TEST(Slip, LimitsOfALockedAndASpinningWheel) {
  EXPECT_EQ(slip_of_motion(0.0, 0.3, 0.13), 1.0);
  EXPECT_EQ(slip_of_motion(0.03, 0.0, 0.13), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(to_wong_reece(-1.0, SlipConvention::driving_braking), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(from_wong_reece(-std::numeric_limits<double>::infinity(), SlipConvention::driving_braking), -1.0);
  EXPECT_THROW(to_wong_reece(1.2, SlipConvention::wong_reece), InputError);
  EXPECT_THROW(to_wong_reece(-1.2, SlipConvention::driving_braking), InputError);
  EXPECT_THROW(to_wong_reece(std::nan(""), SlipConvention::printed), InputError);
  EXPECT_THROW(slip_of_motion(0, 0, 0.13), InputError);
}

TEST(Slip, ReadsItsOwnTexts) {
  for (const SlipConvention c : kAll) EXPECT_EQ(parse_slip_convention(slip_convention_text(c)), c);
  EXPECT_EQ(parse_slip_convention("s=1-v/(omega r)"), SlipConvention::wong_reece);
  EXPECT_FALSE(parse_slip_convention("s = v"));
}

}  // namespace
}  // namespace terrode::bekker
