// The program as its users meet it: exit statuses, messages, and what is kept when something goes wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "recording/hdf5_file.h"
#include "recording/result_file.h"

namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using nlohmann::json;

std::string content(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

struct Outcome {
  int status = -1;
  std::string out, err;
};

class Program : public ::testing::Test {
 protected:
  Program() : folder_(fs::temp_directory_path() / ("terrode_program_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~Program() override { fs::remove_all(folder_); }

  fs::path file(const std::string& name) const { return folder_ / name; }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    return file(name);
  }

  pid_t start(const std::vector<std::string>& arguments, long file_size_limit = -1) const {
    const pid_t child = fork();
    if (child != 0) return child;
    freopen(file("out.txt").c_str(), "w", stdout);
    freopen(file("err.txt").c_str(), "w", stderr);
    if (file_size_limit >= 0) {
      const rlimit limit{static_cast<rlim_t>(file_size_limit), static_cast<rlim_t>(file_size_limit)};
      setrlimit(RLIMIT_FSIZE, &limit);
    }
    std::vector<char*> argv = {const_cast<char*>(TERRODE_PROGRAM)};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    execv(TERRODE_PROGRAM, argv.data());
    _exit(99);
  }
  Outcome wait(pid_t child) const {
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), content(file("out.txt")), content(file("err.txt"))};
  }
  Outcome run(const std::vector<std::string>& arguments, long file_size_limit = -1) const {
    return wait(start(arguments, file_size_limit));
  }

  // A small scenario with one piece of text replaced.
  std::string scenario(const std::string& from = "", const std::string& to = "") const {
    std::string text =
        "title: small\n"
        "wheel: {radius: 130 mm, width: 160 mm, mass: 3.2 kg}\n"
        "soil:\n"
        "  bekker: {cohesion: 96.24, friction_angle: 0.606, shear_modulus: 4.534 mm, k: 2.305e4, n: 0.418, plate_width: 5 cm}\n"
        "  contact: {a0: 0.09, a1: 0.9}\n"
        "rig:\n"
        "  normal_load: 115 N\n"
        "  angular_velocity: 17 deg/s\n"
        "  travel: 5 cm\n"
        "terrain: {node_spacing: 1 cm}\n"
        "sweep: {slips: [0.1, 0.3]}\n";
    if (!from.empty()) {
      const auto at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    }
    return write("scenario.yaml", text).string();
  }

  // One line on standard error that starts with the file and its line and says these words; exit status 2.
  void expect_refused(const std::string& file_name, const std::string& place, const std::vector<std::string>& words) const {
    const Outcome o = run({"sweep", file_name, "--method", "steady"});
    EXPECT_EQ(o.status, 2) << o.err;
    EXPECT_EQ(o.out, "");
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
    EXPECT_THAT(o.err, HasSubstr(file_name + place));
    for (const std::string& w : words) EXPECT_THAT(o.err, HasSubstr(w));
  }

  fs::path folder_;
};

TEST_F(Program, BadInputsAreOneClearLine) {
  expect_refused(file("missing.yaml").string(), ": cannot be read", {"No such file"});
  expect_refused(scenario("130 mm", "130 kg"), ":2:17: wheel.radius", {"'130 kg'", "expected a value above 0 m"});
  expect_refused(scenario("115 N", "NaN"), ":7:16: rig.normal_load", {"'NaN'", "above 0 N"});
  expect_refused(scenario("115 N", ".nan"), ":7:16: rig.normal_load", {"'.nan'", "not a finite number"});
  expect_refused(scenario("160 mm", "-160 mm"), ":2:32: wheel.width", {"is -160 mm", "above 0 m"});
  expect_refused(scenario("normal_load", "normal_laod"), ":7:3: rig.normal_laod", {"did you mean 'normal_load'?"});
  expect_refused(scenario("  travel: 5 cm", "  normal_load: 3"), ":9:3: rig.normal_load", {"given twice (first in line 7)"});
  expect_refused(scenario("115 N", "115 kN"), ":7:16: rig.normal_load", {"115000 N", "buried to its axle"});
  expect_refused(scenario("2.305e4", "10"), ":7:16: rig.normal_load", {"buried to its axle"});
  expect_refused(scenario("slips: [0.1, 0.3]", "slips: [0.1, 1.3]"), ":11:22: sweep.slips[1]", {"1.3", "at most 1"});
  expect_refused(scenario("  normal_load: 115 N\n", ""), ": rig.normal_load", {"is missing"});
  expect_refused(write("empty.yaml", "").string(), ": the file is empty", {});
  expect_refused(write("binary.yaml", std::string("\0\1\2", 3)).string(), ":1", {"zero byte"});
}

