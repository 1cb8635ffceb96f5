#include "scenario/recording_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>

namespace terrode::scenario {
namespace {

using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

// Exact up to the rounding of one division or unit factor.
constexpr double kRounding = 1e-12;

const char* const kRun =
    "time [s],drawbar_pull [N],driving_torque [N mm],sinkage [mm]\n0.00,1.5,200,5\n0.04,1.6,210,6\n0.08,1.7,220,7\n";

class RecordingFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("terrode_recording_" + std::to_string(::getpid()) + "_" +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    put("run.csv", kRun);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  void put(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  RecordingCheck check(const std::string& yaml) const {
    put("recording.yaml", yaml);
    return check_recording(folder_.string());
  }
  static std::vector<std::string> texts(const Problems& problems) {
    std::vector<std::string> out;
    for (const Problem& p : problems) out.push_back(p.text());
    return out;
  }
  std::filesystem::path folder_;
};

TEST_F(RecordingFileTest, ReadsRunsWithUnits) {
  const auto c = check(R"(format: recording/1
title: One wheel
wheel: {radius: 130 mm, width: 0.16, mass: 3200 g, surface: aluminium, grousers: {count: 12, height: 5 mm}}
soil:
  name: sand
  bulk_density: 1.6 g/cm^3
  bekker: {cohesion: 0.2 kPa, friction_angle: 30 deg, shear_modulus: 1 cm, n: 1.1, kc: 15.6 kN/m^2.1, kphi: 2407.4e3}
runs:
- {id: a, file: run.csv, slip: 20 %, normal_load: 115, angular_velocity: 17 deg/s, pass: 2, repeat: 3, operator: Ada}
- {file: run.csv, slip: -0.5}
)");
  ASSERT_THAT(texts(c.problems), ElementsAre());
  const auto& r = c.recording;
  EXPECT_NEAR(r.wheel.radius, 0.13, kRounding);
  EXPECT_EQ(r.wheel.grouser_count, 12);
  EXPECT_NEAR(*r.soil.kc, 15600, 1e-9);
  EXPECT_EQ(*r.soil.kphi, 2407.4e3);
  EXPECT_EQ(*r.soil.a0, 0.18);
  ASSERT_EQ(r.runs.size(), 2u);
  EXPECT_EQ(r.runs[0].condition.pass, 2);
  EXPECT_EQ(r.runs[0].condition.extra.at("operator"), "Ada");
  EXPECT_NEAR(r.runs[0].condition.slip, 0.2, kRounding);
  EXPECT_NEAR(*r.runs[0].condition.forward_velocity, 17 * std::numbers::pi / 180 * 0.13 * 0.8, kRounding);
  EXPECT_EQ(r.runs[1].id, "run");
  EXPECT_EQ(r.runs[1].condition.pass, 1);
  EXPECT_EQ(*r.runs[1].condition.angular_velocity, kAssumedAngularVelocity);
  EXPECT_THAT(r.runs[0].find("driving_torque")->values, ElementsAre(testing::DoubleNear(0.2, kRounding), testing::DoubleNear(0.21, kRounding),
                                                                    testing::DoubleNear(0.22, kRounding)));
  EXPECT_NEAR(r.runs[0].find("sinkage")->values[2], 0.007, kRounding);
  EXPECT_THAT(r.runs[0].lines, ElementsAre(2, 3, 4));
  EXPECT_THAT(r.remarks, Contains(HasSubstr("0.3 rad/s is assumed")));
  EXPECT_THAT(r.remarks, Contains(HasSubstr("operator")));
}

TEST_F(RecordingFileTest, ConvertsEveryTextOfTheSlipConvention) {
  // omega r = 1, v = 2 (braking) and v = 0.8 (driving): s = 1 - v/(omega r) is -1 and 0.2.
  const std::string head = "format: recording/1\nwheel: {radius: 0.1, width: 0.1}\n";
  const std::string runs = "runs:\n- {id: b, file: run.csv, slip: %B}\n- {id: d, file: run.csv, slip: %D}\n- {id: l, file: run.csv, slip: %L}\n";
  struct Case {
    const char *text, *braking, *driving, *locked;
  };
  for (const Case& k : {Case{"s = 1 - v/(omega r)", "-1", "0.2", "-1e9"},
                        Case{"s = 1 - v/(omega r) driving, omega r/v - 1 braking", "-0.5", "0.2", "-1"},
                        Case{"s = (omega r - v)/v", "-0.5", "0.25", "-1"}}) {
    std::string text = runs;
    for (const auto& [mark, value] : {std::pair{"%B", k.braking}, {"%D", k.driving}, {"%L", k.locked}}) text.replace(text.find(mark), 2, value);
    const auto c = check(head + "slip_convention: " + k.text + "\n" + text);
    ASSERT_THAT(texts(c.problems), ElementsAre()) << k.text;
    EXPECT_NEAR(c.recording.runs[0].condition.slip, -1.0, kRounding) << k.text;
    EXPECT_NEAR(c.recording.runs[1].condition.slip, 0.2, kRounding) << k.text;
    EXPECT_LE(c.recording.runs[2].condition.slip, -1e9) << k.text;
  }
  const auto bad = check(head + "slip_convention: s = v/(omega r)\n" + "runs: [{file: run.csv, slip: 0.1}]\n");
  EXPECT_THAT(texts(bad.problems), ElementsAre(HasSubstr("slip_convention: is 's = v/(omega r)'")));
  EXPECT_THAT(texts(check(head + "runs: [{file: run.csv, slip: 1.2}]\n").problems), ElementsAre(HasSubstr("runs[0].slip: is 1.2")));
}

TEST_F(RecordingFileTest, SaysEveryProblemWithItsPlace) {
  put("bad.csv", "time [s],drawbar_pull,sinkage [kg]\n0,1,2\n0.1,x,2\n0.05,3,2\n");
  const auto c = check(R"(format: recording/2
titel: near miss
unheard: of
wheel: {radius: -130 mm}
runs:
- {id: a, file: bad.csv, slip: 0.1}
- {id: a, file: gone.csv, slip: 0.2, pas: 3}
soil_tests:
- {kind: pressure_sinkage, file: run.csv, plate_width: 50 mm}
- {kind: vane, file: run.csv}
)");
  const auto t = texts(c.problems);
  const std::string y = (folder_ / "recording.yaml").string();
  for (const std::string& part :
       {y + ":1:9: format: is 'recording/2'", y + ":2:1: titel: is not a known key (did you mean 'title'?)", y + ":4:17: wheel.radius: is -130 mm",
        std::string("wheel.width: is missing"), std::string("bad.csv:1:10: drawbar_pull: has no unit"),
        std::string("bad.csv:1:23: sinkage: has the unit 'kg', which cannot be converted"), std::string("bad.csv:3:5: drawbar_pull: is 'x'"),
        std::string("bad.csv:4: time: goes back from 0.1 s to 0.05 s"), std::string("runs[1].file: names "),
        std::string("runs[1].pas: is not a known key (did you mean 'pass'?)"), std::string("runs[1].id: 'a' is given twice"),
        std::string("soil_tests[0].plate_length: is missing"), std::string("soil_tests[1].kind: is 'vane'"),
        std::string("run.csv:1: pressure: is missing")})
    EXPECT_THAT(t, Contains(HasSubstr(part)));
  EXPECT_EQ(c.recording.extra.at("unheard"), "of");
  EXPECT_THROW(load_recording(folder_.string()), InputError);
  EXPECT_THROW(check_recording((folder_ / "nowhere").string()), InputError);
}

TEST_F(RecordingFileTest, ReadsATableOfSteadyValues) {
  put("runs.csv", "id,slip [%],normal_load [N],angular_velocity [rad/s],drawbar_pull [N],drawbar_pull_std [N],sinkage [mm],driving_torque [N m],day\n"
                  "p,20,115,0.3,12.5,0.5,8.0,,Mon\nq,-50,115,0.3,-20,0.6,NaN,1.5,Tue\n");
  const auto c = check("format: recording/1\nwheel: {radius: 0.13, width: 0.16}\nruns_table: runs.csv\n");
  ASSERT_THAT(texts(c.problems), ElementsAre());
  ASSERT_EQ(c.recording.runs.size(), 2u);
  const auto& p = c.recording.runs[0];
  EXPECT_EQ(p.id, "p");
  EXPECT_NEAR(p.condition.slip, 0.2, kRounding);
  EXPECT_EQ(p.steady.at("drawbar_pull").mean, 12.5);
  EXPECT_EQ(p.steady.at("drawbar_pull").std, 0.5);
  EXPECT_NEAR(p.steady.at("sinkage").mean, 0.008, kRounding);
  EXPECT_FALSE(p.steady.contains("driving_torque"));
  EXPECT_FALSE(c.recording.runs[1].steady.contains("sinkage"));
  EXPECT_EQ(p.condition.extra.at("day"), "Mon");
  EXPECT_THAT(c.recording.remarks, Contains(HasSubstr("'day' is not known: kept")));

  put("runs.csv", "slip,drawbar_pul [N],time [s],sinkage [N]\n0.1,1,2,3\nx,1,2,3\n");
  const auto t = texts(check("format: recording/1\nwheel: {radius: 0.13, width: 0.16}\nruns_table: runs.csv\n").problems);
  EXPECT_THAT(t, Contains(HasSubstr("drawbar_pul: is not a known column (did you mean 'drawbar_pull'?)")));
  EXPECT_THAT(t, Contains(HasSubstr("time: stands in a table of steady values")));
  EXPECT_THAT(t, Contains(HasSubstr("sinkage: has the unit 'N'")));
  EXPECT_THAT(t, Contains(HasSubstr("runs.csv:3:1: slip: is 'x'")));
}

TEST_F(RecordingFileTest, ReadsSoilTests) {
  put("plate.csv", "sinkage [mm],pressure [kPa]\n1,2\n2,4\n,5\n3,6\n");
  put("shear.csv", "shear_displacement [m],shear_stress [Pa]\n0.001,100\n0.002,150\n0.003,160\n");
  const auto c = check(R"(format: recording/1
wheel: {radius: 0.13, width: 0.16}
runs: [{file: run.csv, slip: 0.1}]
soil_tests:
- {kind: pressure_sinkage, file: plate.csv, plate_width: 150 mm, plate_length: 50 mm, rate: 10 mm/s}
- {kind: pressure_sinkage, file: plate.csv, plate_shape: circle, plate_diameter: 0.1}
- {kind: direct_shear, file: shear.csv, normal_stress: 2.08 kPa}
)");
  ASSERT_THAT(texts(c.problems), ElementsAre());
  ASSERT_EQ(c.recording.pressure_sinkage.size(), 2u);
  EXPECT_NEAR(c.recording.pressure_sinkage[0].plate_width, 0.05, kRounding);
  EXPECT_NEAR(c.recording.pressure_sinkage[0].pressure[2], 6000, 1e-9);
  EXPECT_TRUE(c.recording.pressure_sinkage[1].circular);
  EXPECT_NEAR(c.recording.direct_shear[0].normal_stress, 2080, 1e-9);
  EXPECT_THAT(c.recording.direct_shear[0].shear_stress, ElementsAre(100, 150, 160));
  EXPECT_THAT(c.recording.remarks, Contains(HasSubstr("1 rows with empty cells")));
}

TEST_F(RecordingFileTest, ReadsThroughAColumnMap) {
  put("lab.txt", "rig 7\n0,0;10,0;-1,5;1,0;0;0,5\n0,1;10,5;-1,6;1,1;0,05;0,6\n0,2;11,0;-1,7;1,2;0,15;0,7\n0,3;11,5;-1,8;1,3;0,25;0,8\n");
  put("tare.txt", "rig 7\n0;0;-0,5;0,1;0;0\n1;0;-0,5;0,1;1;0\n");
  const std::string map = R"(format: recording/1
wheel: {radius: 0.13, width: 0.16}
csv: {separator: semicolon, decimal: comma, header: no, skip_rows: 1}
columns:
  time: {column: 1, unit: s}
  sinkage: {column: 2, unit: mm, offset: -10 mm}
  drawbar_pull: {column: 3, unit: N, sign: -1}
  driving_torque: {column: 4, unit: A, torque_constant: 6.2 N m/A}
  normal_load: {column: 6, unit: kN, clock: 5}
tare: tare.txt
runs: [{file: lab.txt, slip: 0.1}]
)";
  // Column 5 has no unit of its own; the clock of a column is asked for one, which stands in brackets behind it.
  EXPECT_THAT(texts(check(map).problems), Contains(HasSubstr("5: has no unit, expected '5 [s]'")));
  const auto c = check(std::string(map).replace(map.find("clock: 5"), 8, "clock: '5 [s]'"));
  ASSERT_THAT(texts(c.problems), ElementsAre());
  const auto& run = c.recording.runs[0];
  EXPECT_NEAR(run.time[3], 0.3, kRounding);
  EXPECT_NEAR(run.find("sinkage")->values[3], 0.0015, kRounding);
  EXPECT_NEAR(run.find("drawbar_pull")->values[0], 1.5 - 0.5, kRounding);
  EXPECT_NEAR(run.find("driving_torque")->values[2], 6.2 * (1.2 - 0.1), kRounding);
  EXPECT_NEAR(run.find("normal_load")->values[1], 650, 1e-9);
}

TEST_F(RecordingFileTest, MapsSubtractsTareAndBringsClocksTogether) {
  put("lab.csv", "t [s],h [mm],F [N],I [A],t2 [s],W [kN]\n0.0,10,-1.5,1.0,0,0.5\n0.1,10.5,-1.6,1.1,0.05,0.6\n0.2,11,-1.7,1.2,0.15,0.7\n0.3,11.5,-1.8,1.3,0.25,0.8\n");
  put("tare.csv", "t [s],h [mm],F [N],I [A],t2 [s],W [kN]\n0,0,-0.5,0.1,0,0\n1,0,-0.5,0.1,1,0\n");
  const auto c = check(R"(format: recording/1
wheel: {radius: 0.13, width: 0.16}
columns:
  time: t
  sinkage: {column: h, offset: -10 mm}
  drawbar_pull: {column: F, sign: -1}
  driving_torque: {column: I, torque_constant: 6.2}
  normal_load: {column: W, clock: t2}
tare: tare.csv
runs: [{file: lab.csv, slip: 0.1}]
)");
  ASSERT_THAT(texts(c.problems), ElementsAre());
  const auto& run = c.recording.runs[0];
  EXPECT_NEAR(run.find("sinkage")->values[3], 0.0015, kRounding);
  EXPECT_NEAR(run.find("drawbar_pull")->values[0], 1.5 - 0.5, kRounding);
  EXPECT_NEAR(run.find("driving_torque")->values[2], 6.2 * (1.2 - 0.1), kRounding);
  EXPECT_NEAR(run.find("normal_load")->values[1], 650, 1e-9) << "half way between 0.05 s and 0.15 s";
  EXPECT_TRUE(std::isnan(run.find("normal_load")->values[3])) << "after the end of its own clock";
  EXPECT_THAT(c.recording.remarks, Contains(HasSubstr("tare subtracted")));
}

TEST_F(RecordingFileTest, TakesSlipFromMeasuredVelocities) {
  put("v.csv", "time [s],angular_velocity [rad/s],forward_velocity [m/s]\n0,0.5,0.04\n0.1,0.5,0.04\n");
  const auto c = check("format: recording/1\nwheel: {radius: 0.1, width: 0.16}\nruns: [{file: v.csv}, {id: b, file: run.csv}]\n");
  EXPECT_THAT(texts(c.problems), ElementsAre(HasSubstr("runs[1].slip: is missing")));
  EXPECT_NEAR(c.recording.runs[0].condition.slip, 0.2, kRounding);
}

TEST_F(RecordingFileTest, LeavesOutRepeatedTimesAndSaysSo) {
  put("r.csv", "time [s],drawbar_pull [N],extra\n0,1,a\n0.1,2,b\n0.1,2,c\n0.2,,d\n");
  const auto c = check("format: recording/1\nwheel: {radius: 0.1, width: 0.16}\nruns: [{file: r.csv, slip: 0}]\n");
  ASSERT_THAT(texts(c.problems), ElementsAre());
  EXPECT_THAT(c.recording.runs[0].time, ElementsAre(0, 0.1, 0.2));
  EXPECT_TRUE(std::isnan(c.recording.runs[0].find("drawbar_pull")->values[2]));
  EXPECT_THAT(c.recording.remarks, Contains(HasSubstr("1 samples repeat the time before them (first in line 4)")));
  EXPECT_THAT(c.recording.remarks, Contains(HasSubstr("'extra' holds text")));
}

std::filesystem::path shared() {
  if (const char* s = std::getenv("TERRODE_SHARED")) return s;
  return std::filesystem::path(TERRODE_SOURCE_DIR) / ".." / "shared";
}

TEST(SharedRecordings, EveryCampaignLoads) {
  const auto folder = shared() / "concealed";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no shared recordings here";
  int campaigns = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!entry.is_directory()) continue;
    ++campaigns;
    const auto c = check_recording(entry.path().string());
    EXPECT_TRUE(c.problems.empty()) << c.problems.front().text();
    EXPECT_TRUE(c.recording.remarks.empty()) << c.recording.remarks.front();
    for (const auto& run : c.recording.runs) EXPECT_EQ(run.channels.size(), 6u);
  }
  EXPECT_EQ(campaigns, 16);
}

TEST(SharedRecordings, TheSteadyTableOfARealWheelLoads) {
  const auto folder = shared() / "recordings" / "cmu-pavlov-single-wheel";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no shared recordings here";
  const auto c = check_recording(folder.string());
  EXPECT_TRUE(c.problems.empty()) << c.problems.front().text();
  EXPECT_EQ(c.recording.runs.size(), 27u);
  EXPECT_EQ(c.recording.pressure_sinkage.size(), 9u);
  EXPECT_TRUE(std::isinf(c.recording.runs[0].condition.slip)) << "a locked wheel";
}

}  // namespace
}  // namespace terrode::scenario
