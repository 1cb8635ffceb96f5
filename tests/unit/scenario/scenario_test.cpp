#include "scenario/particle_tests.h"
#include "scenario/scenario.h"

#include "scenario/dem_file.h"
#include "scenario/methods.h"
#include "scenario/vehicle_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <numbers>

namespace terrode::scenario {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

const char* kWhole = R"(title: test
methods: [steady, node-spring]
wheel: {radius: 130 mm, width: 160 mm, grousers: {count: 12, height: 5 mm}}
soil:
  bekker: {cohesion: 0.2 kPa, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1.1, kc: 15.6 kN/m^2.1, kphi: 2407.4 kN/m^3.1}
rig: {normal_load: 80 N, angular_velocity: 17 deg/s}
effects: {slip_sinkage: {n1: 0.4}}
sweep: {slips: [-0.1, 0, 30 %]}
measured:
  source: a laboratory
  table:
    - {slip: 0.1, drawbar_pull: 11 N, sinkage: 5.5 mm, sinkage_std: 1 mm}
)";

std::string problems_of(const std::string& text) {
  try {
    parse_scenario(text, "s.yaml");
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

std::string changed(const std::string& from, const std::string& to) {
  std::string text = kWhole;
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Scenario, ReadsAWholeFile) {
  const Scenario s = parse_scenario(kWhole, "s.yaml");
  EXPECT_EQ(s.title, "test");
  EXPECT_EQ(s.methods, (std::vector<std::string>{"steady", "node-spring"}));
  EXPECT_DOUBLE_EQ(s.wheel.radius, 0.13);
  EXPECT_EQ(s.wheel.grouser_count, 12);
  EXPECT_DOUBLE_EQ(s.rig.angular_velocity, 17.0 * std::numbers::pi / 180.0);
  EXPECT_DOUBLE_EQ(s.soil.kc.value(), 15600.0);
  const bekker::Soil soil = s.bekker_soil();
  EXPECT_DOUBLE_EQ(soil.k, 15600.0 / 0.16 + 2407400.0);
  EXPECT_DOUBLE_EQ(soil.plate_width, 1.0);
  ASSERT_EQ(s.effects.size(), 1u);
  EXPECT_EQ(s.effects[0].id, "slip_sinkage");
  EXPECT_DOUBLE_EQ(s.effects[0].parameters.at("n1"), 0.4);
  const auto points = s.operating_points();
  ASSERT_EQ(points.size(), 3u);
  EXPECT_DOUBLE_EQ(points[2].slip, 0.3);
  EXPECT_DOUBLE_EQ(points[2].normal_load, 80.0);
  ASSERT_TRUE(s.measured);
  EXPECT_DOUBLE_EQ(s.measured->runs[0].steady.at("sinkage").mean, 5.5e-3);
  EXPECT_DOUBLE_EQ(s.measured->runs[0].steady.at("sinkage").std.value(), 1e-3);
}

TEST(Scenario, WritesWhatItReads) {
  const Scenario s = parse_scenario(kWhole, "s.yaml");
  const std::string once = to_yaml(s);
  const Scenario again = parse_scenario(once, "t.yaml");
  EXPECT_EQ(once, to_yaml(again));
  EXPECT_EQ(again.soil.kphi, s.soil.kphi);
  EXPECT_EQ(again.rig.angular_velocity, s.rig.angular_velocity);
  EXPECT_EQ(again.slips, s.slips);
  EXPECT_EQ(again.wheel.grouser_height, s.wheel.grouser_height);
  EXPECT_EQ(again.measured->runs.size(), 1u);
}

TEST(Scenario, SaysWhatIsWrongAndWhere) {
  EXPECT_THAT(problems_of(changed("radius: 130 mm", "radius: 130 kg")), HasSubstr("s.yaml:3:17: wheel.radius: is '130 kg'"));
  EXPECT_THAT(problems_of(changed("width: 160 mm", "width: -160 mm")),
              HasSubstr("s.yaml:3:32: wheel.width: is -160 mm, expected a value above 0 m"));
  EXPECT_THAT(problems_of(changed("80 N", ".nan")), HasSubstr("rig.normal_load: is '.nan', not a finite number"));
  EXPECT_THAT(problems_of(changed("cohesion", "cohesoin")), HasSubstr("did you mean 'cohesion'?"));
  EXPECT_THAT(problems_of(changed("n: 1.1, ", "")), HasSubstr("soil.bekker.kc"));
  EXPECT_THAT(problems_of(changed(", shear_modulus: 10 mm", "")), HasSubstr("s.yaml:5:11: soil.bekker.shear_modulus: is missing"));
  EXPECT_THAT(problems_of(changed("[steady, node-spring]", "[steady, node-sprong]")), HasSubstr("did you mean 'node-spring'?"));
  EXPECT_THAT(problems_of(changed("30 %", "1.5")), HasSubstr("s.yaml:8:26: sweep.slips[2]: is 1.5"));
  EXPECT_THAT(problems_of(changed("title: test", "title: test\ntitle: again")), HasSubstr("s.yaml:2:1: title: is given twice"));
  EXPECT_THAT(problems_of(changed("drawbar_pull: 11 N, sinkage", "sinkagge: 1, sinkage")), HasSubstr("measured.table[0].sinkagge"));
  EXPECT_THAT(problems_of(""), HasSubstr("the file is empty"));
  EXPECT_THAT(problems_of("just text"), HasSubstr("expected a section"));
}

TEST(Scenario, SlipConventionsTurnIntoOne) {
  const Scenario s = parse_scenario(changed("rig: {", "rig: {slip_convention: s = (omega r - v)/v, "), "s.yaml");
  const auto points = s.operating_points({1.0, -0.5});
  EXPECT_DOUBLE_EQ(points[0].slip, 0.5);
  EXPECT_DOUBLE_EQ(points[0].slip_given, 1.0);
  EXPECT_DOUBLE_EQ(points[1].slip, -1.0);
}

TEST(Scenario, SoilAndWheelMayBeFilesOfTheirOwn) {
  const fs::path folder = fs::temp_directory_path() / ("terrode_scenario_" + std::to_string(::getpid()));
  fs::create_directories(folder / "soils");
  std::ofstream(folder / "soils/a.yaml") << "bekker: {cohesion: 1, friction_angle: 0.5, shear_modulus: 1 cm, n: 1, k: 1e5, plate_width: 5 cm}\n";
  std::ofstream(folder / "soils/b.yaml") << "bekker:\n  cohesion: 1\n  n: none\n";
  const std::string rest = "wheel: {radius: 0.1, width: 0.1}\nrig: {normal_load: 10}\n";
  std::ofstream(folder / "a.yaml") << rest << "soil: soils/a.yaml\n";
  std::ofstream(folder / "b.yaml") << rest << "soil: soils/b.yaml\n";
  std::ofstream(folder / "c.yaml") << rest << "soil: soils/c.yaml\n";
  EXPECT_DOUBLE_EQ(load_scenario((folder / "a.yaml").string()).bekker_soil().k, 1e5);
  const auto problem = [&](const char* name) {
    try {
      load_scenario((folder / name).string());
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_THAT(problem("b.yaml"), HasSubstr("soils/b.yaml:3:6: bekker.n: is 'none', not a finite number"));
  EXPECT_THAT(problem("c.yaml"), HasSubstr("c.yaml:3:7: soil: names the file"));
  fs::remove_all(folder);
}

TEST(Slips, ListsAndRanges) {
  EXPECT_EQ(parse_slips("0.1"), std::vector<double>{0.1});
  EXPECT_EQ(parse_slips("-0.7,0.3"), (std::vector<double>{-0.7, 0.3}));
  EXPECT_EQ(parse_slips("0:0.3:0.1"), (std::vector<double>{0, 0.1, 0.2, 0.3}));
  EXPECT_EQ(parse_slips("0.2:-0.2:-0.2"), (std::vector<double>{0.2, 0, -0.2}));
  for (const char* bad : {"", "a", "1,,2", "0:1", "0:1:0", "0:1:-0.1", "0:1:1e-9", "nan", "0:inf:1", "1:2:3:4"})
    EXPECT_THROW(parse_slips(bad), InputError) << bad;
}

TEST(Particles, AreReadWrittenAndFilledInFromTheWheel) {
  const std::string text =
      "wheel: {radius: 100 mm, width: 50 mm}\n"
      "soil: {bekker: {cohesion: 0, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1, k: 10 kPa, plate_width: 50 mm}}\n"
      "rig: {normal_load: 20 N}\n";
  const Scenario plain = parse_scenario(text, "a.yaml");
  EXPECT_DOUBLE_EQ(particle_sizes(plain).largest, 0.108 * 0.1);
  EXPECT_DOUBLE_EQ(particle_window(plain).ahead, 0.16);
  const Scenario s = parse_scenario(text + "particles: {smallest: 2.5 mm, largest: 10 mm, window_ahead: 7 cm, bed: full, rolling: epsd, "
                                           "rolling_rate: 6.75e8, wheel_surface: spheres, time_step: 2 us}\n", "a.yaml");
  EXPECT_DOUBLE_EQ(particle_sizes(s).smallest, 2.5e-3);
  EXPECT_DOUBLE_EQ(particle_window(s).ahead, 0.07);
  const Scenario again = parse_scenario(to_yaml(s), "b.yaml");
  EXPECT_EQ(again.particles.bed, "full");
  EXPECT_EQ(again.particles.wheel_surface, "spheres");
  EXPECT_EQ(again.particles.time_step, s.particles.time_step);
  EXPECT_EQ(again.particles.rolling_rate, 6.75e8);
  const std::string named = "particles: {rolling: epsd2, approximate: [unprojected_rolling, wheel_rolling]}\n";
  EXPECT_EQ(parse_scenario(to_yaml(parse_scenario(text + named, "a.yaml")), "b.yaml").particles.approximate,
            (std::vector<std::string>{"unprojected_rolling", "wheel_rolling"}));
  try {
    parse_scenario(text + "particles: {approximate: [unprojected_roling]}\n", "a.yaml");
    ADD_FAILURE() << "taken";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("particles.approximate[0]: is 'unprojected_roling', expected one of unprojected_rolling"),
              std::string::npos)
        << e.what();
  }
  EXPECT_THROW(parse_scenario(text + "particles: {smallest: 5 mm, largest: 4 mm}\n", "a.yaml"), InputError);
  EXPECT_THROW(parse_scenario(text + "particles: {time_step_fraction: 0.5}\n", "a.yaml"), InputError);
}

TEST(Schema, NamesEveryKeyThatTheReaderKnows) {
  const auto schema = nlohmann::json::parse(scenario_schema());
  EXPECT_TRUE(schema["properties"]["rig"]["properties"].contains("normal_load"));
  EXPECT_EQ(schema["properties"]["wheel"]["anyOf"][1]["required"], (nlohmann::json{"radius", "width"}));
  EXPECT_TRUE(schema["properties"]["soil"]["anyOf"][1]["properties"]["bekker"]["properties"].contains("kphi"));
}

// What the rigid-body solver would divide by until its numbers overflow.
TEST(Scenarios, LoadsAndStepsTooSmallForAnyRigAreRefused) {
  const std::string soil =
      "wheel: {radius: 100 mm, width: 50 mm}\n"
      "soil: {bekker: {cohesion: 0, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1, k: 10 kPa, plate_width: 50 mm}}\n";
  EXPECT_THROW(parse_scenario(soil + "rig: {normal_load: 20 N, time_step: 5e-324}\n", "a.yaml"), InputError);
  const Scenario s = parse_scenario(soil + "rig: {normal_load: 1e-300, travel: 1 mm}\n", "a.yaml");
  EXPECT_THROW(make_method("node-spring", s).run(condition_of(s.operating_points({0.2}).front(), s.wheel.radius), {}), InputError);
}

TEST(Scenarios, ThoseOfTheRepositoryAreRead) {
  std::size_t count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TERRODE_SOURCE_DIR) / "scenarios")) {
    if (entry.path().extension() != ".yaml") continue;
    ++count;
    std::ifstream file(entry.path());
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    if (text.find("\nvehicle:") != std::string::npos) {
      EXPECT_NO_THROW(load_drive(entry.path().string())) << entry.path();
    } else if (is_particle_tests(entry.path().string())) {
      EXPECT_NO_THROW(load_particle_tests(entry.path().string())) << entry.path();
    } else {
      EXPECT_NO_THROW(load_scenario(entry.path().string())) << entry.path();
    }
  }
  EXPECT_GE(count, 3u);
}

}  // namespace
}  // namespace terrode::scenario
