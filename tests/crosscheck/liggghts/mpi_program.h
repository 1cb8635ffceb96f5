// The program in a folder of its own, with a small scenario.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "../../small_robot.h"
#include "liggghts/ranks.h"

namespace terrode::liggghts {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// Shell words before a command that may start MPI: an engine that another test opened in this process left the names of its own in
// the environment.
inline const std::string kOwnMpi = "unset $(env | grep -oE '^(OMPI|PMIX|ORTE|PMI)_[A-Za-z0-9_]*'); export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1";

// On grains so coarse that a test takes seconds; the same law on both grounds.
inline std::string robot(const std::string& ground) {
  return kSmallRobot + "ground: " + ground + "\n"
         "particles: {smallest: 13 mm, largest: 16 mm, prism: 80 mm, depth: 35 mm, window_ahead: 80 mm, window_behind: 80 mm, young_modulus: 5 MPa, "
         "time_step_fraction: 0.25, rolling: epsd2_unprojected, wheel_rolling_friction: 0}\n"
         "time_step: 1 ms\n"
         "settle_time: 0.2 s\n"
         "script: [{duration: 0.2 s, speed: 0.2 m/s, ramp: 0.05 s}]\n";
}

// Column `name` of a CSV file with comments before its header.
inline std::vector<double> column(const std::string& csv, const std::string& name) {
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
    const std::string line = "cd " + folder_.string() + " && " + kOwnMpi + " TERRODE_CACHE=" +
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

}  // namespace terrode::liggghts
