// The method mpi as a user runs it, on one rank and on two.
#include <cmath>
#include <sstream>
#include <vector>

#include "mpi_program.h"

namespace terrode::liggghts {
namespace {

TEST_F(MpiProgram, TwoRanksGiveWhatOneGives) {
  if (!available()) GTEST_SKIP() << "this build has no LIGGGHTS (libliggghts-dev and libopenmpi-dev)";
  if (std::system("command -v mpirun > /dev/null 2>&1") != 0) GTEST_SKIP() << "mpirun is not installed";
  scenario("a.yaml", "rolling: epsd2, wheel_rolling_friction: 0, approximate: [unprojected_rolling]");
  ASSERT_EQ(run("program run a.yaml --method mpi --quiet -o one.h5 --csv one.csv"), 0) << text("err.txt");
  const std::string one = text("out.txt");
  EXPECT_EQ(text("err.txt"), "");
  ASSERT_EQ(run("mpirun --oversubscribe --mca mpi_yield_when_idle 1 -np 2 program run a.yaml --method mpi --quiet -o two.h5 --csv two.csv"), 0) << text("err.txt");
  EXPECT_EQ(text("err.txt"), "");
  std::istringstream first(one), second(text("out.txt"));
  std::string a, b;
  int lines = 0;
  for (; std::getline(first, a); ++lines) {
    ASSERT_TRUE(std::getline(second, b)) << "two ranks say less";
    EXPECT_EQ(a.substr(0, 12), b.substr(0, 12));
  }
  EXPECT_FALSE(std::getline(second, b)) << "rank 1 speaks";
  EXPECT_GT(lines, 8);
  for (const auto& [name, tolerance] : {std::pair{"normal_load", 0.1}, {"sinkage", 0.1}, {"driving_torque", 0.5}}) {
    const auto x = column(text("one.csv"), name), y = column(text("two.csv"), name);
    ASSERT_GT(x.size(), 5u) << name;
    ASSERT_EQ(x.size(), y.size()) << name;
    double mean_x = 0.0, mean_y = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      mean_x += x[k] / static_cast<double>(x.size());
      mean_y += y[k] / static_cast<double>(y.size());
    }
    std::printf("%s %g %g\n", name, mean_x, mean_y);
    EXPECT_NEAR(mean_x, mean_y, tolerance * std::abs(mean_x)) << name;
  }
}

TEST_F(MpiProgram, TwoRanksCarryAMachineAsOneDoes) {
  if (!available()) GTEST_SKIP() << "this build has no LIGGGHTS (libliggghts-dev and libopenmpi-dev)";
  if (std::system("command -v mpirun > /dev/null 2>&1") != 0) GTEST_SKIP() << "mpirun is not installed";
  std::ofstream(folder_ / "a.yaml") << robot("mpi");
  ASSERT_EQ(run("program run a.yaml --quiet --csv one.csv"), 0) << text("err.txt");
  ASSERT_EQ(run("mpirun --oversubscribe --mca mpi_yield_when_idle 1 -np 2 program run a.yaml --quiet --csv two.csv"), 0) << text("err.txt");
  // Sums in another order; grains magnify that with time.
  for (const std::string wheel : {"fl", "fr", "rl", "rr"}) {
    const double one = column(text("one.csv"), wheel + "_normal_load").front(), two = column(text("two.csv"), wheel + "_normal_load").front();
    EXPECT_GT(one, 1.0) << wheel;
    EXPECT_NEAR(two, one, 1e-3 * one) << wheel;
  }
  EXPECT_NEAR(column(text("two.csv"), "position_x").back(), column(text("one.csv"), "position_x").back(), 1e-3);
}

}  // namespace
}  // namespace terrode::liggghts
