// `terrode converge` as a user runs it.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

namespace {

struct Output {
  int status = -1;
  std::string text;
};

Output run(const std::string& arguments) {
  const std::string command = std::string(TERRODE_PROGRAM) + " converge " + arguments + " 2>&1";
  Output out;
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return out;
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) out.text.append(buffer.data(), n);
  const int raw = pclose(pipe);
  out.status = raw >= 0 ? (raw >> 8) & 0xff : -1;
  return out;
}

const std::string kScenario = std::string(TERRODE_SOURCE_DIR) + "/scenarios/mms_table1.yaml";

TEST(Converge, RefinesTheNodesAndSaysWhereItConverged) {
  const Output out = run(kScenario + " --over node_spacing --slip 0.3 --from 0.02 --levels 3 --tolerance 0.02 --json --quiet");
  ASSERT_EQ(out.status, 0) << out.text;
  const auto table = nlohmann::json::parse(out.text);
  EXPECT_EQ(table["over"], "node_spacing");
  ASSERT_EQ(table["levels"].size(), 3u);
  EXPECT_NEAR(table["levels"][2]["node_spacing"].get<double>(), 0.005, 1e-12);
  EXPECT_GT(table["levels"][2]["cpu_seconds"].get<double>(), 0.0);
  const double pull = table["levels"][2]["drawbar_pull"];
  EXPECT_GT(pull, 50.0);
  EXPECT_LT(pull, 60.0);
  EXPECT_FALSE(table["converged_from"]["sinkage"].is_null());
}

TEST(Converge, RefusesWhatItCannotRefine) {
  EXPECT_EQ(run(kScenario + " --over colour").status, 2);
  EXPECT_EQ(run(kScenario).status, 2);
  const Output nodes = run(kScenario + " --over particles --method node-spring");
  EXPECT_EQ(nodes.status, 2);
  EXPECT_NE(nodes.text.find("time_step, node_spacing, domain"), std::string::npos) << nodes.text;
  const Output grains = run(kScenario + " --over node_spacing --method dem");
  EXPECT_EQ(grains.status, 2);
  EXPECT_NE(grains.text.find("time_step, coupling, domain, particles"), std::string::npos) << grains.text;
  EXPECT_EQ(run(kScenario + " --over domain --method steady").status, 2);
  EXPECT_EQ(run(kScenario + " --over domain --against steady").status, 2);
  EXPECT_EQ(run(kScenario + " --over domain --slip 0.1,0.2").status, 2);
}

TEST(Converge, CountsTheNodes) {
  const Output out = run(kScenario + " --over node_spacing --slip 0.3 --from 0.02 --levels 3 --json --quiet");
  ASSERT_EQ(out.status, 0) << out.text;
  const auto levels = nlohmann::json::parse(out.text)["levels"];
  const double coarse = levels[0]["nodes"], fine = levels[1]["nodes"];
  EXPECT_GT(coarse, 10.0);
  EXPECT_GT(fine, 2.5 * coarse);  // four times, but for the edges
}

TEST(Converge, AgainstTheSteadyWheelIsWithinAPercentAndSaysWhyWhereNot) {
  const Output out = run(kScenario + " --against steady --slip 0.1,0.3,-0.3 --node-spacing 5e-3 --travel 0.5 --json --quiet");
  ASSERT_EQ(out.status, 0) << out.text;
  const auto points = nlohmann::json::parse(out.text)["points"];
  ASSERT_EQ(points.size(), 3u);
  for (const int i : {0, 1}) {
    EXPECT_TRUE(points[i]["within"].get<bool>()) << out.text;
    EXPECT_LT(std::abs(points[i]["sinkage"]["off"].get<double>()), 0.01);
    EXPECT_NE(points[i]["drawbar_pull"]["off"].get<double>(), 0.0);
  }
  EXPECT_FALSE(points[2]["within"].get<bool>());
  EXPECT_NE(points[2].value("why", "").find("braking"), std::string::npos) << out.text;
}

TEST(Converge, ARampOfPullDrawsTheCurveOfTheSweepAndIsSetDownGently) {
  const std::string soft = std::string(TERRODE_SOURCE_DIR) + "/scenarios/mms_table8.yaml";
  const Output out = run(soft + " --against pull_ramp --slip 0.1,0.2,0.3,0.4 --node-spacing 0.01 --json --quiet");
  ASSERT_EQ(out.status, 0) << out.text;
  const auto table = nlohmann::json::parse(out.text);
  EXPECT_EQ(table["compared"].get<int>(), 4) << out.text;
  EXPECT_LT(table["largest_difference"].get<double>(), 0.02) << out.text;  // of the load
  EXPECT_LT(table["touchdown_jolt"].get<double>(), 0.1) << out.text;
}

}  // namespace
