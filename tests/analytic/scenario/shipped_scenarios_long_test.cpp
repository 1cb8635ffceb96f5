// Every shipped scenario on particles runs, shortened; each settles its bed first, which takes minutes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "scenario/methods.h"
#include "scenario/particle_tests.h"
#include "scenario/vehicle_file.h"

namespace terrode::scenario {
namespace {

namespace fs = std::filesystem;

TEST(ShippedScenariosLong, OnParticles) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TERRODE_SOURCE_DIR) / "scenarios")) {
    const std::string path = entry.path().string();
    if (entry.path().extension() != ".yaml") continue;
    if (is_drive(path)) {
      const DriveScenario drive = load_drive(path);
      if (drive.ground != "dem") continue;
      DriveRun run(drive);
      run.run(0.05);
      EXPECT_NEAR(run.result().simulated_seconds, 0.05, 0.01) << path;
    } else if (is_particle_tests(path)) {
      ParticleTests tests = load_particle_tests(path);
      tests.repeats = 1;
      if (tests.direct_shear) {
        tests.direct_shear->normal_stress.resize(1);
        tests.direct_shear->travel = 3e-4;
      }
      if (tests.pressure_sinkage) tests.pressure_sinkage->sinkage = 3e-4;
      for (const ParticleTest& r : run_particle_tests(tests, {}, 0, {}, {})) EXPECT_EQ(r.error, "") << path;
    } else {
      Scenario s = load_scenario(path);
      if (std::find(s.methods.begin(), s.methods.end(), "dem") == s.methods.end()) continue;
      s.rig.travel = 0.01;
      const auto r = make_method("dem", s, {}).run(condition_of(s.operating_points().front(), s.wheel.radius), {});
      for (const double v : r.run.find("drawbar_pull")->values) ASSERT_TRUE(std::isfinite(v)) << path;
    }
    ++count;
  }
  EXPECT_GE(count, 5);
}

}  // namespace
}  // namespace terrode::scenario
