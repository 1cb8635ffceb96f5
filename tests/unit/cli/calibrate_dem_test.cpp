// `terrode calibrate-dem` on a handful of grains: what it keeps, that it goes on, and what it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

std::string content(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

class CalibrateDem : public ::testing::Test {
 protected:
  CalibrateDem() : folder_(fs::temp_directory_path() / ("terrode_calibrate_dem_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "box");
    std::ofstream(folder_ / "box/recording.yaml")
        << "format: recording/1\ntitle: box\nwheel: {radius: 0.13, width: 0.16}\nslip_convention: s = 1 - v/(omega r)\nruns_table: runs.csv\n"
           "soil_tests:\n  - {kind: direct_shear, normal_stress: 4000, file: a.csv}\n";
    std::ofstream(folder_ / "box/runs.csv") << "slip,normal_load [N],angular_velocity [rad/s]\n0.3,115,0.3\n";
    std::ofstream(folder_ / "box/a.csv") << "shear_displacement [m],shear_stress [Pa]\n0,0\n1e-3,1500\n2e-3,2200\n3e-3,2600\n4e-3,2700\n";
  }
  ~CalibrateDem() override { fs::remove_all(folder_); }

  pid_t start(std::vector<std::string> more, const std::string& out = "s") const {
    std::vector<std::string> words = {"terrode", "calibrate-dem", (folder_ / "box").string(), "-o", (folder_ / out).string(), "--free", "friction", "--set", "young_modulus=1 MPa",
                                      "--grains", "4", "--box", "30 mm", "--confirm", "1", "-j", "2", "--json", "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    const pid_t child = fork();
    if (child != 0) return child;
    freopen((folder_ / "out.txt").c_str(), "w", stdout);
    freopen((folder_ / "err.txt").c_str(), "w", stderr);
    std::vector<char*> argv;
    for (std::string& w : words) argv.push_back(w.data());
    argv.push_back(nullptr);
    execv(TERRODE_PROGRAM, argv.data());
    _exit(99);
  }
  int wait(pid_t child) const {
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  int run(std::vector<std::string> more, const std::string& out = "s") const { return wait(start(std::move(more), out)); }
  json result() const { return json::parse(content(folder_ / "out.txt")); }

  fs::path folder_;
};

TEST_F(CalibrateDem, KeepsEvaluationsAndGoesOnFromThem) {
  ASSERT_EQ(run({"--evaluations", "6", "--report", (folder_ / "page.html").string()}), 0) << content(folder_ / "err.txt");
  const json whole = result();
  EXPECT_EQ(whole["evaluations"]["count"], 6);
  EXPECT_EQ(whole["tests"][0]["simulated"].size(), 12u);
  EXPECT_EQ(whole["best_so_far"].size(), 6u);
  EXPECT_TRUE(whole["parameters"]["friction"].contains("low"));
  EXPECT_TRUE(fs::exists(folder_ / "s/progress.svg"));
  EXPECT_TRUE(fs::exists(folder_ / "s/result.json"));
  EXPECT_THAT(content(folder_ / "page.html"), HasSubstr("Best so far"));
  // Three evaluations lost, one of them only asked for: the same command computes these alone and comes to the same end.
  const auto kept = fs::last_write_time(folder_ / "s/evaluations/0002.json");
  json asked = json::parse(content(folder_ / "s/evaluations/0003.json"));
  asked.erase("curves");
  std::ofstream(folder_ / "s/evaluations/0003.json") << asked.dump();
  fs::remove(folder_ / "s/evaluations/0004.json");
  fs::remove(folder_ / "s/evaluations/0005.json");
  ASSERT_EQ(run({"--evaluations", "6"}), 0) << content(folder_ / "err.txt");
  EXPECT_EQ(result()["parameters"], whole["parameters"]);
  EXPECT_EQ(result()["best_so_far"], whole["best_so_far"]);
  EXPECT_EQ(fs::last_write_time(folder_ / "s/evaluations/0002.json"), kept);
  // More evaluations of the same search are added; another search is refused.
  ASSERT_EQ(run({"--evaluations", "8"}), 0) << content(folder_ / "err.txt");
  EXPECT_EQ(result()["evaluations"]["count"], 8);
  EXPECT_EQ(run({"--evaluations", "6", "--range", "friction=0.2:0.6"}), 2);
  EXPECT_THAT(content(folder_ / "err.txt"), HasSubstr("another folder"));
}

TEST_F(CalibrateDem, AnInterruptedSearchKeepsWhatWasComputed) {
  const pid_t child = start({"--evaluations", "400"}, "long");
  // The first batch holds a third of the evaluations: it is under way.
  for (int i = 0; i < 2000 && content(folder_ / "long/evaluations/0003.json").find("curves") == std::string::npos; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  kill(child, SIGINT);
  EXPECT_EQ(wait(child), 130);
  EXPECT_THAT(content(folder_ / "err.txt"), HasSubstr("goes on from there"));
  for (const auto& e : fs::directory_iterator(folder_ / "long/evaluations"))
    if (e.path().extension() == ".json") {
      EXPECT_FALSE(json::parse(content(e.path())).contains("error")) << e.path();
    }
}

TEST_F(CalibrateDem, RefusesWhatIsWrongWithOneLine) {
  EXPECT_EQ(run({"--set", "friction=0.5"}), 2);
  EXPECT_THAT(content(folder_ / "err.txt"), HasSubstr("--set: names friction, which is free"));
  EXPECT_EQ(run({"--range", "friction=0.5"}), 2);
  EXPECT_EQ(run({"--range", "friction=0.5:0.2"}), 2);
  EXPECT_EQ(run({"--range", "restitution=0.2:0.5"}), 2);
  EXPECT_EQ(run({"--set", "colour=3"}), 2);
  EXPECT_EQ(run({"--set", "restitution=3"}), 2);
  EXPECT_EQ(run({"--grains", "5,8", "--evaluations", "10"}), 2);
  EXPECT_EQ(run({"--evaluations", "2"}), 2);
  EXPECT_EQ(run({"--max-shear", "-1 mm"}), 2);
}

}  // namespace
