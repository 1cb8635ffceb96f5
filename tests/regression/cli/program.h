// The program in a child process, with what the system may do to it.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

namespace terrode {

namespace fs = std::filesystem;

inline std::string content(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

struct Outcome {
  int status = -1;  // exit status, or minus the signal
  std::string out, err;
  long largest_memory = 0;  // KiB
};

class ProgramTest : public ::testing::Test {
 protected:
  ProgramTest() : folder_(fs::temp_directory_path() / ("terrode_faults_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    fs::permissions(folder_, fs::perms::all);
  }
  ~ProgramTest() override { fs::remove_all(folder_); }

  fs::path file(const std::string& name) const { return folder_ / name; }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    return file(name);
  }
  // `before` runs in the child, after its output was turned to files.
  Outcome run(const std::vector<std::string>& arguments, const std::function<void()>& before = {}) const {
    const pid_t child = fork();
    if (child == 0) {
      freopen(file("out.txt").c_str(), "w", stdout);
      freopen(file("err.txt").c_str(), "w", stderr);
      std::vector<char*> argv = {const_cast<char*>(TERRODE_PROGRAM)};
      for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
      argv.push_back(nullptr);
      if (before) before();
      execv(TERRODE_PROGRAM, argv.data());
      _exit(99);
    }
    int status = 0;
    rusage usage{};
    wait4(child, &status, 0, &usage);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), content(file("out.txt")), content(file("err.txt")),
            usage.ru_maxrss};
  }
  static void limit(int what, std::size_t bytes) {
    const rlimit l{bytes, bytes};
    setrlimit(static_cast<__rlimit_resource>(what), &l);
  }

  std::string scenario(const std::string& sweep = "{slips: [0.1, 0.3]}", double travel = 0.05) const {
    return write("scenario.yaml",
                 "title: small\n"
                 "wheel: {radius: 130 mm, width: 160 mm, mass: 3.2 kg}\n"
                 "soil:\n"
                 "  bekker: {cohesion: 96.24, friction_angle: 0.606, shear_modulus: 4.534 mm, k: 2.305e4, n: 0.418, plate_width: 5 cm}\n"
                 "  contact: {a0: 0.09, a1: 0.9}\n"
                 "rig: {normal_load: 115 N, angular_velocity: 17 deg/s, travel: " + std::to_string(travel) + " m}\n"
                 "terrain: {node_spacing: 1 cm}\n"
                 "sweep: " + sweep + "\n")
        .string();
  }

 private:
  fs::path folder_;
};

}  // namespace terrode
