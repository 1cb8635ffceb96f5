// The program in a folder of its own, with a small scenario.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "liggghts/ranks.h"

namespace terrode::liggghts {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// Shell words before a command that may start MPI: an engine that another test opened in this process left the names of its own in
// the environment.
inline const std::string kOwnMpi = "unset $(env | grep -oE '^(OMPI|PMIX|ORTE|PMI)_[A-Za-z0-9_]*'); export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1";

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
