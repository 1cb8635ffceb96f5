// Comparisons whose answer is known: equal curves, shifted and scaled ones, tables with a stated error.
#include "analysis/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/random.h"

namespace terrode::analysis {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

std::vector<double> pulse(double delay, double scale, std::size_t n = 500) {
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double t = 0.01 * static_cast<double>(i) - 1.5 - delay;
    x[i] = scale * 10.0 * std::exp(-t * t / 0.3);
  }
  return x;
}

TEST(CurveRatings, EqualCurvesAreRatedOne) {
  const CurveRating r = rate_curves(pulse(0, 1), pulse(0, 1), 0.01);
  EXPECT_DOUBLE_EQ(r.total, 1.0);
  EXPECT_DOUBLE_EQ(r.shift, 0.0);
}

TEST(CurveRatings, ADelayCostsPhaseAlone) {
  const CurveRating r = rate_curves(pulse(0, 1), pulse(0.25, 1), 0.01);
  EXPECT_NEAR(r.shift, -0.25, 0.011);
  EXPECT_NEAR(r.phase, 0.75, 0.02) << "a quarter of the 20 % of 5 s";
  EXPECT_GT(r.magnitude, 0.99);
  EXPECT_GT(r.slope, 0.97);
  EXPECT_LT(r.corridor, 0.95);
}

TEST(CurveRatings, AScaleCostsMagnitude) {
  const CurveRating r = rate_curves(pulse(0, 1), pulse(0, 1.25), 0.01);
  EXPECT_DOUBLE_EQ(r.phase, 1.0);
  // 25 % off, where at 50 % nothing is left: one half, and what warping recovers on the flanks.
  EXPECT_GT(r.magnitude, 0.5);
  EXPECT_LT(r.magnitude, 0.95);
  EXPECT_NEAR(r.slope, 1.0 - 0.25 / 2.0, 0.01);
  EXPECT_EQ(rate_curves(pulse(0, 1), pulse(0, -1), 0.01).corridor < 0.8, true);
  EXPECT_THROW(rate_curves(pulse(0, 1), pulse(0, 1, 400), 0.01), InputError);
}

TEST(AreaMetric, IsTheShiftOfADistribution) {
  Random random(2);
  std::vector<double> a, b, c;
  for (int i = 0; i < 4000; ++i) {
    a.push_back(random.normal());
    b.push_back(random.normal());
    c.push_back(random.normal() + 1.5);
  }
  EXPECT_NEAR(area_metric(a, c), 1.5, 0.1);
  EXPECT_LT(area_metric(a, b), 0.1);
  EXPECT_DOUBLE_EQ(area_metric({1.0}, {3.0}), 2.0);
  EXPECT_DOUBLE_EQ(area_metric({1.0, 2.0}, {1.0, 2.0}), 0.0);
}

recording::Run row(const std::string& id, double slip, double drawbar, double load = 80.0) {
  recording::Run r;
  r.id = id;
  r.condition.slip = slip;
  r.condition.normal_load = load;
  r.condition.angular_velocity = 0.3;
  r.steady["drawbar_pull"] = {drawbar, std::nullopt};
  return r;
}

TEST(CompareTables, PairsByConditionAndInterpolates) {
  recording::Recording measured, computed;
  measured.runs = {row("m1", 0.1, 10.0), row("m2", 0.1, 10.4), row("m3", 0.25, 20.0), row("m4", 0.1, 7.0, 160.0), row("m5", 0.9, 30.0),
                   row("m6", -std::numeric_limits<double>::infinity(), -40.0)};
  computed.runs = {row("c1", 0.1, 11.0), row("c2", 0.2, 18.0), row("c3", 0.4, 26.0), row("c4", -std::numeric_limits<double>::infinity(), -38.0)};
  const Comparison c = compare(computed, measured);
  ASSERT_EQ(c.runs.size(), 4u);
  EXPECT_THAT(c.unmatched, testing::ElementsAre("m4", "m5"));
  EXPECT_NEAR(c.runs[0].channels.at("drawbar_pull").error, 1.0, 1e-12);
  EXPECT_TRUE(c.runs[2].interpolated);
  EXPECT_EQ(c.runs[2].computed_run, "c2..c3");
  EXPECT_NEAR(c.runs[2].channels.at("drawbar_pull").computed_mean, 20.0, 1e-12);
  EXPECT_NEAR(c.runs[3].channels.at("drawbar_pull").error, 2.0, 1e-12) << "a locked wheel matches a locked wheel";
  const ChannelSummary& s = c.summary.at("drawbar_pull");
  EXPECT_EQ(s.pairs, 4u);
  EXPECT_NEAR(s.bias, (1.0 + 0.6 + 0.0 + 2.0) / 4, 1e-12);
  EXPECT_NEAR(s.rmse, std::sqrt((1.0 + 0.36 + 4.0) / 4), 1e-12);
  EXPECT_NEAR(s.scatter, std::sqrt(0.08), 1e-12) << "of m1 and m2";
  EXPECT_NEAR(c.runs[0].channels.at("drawbar_pull").error_sem, s.scatter, 1e-12);
}

recording::Run series(const std::string& id, double mean, double amplitude, double frequency, std::uint64_t seed) {
  recording::Run r = row(id, 0.2, 0.0);
  r.steady.clear();
  Random random(seed);
  recording::Channel c{"drawbar_pull", "N", {}};
  for (int i = 0; i < 1000; ++i) {
    const double t = 0.02 * i;
    r.time.push_back(t);
    c.values.push_back(mean * (1.0 - std::exp(-t / 0.5)) + amplitude * std::sin(kTwoPi * frequency * t) + 0.1 * random.normal());
  }
  r.channels = {c};
  return r;
}

TEST(CompareSeries, TellsMeanAmplitudeAndFrequencyApart) {
  recording::Recording measured, computed;
  measured.runs = {series("a", 10.0, 0.5, 2.0, 1), series("b", 10.1, 0.5, 2.0, 2)};
  computed.runs = {series("c", 11.0, 1.5, 3.0, 3)};
  const Comparison c = compare(computed, measured);
  ASSERT_EQ(c.runs.size(), 2u);
  const ChannelComparison& d = c.runs[0].channels.at("drawbar_pull");
  EXPECT_NEAR(d.error, 1.0, 0.05);
  EXPECT_NEAR(d.recorded_std, 0.5 / std::sqrt(2.0), 0.05);
  EXPECT_NEAR(d.computed_std, 1.5 / std::sqrt(2.0), 0.1);
  EXPECT_NEAR(*d.recorded_line, 2.0, 0.02);
  EXPECT_NEAR(*d.computed_line, 3.0, 0.02);
  EXPECT_GT(*d.spectral_distance, 0.5);
  EXPECT_GT(d.area, 0.9);
  EXPECT_LT(d.own_area, 0.2);
  ASSERT_TRUE(d.rating);
  EXPECT_GT(d.rating->total, 0.3);
  EXPECT_LT(d.rating->total, 0.95);
  const Comparison same = compare(measured, measured);
  EXPECT_GT(same.runs[0].channels.at("drawbar_pull").rating->total, 0.8);
}

}  // namespace
}  // namespace terrode::analysis
