// terrode oscillation on runs whose lines are known: ringing of a bed without damping, lugs, and flights on lunar simulant.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

class OscillationCommand : public ::testing::Test {
 protected:
  OscillationCommand() : folder_(fs::temp_directory_path() / ("terrode_oscillation_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~OscillationCommand() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
    return path(name);
  }

  // Standard output of the program; the test fails when it does.
  static std::string terrode(const std::string& arguments) {
    FILE* pipe = popen((std::string(TERRODE_PROGRAM) + " " + arguments).c_str(), "r");
    std::string out;
    char buffer[4096];
    for (std::size_t n = 0; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, n);
    EXPECT_EQ(pclose(pipe), 0) << arguments;
    return out;
  }

  // The wheel of Smith et al. on their Table 8 soil, 10 mm nodes.
  static std::string scenario(const std::string& terrain, const std::string& rig) {
    return "wheel: {radius: 130 mm, width: 160 mm, mass: 3.2 kg}\n"
           "soil:\n"
           "  bekker: {cohesion: 96.24, friction_angle: 0.606, shear_modulus: 4.534 mm, k: 2.305e4, n: 0.418, plate_width: 5 cm}\n"
           "  contact: {a0: 0.09, a1: 0.9}\n"
           "rig: {normal_load: 115 N, angular_velocity: 17 deg/s, slip: 0.3" +
           rig + "}\nterrain: {" + terrain + "}\n";
  }

  fs::path folder_;
};

TEST_F(OscillationCommand, NamesTheRingingOfAnUndampedBed) {
  const std::string s = write("s.yaml", scenario("node_spacing: 10 mm, unloading: elastic", ", travel: 20 cm"));
  terrode("run " + s + " --method node-spring --quiet -o " + path("r.h5"));
  const json report = json::parse(terrode("oscillation " + path("r.h5") + " --json"));
  int named = 0;
  for (const char* channel : {"drawbar_pull", "sinkage", "normal_load"})
    for (const json& line : report["files"][0]["channels"][channel]["lines"]) {
      if (line["driver"].get<std::string>().find("rings on its contact") == std::string::npos) continue;
      ++named;
      // 3.91 Hz: sqrt(7.07 kN/m over 11.7 kg)/2 pi of the steady wheel; found within 5 %.
      EXPECT_NEAR(line["frequency"].get<double>(), 3.91, 0.05 * 3.91) << channel;
      // A line stands above its background by more than the estimate's own uncertainty.
      const json& density = line["density"];
      EXPECT_LT(density["confidence_95"][0].get<double>(), density["value"].get<double>()) << channel;
      EXPECT_GT(density["confidence_95"][1].get<double>(), density["value"].get<double>()) << channel;
      EXPECT_GT(density["confidence_95"][0].get<double>(), density["background"].get<double>()) << channel;
      break;
    }
  EXPECT_EQ(named, 3);
}

TEST_F(OscillationCommand, FindsTheLugsOfASimulatedWheel) {
  const std::string s = write("s.yaml", scenario("node_spacing: 10 mm", ", travel: 20 cm") + "effects: {grousers: {count: 24, height: 8 mm}}\n");
  terrode("run " + s + " --method node-spring --quiet -o " + path("r.h5"));
  const json report = json::parse(terrode("oscillation " + path("r.h5") + " --grousers 24 --channel drawbar_pull --json"));
  const double passing = 24 * 17.0 / 360.0;  // Hz
  bool found = false;
  for (const json& line : report["files"][0]["channels"]["drawbar_pull"]["lines"]) {
    if (std::abs(line["frequency"].get<double>() - passing) > 0.02 * passing) continue;
    found = true;
    EXPECT_EQ(line["locked_to"], "wheel");
    EXPECT_NEAR(line["order"].get<double>(), 24.0, 0.5);
    EXPECT_THAT(line["driver"].get<std::string>(), HasSubstr("grouser passing (24 per turn)"));
  }
  EXPECT_TRUE(found);
}

// What docs/oscillation.md says of two flights with a wheel on GRC-1.
TEST_F(OscillationCommand, LunarGravityRunsShowLinesThatTwoRunsCannotPlace) {
  const char* shared = std::getenv("TERRODE_SHARED");
  const fs::path flights = (shared ? fs::path(shared) : fs::path(TERRODE_SOURCE_DIR) / ".." / "shared") / "recordings" / "concordia-grc1-single-wheel" / "processed";
  if (!fs::exists(flights)) GTEST_SKIP() << "the recordings are not there: " << flights;
  const std::string columns = write("columns.yaml",
                                    "columns:\n"
                                    "  time: time_s [s]\n"
                                    "  drawbar_pull: drawbar_N [N]\n"
                                    "  normal_load: normal_N [N]\n"
                                    "  sinkage: sinkage_mm [mm]\n"
                                    "  driving_torque: {column: motor_current_A, unit: A, torque_constant: 6.2 N m/A}\n");
  const json report = json::parse(terrode("oscillation " + (flights / "lunar_s20_run0.csv").string() + " " + (flights / "lunar_s20_run1.csv").string() +
                                          " --columns " + columns + " --radius 0.15 --angular-velocity 0.1333 --slip 0.2 --json --quiet"));
  const auto frequencies = [&](int run, const char* channel) {
    std::vector<double> out;
    for (const json& line : report["files"][run]["channels"][channel]["lines"]) {
      out.push_back(line["frequency"]);
      EXPECT_EQ(line["locked_to"], "undecided") << channel << " " << line["frequency"];
    }
    return out;
  };
  EXPECT_TRUE(frequencies(0, "drawbar_pull").empty());
  EXPECT_TRUE(frequencies(0, "normal_load").empty());
  EXPECT_TRUE(frequencies(1, "normal_load").empty());
  constexpr double bin = 0.1;  // Hz: the resolution of windows of ten seconds
  const auto has = [&](const std::vector<double>& all, double f) { return std::any_of(all.begin(), all.end(), [&](double x) { return std::abs(x - f) < bin; }); };
  EXPECT_TRUE(has(frequencies(0, "driving_torque"), 1.39));
  EXPECT_TRUE(has(frequencies(1, "driving_torque"), 1.40));
  EXPECT_TRUE(has(frequencies(1, "driving_torque"), 0.82));
  EXPECT_FALSE(has(frequencies(0, "driving_torque"), 0.82));
  EXPECT_TRUE(has(frequencies(1, "sinkage"), 0.42));
}

}  // namespace