TEST_F(Program, AllProblemsAreSaidAtOnce) {
  const std::string name = scenario("radius: 130 mm, width: 160 mm", "radius: 1 s, width: 2 s");
  const Outcome o = run({"validate", name});
  EXPECT_EQ(o.status, 2);
  EXPECT_THAT(o.out, HasSubstr("wheel.radius"));
  EXPECT_THAT(o.out, HasSubstr("wheel.width"));
  const Outcome as_json = run({"validate", name, "--json"});
  const json document = json::parse(as_json.out);
  ASSERT_EQ(document["files"][0]["problems"].size(), 2u);
  EXPECT_EQ(document["files"][0]["problems"][1]["line"], 2);
  EXPECT_EQ(document["files"][0]["problems"][1]["key"], "wheel.width");
}

TEST_F(Program, RecordingsWithEmptyTablesAreRefused) {
  fs::create_directories(file("r"));
  std::ofstream(file("r/recording.yaml")) << "format: recording/1\nwheel: {radius: 0.13, width: 0.16}\n"
                                             "runs:\n  - {id: a, file: a.csv, slip: 0.1, normal_load: 100, angular_velocity: 0.3}\n";
  std::ofstream(file("r/a.csv")) << "";
  const Outcome o = run({"sweep", file("r").string()});
  EXPECT_EQ(o.status, 2);
  EXPECT_THAT(o.err, HasSubstr("a.csv"));
}

TEST_F(Program, CommandLineMistakesExitWith2) {
  for (const auto& arguments : std::vector<std::vector<std::string>>{
           {}, {"swep"}, {"sweep"}, {"sweep", "a", "--methd", "steady"}, {"sweep", "a", "--method", "stedy"},
           {"sweep", "a", "-j", "-3"}, {"schema", "nothing"}, {"completion", "fish"}}) {
    const Outcome o = run(arguments);
    EXPECT_EQ(o.status, 2) << o.err;
    EXPECT_EQ(o.out, "");
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
  }
  EXPECT_THAT(run({"swep"}).err, HasSubstr("did you mean 'sweep'?"));
  EXPECT_THAT(run({"sweep", "a", "--methd", "x"}).err, HasSubstr("did you mean '--method'?"));
  const Outcome slips = run({"sweep", scenario(), "--slip", "0:1"});
  EXPECT_EQ(slips.status, 2);
  EXPECT_THAT(slips.err, HasSubstr("FROM:TO:STEP"));
  const Outcome with_json = run({"sweep", file("missing.yaml").string(), "--json"});
  EXPECT_EQ(with_json.status, 2);
  EXPECT_THAT(json::parse(with_json.out)["error"].get<std::string>(), HasSubstr("missing.yaml"));
}

