// The method mpi as a user runs it: refusals in one line, the same run on one rank and on two, and what happens to all
// ranks when one of them has to stop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "liggghts/ranks.h"

namespace terrode::liggghts {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class MpiProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("terrode_mpi_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Runs a command line in the folder; `program` in it is terrode. Returns its exit status.
  int run(std::string command) {
    for (std::size_t at = command.find("program "); at != std::string::npos; at = command.find("program ", at + 1))
      command.replace(at, 7, TERRODE_PROGRAM);
    const std::string line = "cd " + folder_.string() + " && export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 TERRODE_CACHE=" +
                             (folder_ / "beds").string() + " && { " + command + " ; } > out.txt 2> err.txt";
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string text(const std::string& name) const {
    std::ifstream in(folder_ / name);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void scenario(const std::string& name, const std::string& particles) const {
    std::ofstream(folder_ / name) << "title: small\n"
                                     "wheel: {radius: 60 mm, width: 40 mm}\n"
                                     "soil: {bulk_density: 1600 kg/m^3, bekker: {cohesion: 0, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1, "
                                     "k: 10 kPa, plate_width: 50 mm}}\n"
                                     "rig: {normal_load: 20 N, angular_velocity: 1 rad/s, slip: 0.3, travel: 3 mm, ramp: 0.02 s}\n"
                                     "particles: {smallest: 9 mm, largest: 11 mm, prism: 40 mm, depth: 45 mm, time_step_fraction: 0.25, young_modulus: 5 MPa, friction: 0.5, "
                                     "rolling_friction: 0.2, "
                                  << particles << "}\n";
  }
  fs::path folder_;
};

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
