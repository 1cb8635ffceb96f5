#include "calibration/wheel_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calibration/soil_tests.h"
#include "core/random.h"

namespace terrode::calibration {
namespace {

// Smith et al. Table 8 and its contact angles, the wheel and slips of the paper; two loads more.
bekker::Soil table8() {
  bekker::Soil s;
  s.cohesion = 96.24;
  s.friction_angle = 0.606;
  s.shear_modulus = 4.534e-3;
  s.k = 2.305e4;
  s.n = 0.418;
  return s;
}
constexpr bekker::ContactAngles kAngles{0.09, 0.90, 0.0};

WheelData synthetic(Random& random, double noise, const std::vector<double>& loads = {70, 115, 180}) {
  WheelData data;
  data.radius = 0.13;
  data.width = 0.16;
  const bekker::SteadyWheel wheel({0.13, 0.16}, table8(), kAngles);
  for (const double load : loads)
    for (const double slip : {-0.5, -0.3, -0.1, 0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7}) {
      WheelPoint p;
      p.operating.slip = slip;
      p.operating.normal_load = load;
      const bekker::SteadyState s = wheel.solve(p.operating);
      p.mean = {s.drawbar_pull + 4 * noise * random.normal(), s.driving_torque + 0.5 * noise * random.normal(), s.sinkage + 1e-3 * noise * random.normal()};
      data.points.push_back(p);
    }
  return data;
}

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