TEST_F(Program, HelpAndVersionGoToStandardOutput) {
  EXPECT_EQ(run({"--version"}).status, 0);
  EXPECT_THAT(run({"--version"}).out, HasSubstr("terrode "));
  EXPECT_THAT(run({"--help"}).out, HasSubstr("sweep"));
  EXPECT_THAT(run({"sweep", "--help"}).out, HasSubstr("--slip"));
  EXPECT_THAT(run({"completion", "bash"}).out, HasSubstr("complete -o"));
  EXPECT_THAT(run({"man"}).out, HasSubstr(".TH TERRODE"));
  EXPECT_EQ(json::parse(run({"schema", "recording"}).out)["title"], "Terrode recording");
  // The files that editors are pointed to know every section.
  for (const std::string kind : {"scenario", "recording", "vehicle", "particle_tests"}) {
    const json now = json::parse(run({"schema", kind}).out);
    const json kept = json::parse(content(fs::path(TERRODE_SOURCE_DIR) / "docs" / (kind + ".schema.json")));
    for (const auto& [key, value] : now["properties"].items())
      EXPECT_TRUE(kept["properties"].contains(key)) << "bring it up to date: terrode schema " << kind << " > docs/" << kind << ".schema.json";
  }
}

TEST_F(Program, SweepDocumentHasTheKeysOfTheContract) {
  const Outcome o = run({"sweep", scenario(), "--method", "steady,node-spring", "--json", "--quiet", "--csv", file("s.csv").string()});
  ASSERT_EQ(o.status, 0) << o.err;
  EXPECT_EQ(o.err, "");
  const json d = json::parse(o.out);
  EXPECT_EQ(d["slip_convention"], "s = 1 - v/(omega r)");
  ASSERT_EQ(d["results"].size(), 2u);
  EXPECT_EQ(d["results"][0]["method"], "steady");
  EXPECT_EQ(d["results"][1]["method"], "node-spring");
  for (const json& p : d["results"][0]["points"]) {
    for (const char* key : {"slip", "drawbar_pull", "driving_torque", "sinkage", "normal_load", "entry_angle", "cpu_seconds"})
      EXPECT_TRUE(p[key].is_number()) << key;
    EXPECT_FALSE(p.contains("drawbar_pull_std"));
  }
  for (const json& p : d["results"][1]["points"]) {
    for (const char* key : {"slip", "drawbar_pull", "driving_torque", "sinkage", "normal_load", "drawbar_pull_std", "drawbar_pull_sem",
                            "driving_torque_std", "driving_torque_sem", "sinkage_std", "sinkage_sem", "cpu_seconds", "simulated_seconds"})
      EXPECT_TRUE(p[key].is_number()) << key;
    EXPECT_FALSE(p.contains("entry_angle"));
  }
  const std::string csv = content(file("s.csv"));
  EXPECT_THAT(csv, HasSubstr("drawbar_pull [N],driving_torque [N m],sinkage [m]"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5);
}

TEST_F(Program, NumbersDoNotDependOnThreads) {
  const std::string name = scenario();
  const auto numbers = [&](const char* threads) {
    const json d = json::parse(run({"sweep", name, "--method", "node-spring", "--json", "--quiet", "-j", threads}).out);
    std::vector<double> out;
    for (const json& p : d["results"][0]["points"])
      for (const char* key : {"drawbar_pull", "driving_torque", "sinkage", "drawbar_pull_sem"}) out.push_back(p[key]);
    return out;
  };
  const auto one = numbers("1");
  ASSERT_EQ(one.size(), 8u);
  EXPECT_EQ(one, numbers("2"));
}

// Of a wheel on grains the seed is that of the bed.
TEST_F(Program, TheSeedReachesTheGrains) {
  setenv("TERRODE_CACHE", file("beds").string().c_str(), 1);
  const std::string name = file("small.yaml").string();
  std::ofstream(name) << "wheel: {radius: 40 mm, width: 25 mm, mass: 0.1 kg}\n"
                         "soil: {bekker: {cohesion: 0, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1, k: 10 kPa, plate_width: 50 mm}}\n"
                         "rig: {normal_load: 3 N, angular_velocity: 2, travel: 2 mm, ramp: 0.02}\n"
                         "particles: {smallest: 7 mm, largest: 8 mm, prism: 36 mm, depth: 24 mm, width: 36 mm, window_ahead: 36 mm,\n"
                         "            window_behind: 30 mm, time_step_fraction: 0.25}\n";
  const auto pull = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"sweep", name, "--method", "dem", "--slip", "0.3", "--json", "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome o = run(words);
    EXPECT_EQ(o.status, 0) << o.err;
    return json::parse(o.out)["results"][0]["points"][0]["drawbar_pull"].get<double>();
  };
  const double own = pull({});
  EXPECT_EQ(pull({"--seed", "1"}), own);
  EXPECT_NE(pull({"--seed", "2"}), own);
  unsetenv("TERRODE_CACHE");
}

