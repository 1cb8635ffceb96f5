#include "calibration/wheel_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calibration/soil_tests.h"
#include "core/random.h"
#include "table8_runs.h"

namespace terrode::calibration {
namespace {

TEST(WheelFit, FindsTable8FromAnywhere) {
  Random random(3);
  WheelFitOptions o;
  o.profiles = false;
  o.starts = 8;
  o.threads = 2;
  const WheelFit fit = fit_wheel(synthetic(random, 1e-6), o);
  // Noise of a millionth leaves the last digits of the solver's accuracy.
  constexpr double kRecovered = 1e-3;
  EXPECT_NEAR(fit.value("cohesion"), 96.24, 10 * kRecovered * 96.24);
  EXPECT_NEAR(fit.value("friction_angle"), 0.606, kRecovered);
  EXPECT_NEAR(fit.value("shear_modulus"), 4.534e-3, kRecovered * 4.534e-3);
  EXPECT_NEAR(fit.value("k"), 2.305e4, kRecovered * 2.305e4);
  EXPECT_NEAR(fit.value("n"), 0.418, kRecovered);
  EXPECT_NEAR(fit.value("a0"), 0.09, kRecovered);
  EXPECT_NEAR(fit.value("a1"), 0.90, kRecovered);
  EXPECT_GE(fit.starts_at_best, 2);
}

TEST(WheelFit, SameNumbersForAnyThreads) {
  Random a(5), b(5);
  WheelFitOptions o;
  o.profiles = false;
  o.starts = 4;
  o.free = {"k", "n", "shear_modulus"};
  o.soil = table8();
  o.angles = kAngles;
  const WheelFit one = fit_wheel(synthetic(a, 0.3), o);
  o.threads = 3;
  const WheelFit three = fit_wheel(synthetic(b, 0.3), o);
  for (std::size_t i = 0; i < one.estimates.size(); ++i) EXPECT_EQ(one.estimates[i].value, three.estimates[i].value);
}

TEST(WheelFit, ProfileIntervalsAgreeWithStandardErrorsWhereTheNoiseIsSmall) {
  Random random(9);
  WheelFitOptions o;
  o.starts = 0;
  o.start_from_soil = true;
  o.soil = table8();
  o.angles = kAngles;
  o.free = {"friction_angle", "shear_modulus", "k", "n"};
  const WheelFit fit = fit_wheel(synthetic(random, 0.1), o);
  const double t = t_quantile(o.confidence, fit.degrees_of_freedom);
  for (std::size_t i = 0; i < fit.estimates.size(); ++i) {
    const Estimate& e = fit.estimates[i];
    EXPECT_NEAR((e.high - e.low) / (2 * t * e.std), 1.0, 0.1) << e.name;
  }
}

TEST(WheelFit, PriorsFromSoilTestsSetWhatOneLoadCannot) {
  Random random(21);
  WheelData data = synthetic(random, 0.3, {115});
  WheelFitOptions o;
  o.profiles = false;
  o.starts = 3;
  const WheelFit alone = fit_wheel(data, o);
  Fit prior;
  prior.estimates = {{"friction_angle", "rad"}, {"n", "-"}};
  prior.estimates[0].value = 0.606;
  prior.estimates[1].value = 0.418;
  prior.estimates[1].coordinate = Coordinate::log;
  prior.degrees_of_freedom = 20;
  set_covariance(prior, Eigen::Vector2d(1e-4, 1e-4).asDiagonal());
  o.priors = {prior};
  const WheelFit with = fit_wheel(data, o);
  EXPECT_LT(with.find("n")->std, 0.5 * alone.find("n")->std);
  EXPECT_NEAR(with.value("n"), 0.418, 3 * 0.012 * 0.418);
  EXPECT_LT(with.find("cohesion")->std, alone.find("cohesion")->std);
}

TEST(WheelFit, RefusesWhatCannotBeFitted) {
  Random random(1);
  WheelData data = synthetic(random, 0.1, {115});
  WheelFitOptions o;
  o.free = {"stickiness"};
  EXPECT_THROW(fit_wheel(data, o), InputError);
  o.free = {"k", "n", "a0", "a1"};
  data.points.resize(1);
  EXPECT_THROW(fit_wheel(data, o), InputError);
}

TEST(WheelData, AveragesReplicatesAndPoolsTheirScatter) {
  recording::Recording r;
  r.wheel.radius = 0.13;
  r.wheel.width = 0.16;
  for (int i = 0; i < 3; ++i) {
    recording::Run run;
    run.id = "run" + std::to_string(i);
    run.condition.slip = 0.2;
    run.condition.normal_load = 115;
    run.condition.repeat = i + 1;
    run.steady["drawbar_pull"] = {10.0 + i, std::nullopt};
    r.runs.push_back(run);
  }
  const WheelData data = wheel_data(r);
  ASSERT_EQ(data.points.size(), 1u);
  EXPECT_DOUBLE_EQ(*data.points[0].mean[0], 11.0);
  EXPECT_NEAR(data.points[0].standard_error[0], 1 / std::sqrt(3.0), 1e-12);
  EXPECT_FALSE(data.points[0].mean[1].has_value());
  r.runs.clear();
  EXPECT_THROW(wheel_data(r), InputError);
}

}  // namespace
}  // namespace terrode::calibration
