// Every shipped scenario runs, shortened. Those on particles need a bed that takes minutes: shipped_scenarios_long_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "scenario/methods.h"
#include "scenario/particle_tests.h"
#include "scenario/vehicle_file.h"

namespace terrode::scenario {
namespace {

namespace fs = std::filesystem;

void expect_finite(const recording::Run& run, const fs::path& path) {
  ASSERT_FALSE(run.channels.empty()) << path;
  for (const auto& channel : run.channels) {
    EXPECT_FALSE(channel.values.empty()) << path << " " << channel.name;
    for (const double v : channel.values) ASSERT_TRUE(std::isfinite(v)) << path << " " << channel.name;
  }
}

TEST(ShippedScenarios, RigsRunByEveryMethodButParticles) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TERRODE_SOURCE_DIR) / "scenarios")) {
    const std::string path = entry.path().string();
    if (entry.path().extension() != ".yaml" || is_drive(path) || is_particle_tests(path)) continue;
    Scenario s = load_scenario(path);
    s.rig.travel = std::min(s.rig.travel, 0.05);
    const std::vector<OperatingPoint> points = s.operating_points();
    ASSERT_FALSE(points.empty()) << path;
    for (const char* method : {"steady", "node-spring"}) {
      // A file that asks for the ground of nodes alone has what the steady wheel refuses.
      if (std::string(method) == "steady" && s.methods == std::vector<std::string>{"node-spring"}) continue;
      const vehicle::PointResult r = make_method(method, s, {}).run(condition_of(points[points.size() / 2], s.wheel.radius), {});
      if (std::string(method) == "steady")
        EXPECT_TRUE(r.run.steady.contains("drawbar_pull")) << path;
      else
        expect_finite(r.run, entry.path());
    }
    ++count;
  }
  EXPECT_GE(count, 6);
}

TEST(ShippedScenarios, VehiclesRun) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TERRODE_SOURCE_DIR) / "scenarios")) {
    if (entry.path().extension() != ".yaml" || !is_drive(entry.path().string())) continue;
    DriveScenario drive = load_drive(entry.path().string());
    if (drive.ground == "dem") continue;
    drive.options.margin_interval = 0.0;
    DriveRun run(drive);
    run.run(0.2);
    const DriveResult r = run.result();
    EXPECT_NEAR(r.simulated_seconds, 0.2, 0.02) << entry.path();
    expect_finite(r.run, entry.path());
    ++count;
  }
  EXPECT_GE(count, 6);
}

}  // namespace
}  // namespace terrode::scenario
