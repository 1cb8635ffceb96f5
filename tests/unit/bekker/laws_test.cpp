// Laws by name: their formulas, their null values, and that a wheel feels them.
#include <gtest/gtest.h>

#include <cmath>

#include "bekker/bulldozing.h"
#include "bekker/pressure_laws.h"
#include "bekker/shear_laws.h"
#include "bekker/steady_wheel.h"

namespace terrode::bekker {
namespace {

TEST(PressureLaws, FollowTheirFormulas) {
  const Soil soil;
  const LocalSoil local(soil);
  Context context;
  context.width = 0.16;
  context.unit_weight = 15000;
  const double z = 0.012;
  EXPECT_EQ(make_pressure_law("power", {})->pressure(local, context, z), power_law_pressure(local, z));
  EXPECT_NEAR(make_pressure_law("bekker", {{"kc", 15600}, {"kphi", 2.4074e6}})->pressure(local, context, z),
              (15600 / 0.16 + 2.4074e6) * std::pow(z, soil.n), 1e-9);
  EXPECT_NEAR(make_pressure_law("reece", {{"kc", 20}, {"kphi", 80}})->pressure(local, context, z),
              (soil.cohesion * 20 + 15000 * 0.16 * 80) * std::pow(z / 0.16, soil.n), 1e-9);
  EXPECT_NEAR(make_pressure_law("wong", {{"kp", 4e5}, {"mm", 3e4}, {"hydraulic_diameter", 0.2}})->pressure(local, context, z),
              4e5 * z + 4 * 3e4 * z * z / 0.2, 1e-9);
  for (const auto& name : pressure_law_names())
    if (name == "power") {
      EXPECT_EQ(make_pressure_law(name, {})->name(), name);
    }
}

TEST(ShearLaws, StartAtZeroPeakAndEndAtTheirResidual) {
  const LocalSoil soil{Soil{}};
  EXPECT_EQ(make_shear_law("janosi", {})->mobilised(soil, 1e-3), janosi_mobilised(soil, 1e-3));
  const double Kr = 0.6, Kw = 2e-3, infinity = std::numeric_limits<double>::infinity();
  for (const std::string name : {"wong_peak", "oida"}) {
    const auto law = make_shear_law(name, {{"residual", Kr}, {"peak_displacement", Kw}});
    EXPECT_EQ(law->mobilised(soil, 0.0), 0.0);
    EXPECT_NEAR(law->mobilised(soil, infinity), Kr, 1e-15);
    EXPECT_NEAR(law->mobilised(soil, Kw), 1.0, 1e-12) << name;  // Wong's form passes 1 at Kw, too, by its definition
  }
  const auto oida = make_shear_law("oida", {{"residual", Kr}, {"peak_displacement", Kw}});
  for (const double j : {0.5 * Kw, 0.9 * Kw, 1.1 * Kw, 3 * Kw}) EXPECT_LT(oida->mobilised(soil, j), 1.0);
}

TEST(Laws, UnknownNamesAndParametersAreNamed) {
  EXPECT_THROW(make_pressure_law("beker", {}), InputError);
  try {
    make_pressure_law("bekker", {{"kc", 1}, {"kpih", 2}});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.problems().size(), 2u);
  }
  EXPECT_THROW(make_shear_law("oida", {{"residual", 1.5}, {"peak_displacement", 1e-3}}), InputError);
  EXPECT_THROW(make_shear_law("shear", {}), InputError);
}

TEST(Laws, NamedDefaultsAreTheDefaultsBitForBit) {
  const auto pressure = make_pressure_law("power", {});
  const auto shear = make_shear_law("janosi", {});
  PointLaw law;
  law.pressure_law = pressure.get();
  law.shear_law = shear.get();
  Operating op;
  op.slip = 0.3;
  const SteadyState a = SteadyWheel({}, {}, {}).solve(op), b = SteadyWheel({}, {}, {}, law).solve(op);
  EXPECT_EQ(a.drawbar_pull, b.drawbar_pull);
  EXPECT_EQ(a.sinkage, b.sinkage);
}

TEST(Laws, AWheelFeelsThem) {
  const auto peak = make_shear_law("oida", {{"residual", 0.6}, {"peak_displacement", 1e-3}});
  PointLaw law;
  law.shear_law = peak.get();
  Operating op;
  op.slip = 0.6;
  EXPECT_LT(SteadyWheel({}, {}, {}, law).solve(op).drawbar_pull, 0.8 * SteadyWheel({}, {}, {}).solve(op).drawbar_pull);
}

TEST(Bulldozing, IsRankinesPassivePressureForAVerticalBlade) {
  // cot(Xc) + tan(Xc + phi) = 2 cot(Xc) and the bracket is cot(Xc) + cot^2(Xc) tan(phi): with cot(Xc) = tan(45 + phi/2).
  const double phi = 0.5, t = std::tan(0.785398163397448 + phi / 2);
  EXPECT_NEAR(bulldozing_resistance(0.0, std::tan(phi), 15000, 0.02),
              2 * t * 0.5 * 15000 * 0.02 * 0.02 * (t + t * t * std::tan(phi)), 1e-9);
  EXPECT_EQ(bulldozing_resistance(100.0, std::tan(phi), 15000, 0.0), 0.0);
}

}  // namespace
}  // namespace terrode::bekker
