// Known processes: a transient of known length, autoregressive noise with known variance of its mean, known drifts.
#include "analysis/steady_state.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "analysis/autoregression.h"
#include "core/random.h"

namespace terrode::analysis {
namespace {

constexpr double kStep = 0.04;  // s, as laboratories sample

std::vector<double> times(std::size_t n) {
  std::vector<double> t(n);
  for (std::size_t i = 0; i < n; ++i) t[i] = kStep * static_cast<double>(i);
  return t;
}

// Stationary first-order autoregressive noise of unit variance.
std::vector<double> red_noise(std::size_t n, double phi, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> x(n);
  double v = random.normal();
  for (double& y : x) {
    y = v;
    v = phi * v + std::sqrt(1.0 - phi * phi) * random.normal();
  }
  return x;
}

TEST(AutoRegressionFit, RecoversItsOwnModel) {
  Random random(5);
  std::vector<double> x(20000);
  for (std::size_t i = 2; i < x.size(); ++i) x[i] = 1.5 * x[i - 1] - 0.8 * x[i - 2] + random.normal();
  const AutoRegression m = fit_burg(x, 2);
  constexpr double kSampling = 0.02;  // four standard errors of a coefficient, sqrt((1 - a2^2)/n)
  EXPECT_NEAR(m.coefficients[0], 1.5, kSampling);
  EXPECT_NEAR(m.coefficients[1], -0.8, kSampling);
  EXPECT_NEAR(m.innovation_variance, 1.0, 0.05);
  EXPECT_NEAR(m.spectrum(0.0), 1.0 / (0.3 * 0.3), 1.5);
  const std::size_t order = fit_burg_best(x, 12).coefficients.size();
  EXPECT_GE(order, 2u);
  EXPECT_LE(order, 8u) << "AICc adds few needless orders";
}

TEST(SteadyState, BeginsAfterTheTransient) {
  const auto t = times(1000);
  for (const double tau : {0.5, 2.0, 4.0}) {
    std::vector<double> x = red_noise(t.size(), 0.5, 3);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = 20.0 + 0.5 * x[i] - 10.0 * std::exp(-t[i] / tau);
    const SteadyState s = steady_state(t, x);
    EXPECT_TRUE(s.reached) << tau;
    EXPECT_GT(s.begin_time, 1.5 * tau) << "what is left of the step is below a quarter of it";
    EXPECT_LT(s.begin_time, 6.0 * tau);
    EXPECT_NEAR(s.mean, 20.0, 5.0 * s.sem + 0.1);
  }
}

TEST(SteadyState, IsNotReachedWhileTheRunStillSettlesOrDrifts) {
  const auto t = times(1000);
  std::vector<double> settling = red_noise(t.size(), 0.5, 4), drifting = red_noise(t.size(), 0.5, 5);
  for (std::size_t i = 0; i < t.size(); ++i) {
    settling[i] = 0.2 * settling[i] - 10.0 * std::exp(-t[i] / 30.0);
    drifting[i] = 5.0 + 0.2 * drifting[i] + 0.1 * t[i];
  }
  EXPECT_FALSE(steady_state(t, settling).reached);
  const SteadyState d = steady_state(t, drifting);
  EXPECT_FALSE(d.reached);
  EXPECT_EQ(d.reason, "drifts");
  EXPECT_NEAR(d.drift, 0.1, 4.0 * d.drift_sem);
  EXPECT_LT(d.drift_p, 1e-3);
}

// The share of series whose interval mean +- t sem holds the truth, and that are wrongly said to drift.
struct Coverage {
  double covered = 0.0, alarmed = 0.0, sem = 0.0;
};
Coverage coverage(std::size_t n, double phi) {
  constexpr int kSeries = 400;
  Coverage c;
  const auto t = times(n);
  SteadyOptions options;
  options.begin = 0.0;
  options.drift_tolerance = 0.0;
  for (int k = 0; k < kSeries; ++k) {
    const SteadyState s = steady_state(t, red_noise(n, phi, 100 + static_cast<std::uint64_t>(k)), options);
    c.covered += std::abs(s.mean) < 2.0 * s.sem ? 1.0 / kSeries : 0.0;
    c.alarmed += s.drift_p < 0.01 ? 1.0 / kSeries : 0.0;
    c.sem += s.sem / kSeries;
  }
  return c;
}

TEST(SteadyState, TheErrorOfTheMeanKnowsAutocorrelation) {
  for (const double phi : {0.0, 0.5, 0.9, 0.97}) {
    const std::size_t n = 2000;
    const Coverage c = coverage(n, phi);
    // Var(mean) = (1 + phi)/(1 - phi)/n for long series.
    const double exact = std::sqrt((1.0 + phi) / (1.0 - phi) / static_cast<double>(n));
    EXPECT_GT(c.sem, 0.85 * exact) << phi;
    EXPECT_LT(c.sem, 1.35 * exact) << phi;
    EXPECT_GT(c.covered, 0.90) << phi << ": two standard errors hold 95 % of normal deviates";
    EXPECT_LT(c.alarmed, 0.03) << phi << ": drifts at the one per cent level";
  }
}

TEST(SteadyState, ShortCorrelatedRunsStayHonest) {
  // 250 samples with a correlation time of 0.4 s: as short as a laboratory's run.
  const Coverage c = coverage(250, 0.9);
  EXPECT_GT(c.covered, 0.85);
  EXPECT_LT(c.alarmed, 0.05);
}

TEST(SteadyState, AveragesOverWholePeriods) {
  const auto t = times(633);
  std::vector<double> x(t.size());
  const double period = 2.0;
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 3.0 + 5.0 * std::sin(2.0 * std::numbers::pi * t[i] / period + 0.4);
  SteadyOptions options;
  options.period = period;
  const SteadyState s = steady_state(t, x, options);
  EXPECT_GT(s.periods, 4u);
  EXPECT_NEAR(s.mean, 3.0, 1e-9) << "50 samples to a period: the sum over whole ones is exact";
  EXPECT_NEAR(s.end_time - s.begin_time + kStep, static_cast<double>(s.periods) * period, 1e-9);
}

TEST(SteadyState, TakesGapsUnevenTimesAndConstants) {
  Random random(9);
  std::vector<double> t, x;
  double now = 0.0;
  for (int i = 0; i < 800; ++i) {
    now += 0.01 + 0.06 * random.uniform();
    t.push_back(now);
    x.push_back(i % 50 < 5 ? std::nan("") : 7.0 + random.normal());
  }
  const SteadyState s = steady_state(t, x);
  EXPECT_TRUE(s.reached);
  EXPECT_NEAR(s.mean, 7.0, 4.0 * s.sem);
  EXPECT_LT(s.samples, 730u);
  const SteadyState constant = steady_state(times(100), std::vector<double>(100, 4.0));
  EXPECT_TRUE(constant.reached);
  EXPECT_EQ(constant.mean, 4.0);
  EXPECT_EQ(constant.sem, 0.0);
  EXPECT_EQ(steady_state(times(3), std::vector<double>(3, 1.0)).reason, "too short");
  EXPECT_EQ(steady_state({}, {}).reason, "no samples");
  EXPECT_THROW(steady_state(times(3), std::vector<double>(2)), InputError);
}

TEST(SteadyState, ASimulatedTailBelowTheToleranceCountsAsReached) {
  const auto t = times(500);
  std::vector<double> x(t.size());
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 20.0 * (1.0 - std::exp(-t[i] / 1.0));
  const SteadyState s = steady_state(t, x);
  EXPECT_TRUE(s.reached) << "no noise hides the rest of the exponential, but it is small";
  EXPECT_NEAR(s.mean, 20.0, 0.05);
}

TEST(Replicates, AreGroupedAndTheirScatterPooled) {
  std::vector<recording::Run> runs(5);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    runs[i].condition.slip = i < 3 ? 0.1 : 0.3;
    runs[i].condition.normal_load = 115.0;
    runs[i].condition.repeat = static_cast<int>(i);
  }
  runs[4].condition.pass = 2;
  const auto groups = group_replicates(runs);
  ASSERT_EQ(groups.size(), 3u);
  EXPECT_EQ(groups[0].runs.size(), 3u);
  SteadyState a, b, c;
  a.mean = 1.0;
  b.mean = 2.0;
  c.mean = 3.0;
  const SteadyState three[] = {a, b, c};
  const ReplicateScatter s = replicate_scatter(three);
  EXPECT_DOUBLE_EQ(s.mean, 2.0);
  EXPECT_DOUBLE_EQ(s.between_std, 1.0);
  EXPECT_DOUBLE_EQ(s.sem, 1.0 / std::sqrt(3.0));
  const SteadyState two[] = {a, c};
  const ReplicateScatter both[] = {s, replicate_scatter(two), replicate_scatter({two, 1})};
  const PooledScatter p = pooled_scatter(both);
  EXPECT_EQ(p.degrees_of_freedom, 3u);
  EXPECT_DOUBLE_EQ(p.std, std::sqrt((2.0 * 1.0 + 1.0 * 2.0) / 3.0));
}

}  // namespace
}  // namespace terrode::analysis
