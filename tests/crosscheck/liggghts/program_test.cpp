// The method mpi as a user runs it: a machine on it, refusals in one line.
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "mpi_program.h"

namespace terrode::liggghts {
namespace {

TEST_F(MpiProgram, AMachineDrivesAsOnOurOwnGrains) {
  if (!available()) GTEST_SKIP() << "this build has no LIGGGHTS (libliggghts-dev and libopenmpi-dev)";
  for (const char* ground : {"dem", "mpi"}) {
    const std::string name = ground;
    std::ofstream(folder_ / (name + ".yaml")) << robot(name);
    ASSERT_EQ(run("program run " + name + ".yaml --quiet --csv " + name + ".csv"), 0) << text("err.txt");
  }
  const std::string ours = text("dem.csv"), theirs = text("mpi.csv");
  // A few grains carry each wheel, and where it comes to rest on them differs: places agree to a fraction of a grain of 14 mm.
  for (const auto& [name, tolerance] : {std::pair{"position_x", 4e-3}, {"position_y", 7e-3}, {"position_z", 4e-3}}) {
    const double a = column(ours, name).back(), b = column(theirs, name).back();
    std::printf("%s: %g and %g m\n", name, a, b);
    EXPECT_NEAR(a, b, tolerance) << name;
  }
  EXPECT_GT(column(theirs, "position_x").back(), 0.02);  // of 35 mm with the ramp
  double load = 0.0;
  for (const std::string wheel : {"fl", "fr", "rl", "rr"}) load += mean_of_second_half(column(theirs, wheel + "_normal_load"));
  EXPECT_NEAR(load, 4.0 * 9.81, 0.1 * 4.0 * 9.81);  // its weight, as far as it does not bounce
}

TEST_F(MpiProgram, AMachineOnLiggghtsIsRefusedByKeyToo) {
  std::string file = robot("mpi");
  file.replace(file.find("_unprojected"), 12, "");
  std::ofstream(folder_ / "a.yaml") << file;
  EXPECT_EQ(run("program run a.yaml"), 2);
  EXPECT_THAT(text("err.txt"), HasSubstr("a.yaml: particles.rolling: is epsd2"));
  EXPECT_FALSE(fs::exists(folder_ / "beds")) << "a bed was settled for nothing";
  EXPECT_EQ(run("program validate a.yaml"), 2);
  EXPECT_THAT(text("out.txt"), HasSubstr("a.yaml: particles.rolling: is epsd2"));
}

TEST_F(MpiProgram, RefusesByKeyWhatIsNotNamed) {
  scenario("a.yaml", "rolling: epsd2, rolling_rate: 6.75e8");
  EXPECT_EQ(run("program run a.yaml --method mpi"), 2);
  EXPECT_EQ(text("out.txt"), "");
  for (const char* part : {"a.yaml: particles.rolling: is epsd2", "approximate: [unprojected_rolling]", "a.yaml: particles.rolling_rate: is 6.75e+08 s^2/m^2",
                           "approximate: [constant_rolling]", "a.yaml: particles.wheel_rolling_friction: is 0.2", "approximate: [wheel_rolling]"})
    EXPECT_THAT(text("err.txt"), HasSubstr(part));
  EXPECT_FALSE(fs::exists(folder_ / "beds")) << "a bed was settled for nothing";
  if (available()) return;
  scenario("b.yaml", "rolling: none");
  EXPECT_EQ(run("program sweep b.yaml --method mpi --slip 0.3"), 2);
  EXPECT_THAT(text("err.txt"), HasSubstr("built without LIGGGHTS"));
  EXPECT_THAT(text("err.txt"), HasSubstr("libliggghts-dev"));
}

}  // namespace
}  // namespace terrode::liggghts