// Of machines it is that of their sensors' noise, and of the bed they stand on.
TEST_F(Program, TheSeedReachesEveryMachine) {
  for (const char* name : {"a.yaml", "b.yaml"})
    std::ofstream(file(name)) << "vehicle: skid-steer-robot\nground: rigid\nscript: [{duration: 1 s, speed: 0.1 m/s}]\n";
  const std::string folder = file("machines").string();
  const Outcome o = run({"drive", file("a.yaml").string(), file("b.yaml").string(), "--until", "0.02", "--seed", "7", "-o", folder, "--quiet"});
  ASSERT_EQ(o.status, 0) << o.err;
  for (const char* name : {"a.h5", "b.h5"})
    EXPECT_EQ(terrode::recording::Hdf5File::open(folder + "/" + name).number_attribute("/", "seed"), 7.0) << name;
}

TEST_F(Program, ResultFilesAreResumedAndNeverMixed) {
  const std::string name = scenario(), output = file("o.h5").string();
  ASSERT_EQ(run({"sweep", name, "--method", "steady", "-o", output}).status, 0);
  const auto first = terrode::recording::read_result(output, "steady");
  const Outcome again = run({"sweep", name, "--method", "steady", "--slip", "0.1,0.2,0.3", "-o", output});
  EXPECT_THAT(again.err, HasSubstr("2 points were in"));
  const auto result = terrode::recording::read_result(output, "steady");
  ASSERT_EQ(result.runs.size(), 3u);
  EXPECT_EQ(result.runs[0].steady.at("drawbar_pull").mean, first.runs[0].steady.at("drawbar_pull").mean);

  const std::string before = content(output);
  const Outcome other = run({"sweep", scenario("115 N", "100 N"), "--method", "steady", "-o", output});
  EXPECT_EQ(other.status, 2);
  EXPECT_THAT(other.err, HasSubstr("--overwrite"));
  EXPECT_EQ(content(output), before);
  EXPECT_EQ(run({"sweep", name, "--method", "steady", "-o", output, "--overwrite"}).status, 0);
  EXPECT_EQ(run({"sweep", name, "-o", file("nowhere/o.h5").string()}).status, 2);
  write("text.h5", "no HDF5");
  EXPECT_EQ(run({"sweep", name, "-o", file("text.h5").string()}).status, 2);
  EXPECT_EQ(content(file("text.h5")), "no HDF5");
}

