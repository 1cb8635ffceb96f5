#include "analysis/quality.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"

namespace terrode::analysis {
namespace {

recording::Run clean(std::size_t n = 500) {
  recording::Run run;
  Random random(3);
  recording::Channel d{"drawbar_pull", "N", {}}, t{"driving_torque", "N m", {}}, w{"angular_velocity", "rad/s", {}}, v{"forward_velocity", "m/s", {}};
  for (std::size_t i = 0; i < n; ++i) {
    run.time.push_back(0.04 * static_cast<double>(i));
    run.lines.push_back(static_cast<int>(i) + 2);
    d.values.push_back(std::round(1000.0 * (20.0 + random.normal())) / 1000.0);
    t.values.push_back(5.0 + 0.1 * random.normal());
    w.values.push_back(0.3 + 0.001 * random.normal());
    v.values.push_back(0.0312 + 0.0001 * random.normal());
  }
  run.condition.slip = 0.2;
  run.channels = {d, t, w, v};
  return run;
}

std::vector<std::string> kinds(const std::vector<QualityFinding>& findings) {
  std::vector<std::string> out;
  for (const QualityFinding& f : findings) out.push_back(f.kind + " " + f.channel);
  return out;
}

using testing::ElementsAre;

TEST(Quality, FindsNothingInACleanRun) { EXPECT_THAT(kinds(check_quality(clean(), 0.13)), ElementsAre()); }

TEST(Quality, NamesWhatIsWrongWithItsLine) {
  recording::Run run = clean();
  for (std::size_t i = 100; i < 140; ++i) run.channels[0].values[i] = 20.5;   // frozen inside the range
  for (std::size_t i = 200; i < 230; ++i) run.channels[1].values[i] = 5.5;    // clipped at the top
  for (double& x : run.channels[1].values) x = std::min(x, 5.05);
  run.channels[2].values[300] = 0.9;                                           // one spike
  run.channels[3].values[50] = std::nan("");
  const auto f = check_quality(run, 0.13);
  EXPECT_THAT(kinds(f), ElementsAre("frozen drawbar_pull", "saturated driving_torque", "outliers angular_velocity", "gaps forward_velocity"));
  EXPECT_EQ(f[0].line, 102);
  EXPECT_EQ(f[0].count, 40u);
  EXPECT_EQ(f[2].line, 302);
  EXPECT_EQ(f[3].line, 52);
}

TEST(Quality, JudgesTheClocks) {
  recording::Run run = clean();
  Random random(4);
  recording::Channel second{"time_rig", "s", {}};
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    second.values.push_back(1.001 * run.time[i] + 0.5);
    run.time[i] += 0.01 * (random.uniform() - 0.5) + (i > 250 ? 1.0 : 0.0);
  }
  run.channels.push_back(second);
  const auto f = check_quality(run);
  EXPECT_THAT(kinds(f), ElementsAre("jitter ", "missing samples ", "second clock time_rig"));
  EXPECT_EQ(f[1].line, 253);
}

TEST(Quality, HoldsTheRunAgainstMechanics) {
  recording::Run run = clean();
  for (double& x : run.channels[1].values) x = -x;
  run.condition.slip = 0.4;
  EXPECT_THAT(kinds(check_quality(run, 0.13)), ElementsAre("slip ", "energy "));
}

TEST(Quality, AConstantChannelIsSaidOnce) {
  recording::Run run = clean();
  for (double& x : run.channels[0].values) x = 3.0;
  EXPECT_THAT(kinds(check_quality(run)), ElementsAre("constant drawbar_pull"));
}

}  // namespace
}  // namespace terrode::analysis
