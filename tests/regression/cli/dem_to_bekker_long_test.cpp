// Soil tests and a wheel on the same coarse grains, and Bekker's parameters of both: the whole command, half a minute.
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "program.h"

namespace terrode {
namespace {

TEST_F(ProgramTest, DemToBekkerFitsBothAndGoesOnFromWhatIsThere) {
  const fs::path scenario = write("small.yaml", R"(title: Small wheel on coarse grains
methods: [dem]
wheel: {radius: 60 mm, width: 50 mm, mass: 0.5 kg}
soil: {bekker: {cohesion: 0 Pa, friction_angle: 30 deg, shear_modulus: 5 mm, n: 1, k: 1e5 Pa, plate_width: 50 mm}, bulk_density: 1500 kg/m^3}
rig: {normal_load: 20 N, angular_velocity: 1.5 rad/s, travel: 0.08 m, ramp: 0.1 s}
particles: {smallest: 9 mm, largest: 12 mm, prism: 60 mm, depth: 45 mm, friction: 0.5, rolling: epsd, rolling_friction: 0.2}
)");
  const fs::path folder = file("out");
  const std::vector<std::string> command = {"dem-to-bekker", scenario.string(), "-o", folder.string(), "--slip", "0.1,0.3,0.5", "--repeats", "1",
                                            "--free", "k,friction_angle,shear_modulus", "--starts", "4", "--report", file("page.html").string(), "--quiet"};
  const Outcome first = run(command);
  ASSERT_EQ(first.status, 0) << first.err;
  const auto result = nlohmann::json::parse(content(folder / "result.json"));
  // What soil tests of grains with mu = 0.5 can be: no cohesion to speak of beside their strength, a friction angle of some tens of degrees.
  std::size_t compared = 0;
  for (const auto& row : result["disagreement"]) {
    EXPECT_TRUE(std::isfinite(row["soil_tests"].get<double>()) && std::isfinite(row["wheel"].get<double>())) << row.dump();
    ++compared;
  }
  EXPECT_EQ(compared, 3u);
  const auto shear = result["soil_tests"]["direct_shear"]["parameters"];
  EXPECT_GT(shear["friction_angle"]["value"].get<double>(), 0.2) << shear.dump();
  EXPECT_LT(shear["friction_angle"]["value"].get<double>(), 1.1);
  for (const char* channel : {"drawbar_pull", "driving_torque", "sinkage", "direct_shear", "pressure_sinkage"}) EXPECT_TRUE(result["prediction"].contains(channel)) << channel;
  EXPECT_GT(content(file("page.html")).size(), 10000u);
  // The soils that it writes are read by a scenario.
  for (const char* soil : {"soil_tests.yaml", "wheel.yaml"}) {
    const fs::path uses = write(std::string("uses_") + soil, "wheel: {radius: 60 mm, width: 50 mm}\nsoil: out/" + std::string(soil) + "\nrig: {normal_load: 20 N}\n");
    EXPECT_EQ(run({"sweep", uses.string(), "--method", "steady", "--slip", "0.2"}).status, 0) << soil << content(file("err.txt"));
  }
  // Nothing is computed again.
  std::map<fs::path, fs::file_time_type> written;
  for (const auto& entry : fs::directory_iterator(folder / "tests")) written[entry.path()] = entry.last_write_time();
  EXPECT_GE(written.size(), 5u);  // three stresses, two plates
  const Outcome again = run(command);
  ASSERT_EQ(again.status, 0) << again.err;
  for (const auto& [path, time] : written) EXPECT_EQ(fs::last_write_time(path), time) << path;
  EXPECT_EQ(nlohmann::json::parse(content(folder / "result.json")), result);
}

}  // namespace
}  // namespace terrode
