// The method mpi as a user runs it: refusals in one line.
#include "mpi_program.h"

namespace terrode::liggghts {
namespace {

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