TEST_F(Program, AFullDiskLosesNothing) {
  const std::string name = scenario(), output = file("o.h5").string(), csv = file("o.csv").string();
  ASSERT_EQ(run({"sweep", name, "--method", "steady", "-o", output, "--csv", csv}).status, 0);
  const std::string h5_before = content(output), csv_before = content(csv);
  constexpr long kLimit = 1024;  // bytes: less than either file, more than any message
  const Outcome h5 = run({"sweep", name, "--method", "steady", "--slip", "0:0.9:0.01", "-o", output, "--quiet"}, kLimit);
  EXPECT_EQ(h5.status, 1) << h5.err;
  EXPECT_THAT(h5.err, HasSubstr("o.h5"));
  EXPECT_EQ(content(output), h5_before);
  const Outcome table = run({"sweep", name, "--method", "steady", "--slip", "0:0.9:0.1", "--csv", csv, "--quiet"}, kLimit);
  EXPECT_EQ(table.status, 1);
  EXPECT_THAT(table.err, HasSubstr("o.csv: cannot be written: File too large"));
  EXPECT_EQ(content(csv), csv_before);
  for (const auto& entry : fs::directory_iterator(folder_))
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr("tmp"))) << "left behind";
  // Standard output on a full device.
  const std::string command = std::string(TERRODE_PROGRAM) + " schema > /dev/full 2> " + file("full.txt").string();
  const int status = std::system(command.c_str());
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_THAT(content(file("full.txt")), HasSubstr("No space left on device"));
}

TEST_F(Program, CtrlCKeepsWhatIsDoneAndSaysHowToGoOn) {
  const std::string name = scenario("travel: 5 cm", "travel: 400 m"), output = file("o.h5").string();
  const pid_t child = start({"sweep", name, "--method", "steady,node-spring", "-o", output, "-j", "1", "--slip", "0.1,0.2"});
  // The steady points are there at once; node-spring would take hours.
  for (int i = 0; i < 600 && !fs::exists(output); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  kill(child, SIGINT);
  const Outcome o = wait(child);
  EXPECT_EQ(o.status, 130) << o.err;
  EXPECT_THAT(o.err, HasSubstr("interrupted"));
  EXPECT_THAT(o.err, HasSubstr("the same command goes on from there"));
  EXPECT_EQ(terrode::recording::read_result(output, "steady").runs.size(), 2u);
  const Outcome again = run({"sweep", name, "--method", "steady", "-o", output, "--slip", "0.1,0.2"});
  EXPECT_EQ(again.status, 0);
  EXPECT_THAT(again.err, HasSubstr("2 points were in"));
}

TEST_F(Program, RunWritesASeriesThatExportShows) {
  const std::string output = file("run.h5").string();
  const Outcome o = run({"run", scenario(), "--slip", "0.2", "-o", output, "--json", "--quiet"});
  ASSERT_EQ(o.status, 0) << o.err;
  const json d = json::parse(o.out);
  EXPECT_NEAR(d["channels"]["slip"]["mean"].get<double>(), 0.2, 1e-9);  // imposed by joints: solver's round-off
  const auto result = terrode::recording::read_result(output);
  ASSERT_EQ(result.runs.size(), 1u);
  EXPECT_EQ(result.runs[0].time.size(), d["samples"].get<std::size_t>());
  const Outcome csv = run({"export", output, "--to", "csv"});
  EXPECT_THAT(csv.out, HasSubstr("time [s],"));
  EXPECT_EQ(static_cast<std::size_t>(std::count(csv.out.begin(), csv.out.end(), '\n')), result.runs[0].time.size() + 1);
}

// The numbers that the comments of the scenarios promise.
TEST_F(Program, ScenariosGiveTheNumbersTheyPromise) {
  struct Promise {
    const char* name;
    const char* slips;
    double drawbar_pull[3], driving_torque[3], sinkage_mm[3];
  };
  const Promise promises[] = {
      {"mms_table1", "-0.7,0,0.3", {-66.8, 48.3, 54.9}, {-6.6, 8.5, 9.6}, {9.6, 9.6, 10.0}},
      {"mms_table8", "-0.7,0,0.3", {-46.1, 3.6, 36.3}, {-2.6, 3.7, 8.2}, {16.5, 15.3, 15.8}},
      {"ding2011", "0.1,0.3,0.6", {3.7, 16.4, 24.6}, {2.4, 4.5, 6.0}, {9.8, 10.0, 10.6}},
  };
  constexpr double kHalfDigit = 0.0501;  // the promises have one decimal
  for (const Promise& p : promises) {
    const fs::path path = fs::path(TERRODE_SOURCE_DIR) / "scenarios" / (std::string(p.name) + ".yaml");
    const Outcome o = run({"sweep", path.string(), "--method", "steady", "--slip", p.slips, "--json"});
    ASSERT_EQ(o.status, 0) << o.err;
    const json points = json::parse(o.out)["results"][0]["points"];
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(points[i]["drawbar_pull"].get<double>(), p.drawbar_pull[i], kHalfDigit) << p.name << " " << i;
      EXPECT_NEAR(points[i]["driving_torque"].get<double>(), p.driving_torque[i], kHalfDigit) << p.name << " " << i;
      EXPECT_NEAR(points[i]["sinkage"].get<double>() * 1e3, p.sinkage_mm[i], kHalfDigit) << p.name << " " << i;
    }
  }
}

