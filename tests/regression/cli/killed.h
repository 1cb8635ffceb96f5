// Programs that are killed at random moments, started again until they end, and compared with one left alone.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "core/random.h"
#include "dem/bed.h"
#include "recording/checkpoint.h"
#include "recording/result_file.h"

namespace terrode {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

class Killed : public ::testing::Test {
 protected:
  // In memory where there is such a place: a kill does not ask for a disk, and syncing one takes most of the time.
  Killed() : folder_((fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) /
                     ("terrode_killed_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~Killed() override { fs::remove_all(folder_); }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    return file(name);
  }

  static pid_t start(const std::function<void()>& work) {
    const pid_t child = fork();
    if (child == 0) {
      try {
        work();
      } catch (const std::exception& e) {
        std::fprintf(stderr, "%s\n", e.what());
        _exit(1);
      }
      _exit(0);
    }
    return child;
  }
  std::function<void()> program(const Arguments& arguments) const {
    return [this, arguments] {
      freopen(file("err.txt").c_str(), "a", stderr);
      freopen("/dev/null", "w", stdout);
      std::vector<char*> argv = {const_cast<char*>(TERRODE_PROGRAM)};
      for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
      argv.push_back(nullptr);
      execv(TERRODE_PROGRAM, argv.data());
      _exit(99);
    };
  }
  // Seconds that the work takes when it is left alone.
  static double run(const std::function<void()>& work) {
    const auto begin = std::chrono::steady_clock::now();
    int status = 0;
    waitpid(start(work), &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  // Kills the work `kills` times at random moments, starting it again each time, then lets it end. After each kill
  // `look` sees what lies there. A work that ends before its kill is begun again by `clear`, after `compare`.
  void kill_often(const std::function<void()>& work, int kills, double seconds, const std::function<void()>& look,
                  const std::function<void()>& compare, const std::function<void()>& clear) {
    Random random = Random::stream(static_cast<std::uint64_t>(::getpid()), 7);
    SCOPED_TRACE("process " + std::to_string(::getpid()));
    for (int done = 0; done < kills && !HasFatalFailure();) {
      const pid_t child = start(work);
      std::this_thread::sleep_for(std::chrono::duration<double>(random.uniform(0.0, 0.5 * seconds)));
      kill(child, SIGKILL);
      int status = 0;
      waitpid(child, &status, 0);
      if (WIFSIGNALED(status)) {
        ++done;
        look();
        continue;
      }
      ASSERT_EQ(WEXITSTATUS(status), 0) << std::ifstream(file("err.txt")).rdbuf();
      compare();
      clear();
    }
    run(work);
    compare();
  }

  // Every number, text and attribute of a result file but those that tell when, how and how fast it was made.
  static std::string contents(const recording::Hdf5File& f, const std::string& group = "/") {
    std::string out;
    const auto skipped = [](const std::string& name) {
      return name == "cpu_seconds" || name == "created" || name == "command";
    };
    const auto add_attributes = [&](const std::string& path) {
      for (const std::string& name : f.attributes(path)) {
        if (skipped(name)) continue;
        out += path + "@" + name + "=" + f.text_attribute(path, name).value_or("");
        if (const auto numbers = f.numbers_attribute(path, name))
          out.append(reinterpret_cast<const char*>(numbers->data()), numbers->size() * sizeof(double));
        out += "\n";
      }
    };
    add_attributes(group);
    for (const std::string& name : f.children(group)) {
      const std::string path = (group == "/" ? "" : group) + "/" + name;
      if (skipped(name)) continue;
      if (f.is_group(path)) {
        out += contents(f, path);
        continue;
      }
      add_attributes(path);
      out += path + ":";
      if (f.is_numeric(path)) {
        const auto values = f.read<double>(path).values;
        out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
      } else {
        for (const std::string& s : f.read_text(path)) out += s + "\n";
      }
    }
    return out;
  }

  // Kills `terrode ARGUMENTS -o FILE`.
  void kill_program(const Arguments& arguments, int kills) {
    const std::string whole = file("whole.h5"), cut = file("cut.h5");
    const auto with = [&](const std::string& output) {
      Arguments a = arguments;
      a.insert(a.end(), {"-o", output, "--checkpoint", "0.05", "--quiet"});
      return program(a);
    };
    const double seconds = run(with(whole));
    const std::string wanted = contents(recording::Hdf5File::open(whole));
    const auto whole_run = recording::Hdf5File::open(whole).is_group("/run")
                               ? recording::read_series(recording::Hdf5File::open(whole), "/run")
                               : recording::Run{};
    int seen = 0;
    kill_often(
        with(cut), kills, seconds,
        [&] {
          if (!fs::exists(cut)) return;
          const auto f = recording::Hdf5File::open(cut);  // throws where it does not open
          recording::read_header(f);
          if (!f.is_group("/run") || whole_run.time.empty()) return;
          ++seen;
          const recording::Run until = recording::read_series(f, "/run");
          ASSERT_LE(until.time.size(), whole_run.time.size());
          EXPECT_EQ(std::memcmp(until.time.data(), whole_run.time.data(), until.time.size() * sizeof(double)), 0);
          for (const recording::Channel& c : until.channels)
            EXPECT_EQ(std::memcmp(c.values.data(), whole_run.find(c.name)->values.data(), c.values.size() * sizeof(double)), 0)
                << c.name;
        },
        [&] { EXPECT_TRUE(contents(recording::Hdf5File::open(cut)) == wanted) << "resumed and uninterrupted runs differ"; },
        [&] { fs::remove(cut); });
    RecordProperty("files_seen_after_a_kill", seen);
  }

  std::string rig_scenario(const std::string& method, double travel) const {
    return write("scenario.yaml",
                 "title: killed\n"
                 "wheel: {radius: 130 mm, width: 160 mm, mass: 3.2 kg}\n"
                 "soil:\n"
                 "  bekker: {cohesion: 96.24, friction_angle: 0.606, shear_modulus: 4.534 mm, k: 2.305e4, n: 0.418, plate_width: 5 cm}\n"
                 "  contact: {a0: 0.09, a1: 0.9}\n"
                 "rig: {normal_load: 115 N, angular_velocity: 17 deg/s, travel: " + std::to_string(travel) + " m}\n"
                 "terrain: {node_spacing: 1 cm}\n"
                 "methods: [" + method + "]\n"
                 "sweep: {slips: [0, 0.1, 0.2, 0.3, 0.4, 0.5]}\n");
  }
  std::string drive_scenario(double duration) const {
    return write("drive.yaml",
                 "vehicle: rocker-bogie-rover\n"
                 "soil:\n"
                 "  bekker: {cohesion: 139.28 Pa, friction_angle: 0.606, shear_modulus: 0.5151 mm, k: 2.541e5 Pa, n: 1.387, plate_width: 50 mm}\n"
                 "terrain: {node_spacing: 10 mm}\n"
                 "settle_time: 0.3 s\n"
                 "script: [{duration: " + std::to_string(duration) + " s, speed: 0.1 m/s, curvature: 0.3 1/m}]\n");
  }

  // Kills the settling of a bed.
  void kill_settling(double height, int kills) {
    dem::BedRecipe recipe;
    recipe.width = recipe.length = 0.02;
    recipe.height = height;
    recipe.sizes.smallest = 3e-3;
    recipe.sizes.largest = 4e-3;
    const auto settle = [&](const std::string& output, const dem::BedCheckpoint& checkpoint) {
      return [=] { dem::save_bed(dem::prepare_bed(recipe, 1, {}, checkpoint), output); };
    };
    const std::string whole = file("bed.h5"), cut = file("bed2.h5"), state = file("bed.unfinished");
    const double seconds = run(settle(whole, {}));
    const std::string wanted = contents(recording::Hdf5File::open(whole));
    int seen = 0;
    kill_often(
        settle(cut, {state, 0.05}), kills, seconds,
        [&] {
          if (!fs::exists(state)) return;
          ++seen;
          EXPECT_TRUE(recording::read_checkpoint(recording::Hdf5File::open(state)).has_value());
        },
        [&] { EXPECT_TRUE(contents(recording::Hdf5File::open(cut)) == wanted); },
        [&] {
          fs::remove(cut);
          fs::remove(state);
        });
    EXPECT_GT(seen, 0);
  }

 private:
  fs::path folder_;
};

}  // namespace terrode
