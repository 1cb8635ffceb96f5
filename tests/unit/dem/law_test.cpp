// The constants of the contact law, its parts by name, and what validation says.
#include <gtest/gtest.h>

#include <cmath>

#include "dem/law/parts.h"
#include "dem/material.h"

namespace terrode::dem {
namespace {

constexpr double printed_digits = 1e-5;  // the reference numbers have six digits

TEST(PairLaw, ConstantsOfThePapersGrains) {
  const PairLaw law = make_pair_law({}, {}, {});
  EXPECT_NEAR(law.young_eff / 3.98860e7, 1.0, printed_digits);
  EXPECT_NEAR(law.shear_eff / 7.85634e6, 1.0, printed_digits);
  EXPECT_NEAR(damping_ratio(0.4) / -0.279998, 1.0, printed_digits);
  EXPECT_NEAR(damping_ratio(0.06) / -0.667126, 1.0, printed_digits);
  EXPECT_EQ(damping_ratio(1.0), 0.0);
}

TEST(PairLaw, PrintedShearModulusDiffersAndIsSelectable) {
  Interaction printed;
  printed.printed_shear_modulus = true;
  const double mindlin = make_pair_law({}, {}, {}).shear_eff, eq17 = make_pair_law({}, {}, printed).shear_eff;
  EXPECT_NEAR(eq17 / mindlin, (1.65 * 1.35) / (2.35 * 0.65), 1e-12);
}

TEST(PairLaw, UnequalMaterialsCombineLikeSpringsInSeries) {
  const Material soft{"a", 1e7, 0.3}, hard{"b", 1e30, 0.3};
  EXPECT_NEAR(make_pair_law(soft, hard, {}).young_eff, 1e7 / (1 - 0.09), 1.0);
  EXPECT_EQ(make_pair_law(soft, hard, {}).young_eff, make_pair_law(hard, soft, {}).young_eff);
}

TEST(Interaction, ReportsEveryProblem) {
  Interaction bad;
  bad.rolling = "epds";
  bad.restitution = 1.5;
  bad.friction = -1.0;
  const Problems problems = bad.validate();
  ASSERT_EQ(problems.size(), 3u);
  EXPECT_EQ(problems[0].key, "rolling");
  EXPECT_NE(problems[0].expected.find("epsd2"), std::string::npos);
  EXPECT_THROW(make_pair_law({}, {}, bad), InputError);
}

TEST(Parts, EveryFamilyBeginsWithItsNullPartAndDeclaresItsHistory) {
  EXPECT_STREQ(NormalParts::names[0], "none");
  EXPECT_STREQ(TangentialParts::names[0], "none");
  EXPECT_STREQ(RollingParts::names[0], "none");
  EXPECT_STREQ(CohesionParts::names[0], "none");
  Interaction i;
  EXPECT_EQ(history_size(make_pair_law({}, {}, i)), 6);
  i.rolling = "cdt";
  EXPECT_EQ(history_size(make_pair_law({}, {}, i)), 3);
  i.tangential = "none";
  EXPECT_EQ(history_size(make_pair_law({}, {}, i)), 0);
  for (const int h : TangentialParts::histories) EXPECT_LE(h + 3, max_history);
}

Contact<double> some_contact() {
  Contact<double> c{};
  c.nx = 1.0;
  c.overlap = 1e-5;
  c.radius_eff = 2e-3;
  c.mass_eff = 1e-4;
  c.inertia_eff = 1e-9;
  c.vty = 0.1;
  c.wz = 3.0;
  c.dt = 1e-6;
  return c;
}

TEST(Parts, NullPartsGiveNothing) {
  Interaction none;
  none.normal = none.tangential = none.rolling = "none";
  Contact<double> c = some_contact();
  double h[max_history] = {};
  evaluate(make_pair_law({}, {}, none), c, h);
  EXPECT_EQ(c.fn, 0.0);
  EXPECT_EQ(c.fty, 0.0);
  EXPECT_EQ(c.mz, 0.0);
}

TEST(Parts, RateDependentRollingCoefficientIsCappedAtOne) {
  // Eq. 23: min(mu_r v_t^2, 1); at the paper's 6.75e8 s2/m2 the cap is reached at 3.85e-5 m/s.
  Interaction rate, constant;
  rate.rolling_rate = 6.75e8;
  for (const double v : {1e-5, 3.8e-5, 3.9e-5, 0.1}) {
    Contact<double> a = some_contact(), b = some_contact();
    a.vty = b.vty = v;
    constant.rolling_friction = std::min(6.75e8 * v * v, 1.0);
    double ha[max_history] = {}, hb[max_history] = {};
    evaluate(make_pair_law({}, {}, rate), a, ha);
    evaluate(make_pair_law({}, {}, constant), b, hb);
    EXPECT_DOUBLE_EQ(a.mz, b.mz) << v;
    EXPECT_LT(a.mz, 0.0);
  }
}

TEST(Parts, LimitsOfFrictionAndRolling) {
  Interaction i;
  Contact<double> c = some_contact();
  double h[max_history] = {};
  const PairLaw law = make_pair_law({}, {}, i);
  for (int k = 0; k < 4000; ++k) evaluate(law, c, h);
  EXPECT_NEAR(std::abs(c.fty), 0.86 * std::abs(c.fn), 1e-12);
  EXPECT_NEAR(std::abs(c.mz), 1.0 * c.radius_eff * std::abs(c.fn), 1e-12);
  EXPECT_NEAR(h[1] * c.kt, 0.86 * c.fn, 1e-12);  // the displacement is held at what the limit allows
}

TEST(Parts, CappedSumNeverExceedsTheLimitWhileTheDefaultMay) {
  Interaction lig, printed;
  printed.tangential = "mindlin_capped_sum";
  for (Interaction* i : {&lig, &printed}) i->friction = 0.05;
  double largest_lig = 0.0, largest_printed = 0.0, ha[max_history] = {}, hb[max_history] = {};
  for (int k = 0; k < 50; ++k) {
    Contact<double> a = some_contact(), b = some_contact();
    evaluate(make_pair_law({}, {}, lig), a, ha);
    evaluate(make_pair_law({}, {}, printed), b, hb);
    largest_lig = std::max(largest_lig, std::abs(a.fty) / (0.05 * a.fn));
    largest_printed = std::max(largest_printed, std::abs(b.fty) / (0.05 * b.fn));
  }
  EXPECT_GT(largest_lig, 1.0);
  EXPECT_LE(largest_printed, 1.0 + 1e-12);
}

TEST(Parts, AreaCohesionAttractsWithTheContactArea) {
  Interaction sticky;
  sticky.cohesion = "area";
  sticky.cohesion_energy_density = 1e4;
  Contact<double> a = some_contact(), b = some_contact();
  double h[max_history] = {}, g[max_history] = {};
  evaluate(make_pair_law({}, {}, {}), a, h);
  evaluate(make_pair_law({}, {}, sticky), b, g);
  EXPECT_NEAR(a.fn - b.fn, 1e4 * M_PI * 2e-3 * 1e-5, 1e-15);
}

}  // namespace
}  // namespace terrode::dem
