// The method mpi as a user runs it, on one rank and on two.
#include <cmath>
#include <sstream>
#include <vector>

#include "mpi_program.h"

namespace terrode::liggghts {
namespace {

// Column `name` of a CSV file with comments before its header.
std::vector<double> column(const std::string& csv, const std::string& name) {
  std::istringstream in(csv);
  std::vector<double> out;
  long at = -1;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream cells(line);
    long k = 0;
    for (std::string cell; std::getline(cells, cell, ','); ++k) {
      while (!cell.empty() && (cell.back() == '\r' || cell.back() == '"')) cell.pop_back();
      if (at < 0 && cell.find(name) != std::string::npos) {
        at = k;
        break;
      }
      if (at == k) out.push_back(std::strtod(cell.c_str(), nullptr));
    }
  }
  return out;
}

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

}  // namespace
}  // namespace terrode::liggghts