TEST_F(Program, ReportAndFigureAreWritten) {
  ASSERT_EQ(run({"sweep", scenario(), "--method", "steady", "--report", file("r.html").string(), "--figure", file("f.svg").string()}).status, 0);
  EXPECT_THAT(content(file("r.html")), HasSubstr("small"));
  EXPECT_THAT(content(file("f.svg")), HasSubstr("<svg"));
  EXPECT_TRUE(fs::exists(file("f_torque.svg")));
}

TEST_F(Program, DiagnosesBesideAReference) {
  const std::string ding = TERRODE_SOURCE_DIR "/recordings/ding2011", pavlov = TERRODE_SOURCE_DIR "/recordings/pavlov2022";
  const Outcome same = run({"diagnose", ding, "--reference", ding, "-o", file("d").string(), "--no-replay", "--json", "--quiet"});
  ASSERT_EQ(same.status, 0) << same.err;
  EXPECT_EQ(json::parse(same.out)["verdict"], "no_mismatch");
  const Outcome other = run({"diagnose", ding, "--reference", pavlov, "-o", file("d").string(), "--no-replay", "--quiet"});
  EXPECT_EQ(other.status, 2);
  EXPECT_THAT(other.err, HasSubstr("--reference"));
  EXPECT_THAT(other.err, HasSubstr("shares no condition"));
}

TEST_F(Program, RunsSoilTestsOnParticlesAndGoesOnWithThem) {
  ::setenv("TERRODE_CACHE", file("cache").c_str(), 1);
  const fs::path tests = write("tests.yaml", R"(particle_tests:
  time_step: 10 us
  grains: {smallest: 5 mm, largest: 7 mm}
  direct_shear: {width: 40 mm, length: 40 mm, height: 20 mm, normal_stress: [2 kPa, 8 kPa], rate: 100 mm/s, travel: 2 mm, seating: 10 ms, samples: 10}
)");
  const std::vector<std::string> command = {"run", tests.string(), "-o", file("out.h5").string(), "--csv", file("out.csv").string(),
                                            "--soil", file("soil.yaml").string(), "--json", "--quiet"};
  const Outcome first = run(command);
  ASSERT_EQ(first.status, 0) << first.err;
  const json document = json::parse(first.out);
  EXPECT_EQ(document["curves"].size(), 2u);
  EXPECT_EQ(document["curves"][1]["normal_stress"], 8000.0);
  EXPECT_GT(document["fit"]["friction_angle"]["value"].get<double>(), 0.0);
  EXPECT_THAT(content(file("soil.yaml")), HasSubstr("friction_angle"));
  EXPECT_THAT(content(file("out.csv")), HasSubstr("direct_shear,8000,0.1,mean,"));
  const Outcome again = run(command);
  EXPECT_EQ(json::parse(again.out)["curves"], document["curves"]);
  EXPECT_EQ(json::parse(again.out)["cpu_seconds"], document["cpu_seconds"]);  // nothing was run a second time
  EXPECT_EQ(run({"run", tests.string(), "--slip", "0.2"}).status, 2);
}

}  // namespace
