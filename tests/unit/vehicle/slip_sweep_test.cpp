#include "vehicle/slip_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "terrain/rigid.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {
namespace {

const std::vector<double> paper_slips = {-0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.3, 0.5, 0.7};

SweepMethod rigid_method() {
  RigMotion motion;
  motion.duration = 0.3;
  return rig_method("rigid", {}, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{}),
                    [](const recording::Condition&) { return std::make_unique<terrain::RigidTerrain>(); });
}

std::vector<recording::Condition> paper_conditions() { return conditions_at(paper_slips, 115.0, 0.3, 0.13); }

TEST(SlipSweep, NumbersAreTheSameForAnyNumberOfThreads) {
  const std::vector<SweepMethod> methods = {steady_method({}, {}, {}), rigid_method()};
  SweepOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const auto a = sweep(methods, paper_conditions(), one), b = sweep(methods, paper_conditions(), three);
  ASSERT_EQ(a.size(), 18u);
  ASSERT_EQ(b.size(), a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].method, i < 9 ? "steady" : "rigid");
    EXPECT_EQ(a[i].condition.slip, paper_slips[i % 9]);
    EXPECT_EQ(a[i].error, "");
    EXPECT_EQ(a[i].result.run.time, b[i].result.run.time);
    for (const auto& [name, value] : a[i].result.run.steady)
      EXPECT_EQ(value.mean, b[i].result.run.steady.at(name).mean);
    for (const auto& c : a[i].result.run.channels) EXPECT_EQ(c.values, b[i].result.run.find(c.name)->values) << c.name;
    EXPECT_GE(a[i].cpu_seconds, 0.0);
    EXPECT_EQ(a[i].result.simulated_seconds > 0.5, i >= 9);
  }
}

TEST(SlipSweep, FailedPointCarriesItsErrorAndTheRestGoesOn) {
  SweepMethod fails = rigid_method();
  const auto works = fails.run;
  fails.run = [works](const recording::Condition& c, const Progress& p) {
    if (c.slip == 0.1) throw RunError("diverged");
    return works(c, p);
  };
  const auto points = sweep({fails}, paper_conditions());
  for (const SweepPoint& p : points) EXPECT_EQ(p.error, p.condition.slip == 0.1 ? "diverged" : "");
}

TEST(SlipSweep, WheelThatSinksInIsAFailedPoint) {
  bekker::Soil mud;
  mud.k = 10.0;
  const auto points = sweep({steady_method({}, mud, {})}, conditions_at({0.2}, 115.0, 0.3, 0.13));
  EXPECT_NE(points.front().error, "");
}

TEST(SlipSweep, StoppedSweepKeepsWhatHasEndedAndCanGoOn) {
  std::vector<std::pair<double, std::string>> kept;
  std::atomic<int> count{0};
  SweepOptions options;
  options.threads = 1;
  options.on_point = [&](const SweepPoint& p) {
    kept.emplace_back(p.condition.slip, p.method);
    ++count;
  };
  Progress progress;
  progress.stop_requested = [&] { return count >= 4; };
  EXPECT_THROW(sweep({rigid_method()}, paper_conditions(), options, progress), Interrupted);
  EXPECT_EQ(kept.size(), 4u);
  options.skip = [&](const std::string& method, const recording::Condition& c) {
    return std::find(kept.begin(), kept.end(), std::make_pair(c.slip, method)) != kept.end();
  };
  progress.stop_requested = [] { return false; };
  const std::vector<std::pair<double, std::string>> before = kept;
  const auto rest = sweep({rigid_method()}, paper_conditions(), options, progress);
  EXPECT_EQ(rest.size(), 9u - before.size());
}

TEST(SlipSweep, ReportsProgressUpToTheEnd) {
  Progress progress;
  std::atomic<double> highest{0.0};
  progress.report = [&](double fraction, const std::string&) { highest = std::max(highest.load(), fraction); };
  SweepOptions one;
  one.threads = 1;
  sweep({rigid_method()}, paper_conditions(), one, progress);
  EXPECT_NEAR(highest, 1.0, 1e-12);
}

TEST(SlipSweep, LockedWheelAndSpinningInPlaceAreConditions) {
  const double inf = std::numeric_limits<double>::infinity();
  const auto conditions = conditions_at({-inf, 1.0}, 115.0, 0.3, 0.13);
  const auto points = sweep({steady_method({}, {}, {}), rigid_method()}, conditions);
  for (const SweepPoint& p : points) EXPECT_EQ(p.error, "") << p.method << p.condition.slip;
  EXPECT_LT(points[0].result.run.steady.at("drawbar_pull").mean, 0.0);
  EXPECT_NEAR(points[2].result.run.find("drawbar_pull")->values.back(), -0.6 * 115.0, 1e-3);
  EXPECT_NEAR(points[3].result.run.find("drawbar_pull")->values.back(), 0.6 * 115.0, 1e-3);
}

TEST(SlipSweep, EarlierPassesRunFirst) {
  std::vector<recording::Condition> conditions = conditions_at({0.2}, 115.0, 0.3, 0.13);
  conditions[0].pass = 3;
  const auto points = sweep({rigid_method()}, conditions);
  ASSERT_EQ(points[0].error, "");
  EXPECT_GT(points[0].result.simulated_seconds, 2.4);
}

TEST(SlipSweep, EffectsOfRigAndSensorsShowInEveryMethod) {
  RigMotion motion;
  motion.duration = 0.3;
  const auto shape = std::make_shared<wheel::Wheel>(wheel::WheelShape{});
  const auto ground = [](const recording::Condition&) { return std::make_unique<terrain::RigidTerrain>(); };
  const effects::EffectSet off;
  const effects::EffectSet on(std::map<std::string, std::map<std::string, double>>{
      {"drawbar_bias", {{"offset", 7.0}}}, {"guide_friction", {{"force", 15.0}}}});
  const auto conditions = conditions_at({0.3}, 115.0, 0.3, 0.13);
  const auto plain =
      sweep({steady_method({}, {}, {}, off), rig_method("rigid", {}, motion, shape, ground, off)}, conditions);
  const auto with =
      sweep({steady_method({}, {}, {}, on), rig_method("rigid", {}, motion, shape, ground, on)}, conditions);
  const auto lighter = sweep({steady_method({}, {}, {})}, conditions_at({0.3}, 100.0, 0.3, 0.13));
  EXPECT_NEAR(with[0].result.run.steady.at("drawbar_pull").mean,
              lighter[0].result.run.steady.at("drawbar_pull").mean + 7.0, 1e-6);
  EXPECT_LT(with[0].result.run.steady.at("sinkage").mean, plain[0].result.run.steady.at("sinkage").mean);
  EXPECT_NEAR(with[1].result.run.find("drawbar_pull")->values.back(), 0.6 * 100.0 + 7.0, 1e-3);
  EXPECT_NEAR(plain[1].result.run.find("drawbar_pull")->values.back(), 0.6 * 115.0, 1e-3);
  EXPECT_EQ(with[1].result.run.condition.normal_load, 115.0);
}

TEST(SlipSweep, EmptySweepIsRefused) {
  EXPECT_THROW(sweep({}, paper_conditions()), InputError);
  EXPECT_THROW(sweep({rigid_method()}, {}), InputError);
}

}  // namespace
}  // namespace terrode::vehicle
