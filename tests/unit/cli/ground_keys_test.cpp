// What scenarios can say of the ground acts on the runs of rigs and vehicles.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kLoad = 115.0, kRadius = 0.13;
const std::string kSoil =
    "soil: {bulk_density: 1600, bekker: {cohesion: 139 Pa, friction_angle: 0.606 rad, shear_modulus: 5 mm, k: 120 kPa, n: 1.1, plate_width: 50 mm}}\n";

class GroundKeys : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("terrode_ground_keys_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // The result of a command on a scenario of this text; null and a failure where it did not end well.
  Json result(const std::string& command, const std::string& scenario) const {
    const fs::path file = folder_ / "s.yaml";
    std::ofstream(file) << scenario;
    std::string text, call = std::string(TERRODE_PROGRAM) + " " + command;
    call.replace(call.find('@'), 1, file.string());
    FILE* pipe = popen((call + " --json --quiet 2>&1").c_str(), "r");
    std::array<char, 4096> buffer;
    for (std::size_t n; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) text.append(buffer.data(), n);
    EXPECT_EQ(pclose(pipe), 0) << call << "\n" << text;
    return Json::parse(text, nullptr, false);
  }

  static std::string rig(const std::string& more, const std::string& terrain = "node_spacing: 10 mm") {
    return "wheel: {radius: 130 mm, width: 160 mm, mass: 3.2 kg}\n" + kSoil + "rig: {normal_load: 115 N, angular_velocity: 17 deg/s, travel: 0.35 m, slip: 0.3}\n" +
           "terrain: {" + terrain + "}\n" + more;
  }

  fs::path folder_;
};

struct Means {
  double pull = 0, torque = 0, sinkage = 0;
};
Means of(const Json& sweep, std::size_t method) {
  const Json& p = sweep["results"][method]["points"][0];
  return {p["drawbar_pull"].get<double>() / kLoad, p["driving_torque"].get<double>() / (kLoad * kRadius), p["sinkage"].get<double>()};
}
double apart(const Means& a, const Means& b) {
  return std::max({std::abs(a.pull - b.pull), std::abs(a.torque - b.torque), std::abs(a.sinkage / b.sinkage - 1)});
}

TEST_F(GroundKeys, LawsAndLayersActInBothMethodsAlike) {
  const std::string sweep = "sweep @ --method steady,node-spring --slip 0.3";
  const Means plain = of(result(sweep, rig("")), 0);
  for (const char* more : {
           "laws: {pressure: {name: bekker, kc: 2 kN/m^2.1, kphi: 1500 kN/m^3.1}}\n",
           "laws: {pressure: {name: reece, kc: 20, kphi: 200}}\n",
           "laws: {pressure: {name: wong, kp: 400 kN/m^3, mm: 100 kN/m^3, hydraulic_diameter: 12 cm}}\n",
           "laws: {shear: {name: wong_peak, residual: 0.4, peak_displacement: 60 mm}}\n",
           "laws: {shear: {name: oida, residual: 0.4, peak_displacement: 25 mm}}\n",
           "laws: {failure: {name: interface_friction, delta: 20 deg}}\n",
           "laws: {rate: {name: shear_rate, lambda: 0.1}}\n",
           "soil_layers: [{thickness: 5 mm}, {soil: {bekker: {k: 500 kPa}}}]\n",
           "soil_layers: [{thickness: 4 mm}, {thickness: 4 mm, soil: {bekker: {k: 400 kPa}}}, {soil: {bekker: {k: 60 kPa, cohesion: 300 Pa}}}]\n",
       }) {
    const Json both = result(sweep, rig(more));
    ASSERT_TRUE(both.contains("results")) << more;
    const Means steady = of(both, 0), nodes = of(both, 1);
    EXPECT_LT(apart(nodes, steady), 0.03) << more;
    EXPECT_GT(apart(steady, plain), 0.03) << more;
    const Json& point = both["results"][1]["points"][0];
    EXPECT_LT(std::abs(point["energy_audit"].get<double>()), 1e-3) << more;
    EXPECT_GT(point["work_in"].get<double>(), point["energy_plastic"].get<double>());
  }
}

TEST_F(GroundKeys, SoilOfPlaceAndShapeActOnTheRig) {
  const auto sinkage = [&](const std::string& more, const std::string& terrain = "node_spacing: 10 mm") {
    const Json run = result("run @", rig(more, terrain));
    EXPECT_LT(std::abs(run["energy"]["energy_audit"].get<double>()), 1e-3) << more;
    return run["channels"]["sinkage"]["mean"].get<double>();
  };
  const double plain = sinkage("");
  const double soft = sinkage("soil_map: [{x0: 0.15, x1: 9, y0: -9, y1: 9, soil: {bekker: {k: 50 kPa}}}]\n");
  EXPECT_GT(soft, 1.5 * plain);
  const double half = sinkage("soil_map: [{share: {kind: level, height: 0.5}, soil: {bekker: {k: 40 kPa}}}]\n");
  const double mean = sinkage("soil_map: [{x0: -9, x1: 9, y0: -9, y1: 9, soil: {bekker: {k: 80 kPa}}}]\n");
  EXPECT_NEAR(half, mean, 1e-9);
  // A rig measures sinkage from the ground as it was, so that a slope is a slope.
  EXPECT_NEAR(sinkage("surface: {kind: slope, angle: 1 deg}\n"), plain, 0.05 * plain);
  const std::string elastic = "node_spacing: 10 mm, unloading: elastic_plastic, unloading_k0: 20 MPa/m";
  EXPECT_NE(sinkage("", elastic), plain);
}

TEST_F(GroundKeys, TheScenarioWithAllOfThemRunsAndItsBooksClose) {
  const fs::path file = fs::path(TERRODE_SOURCE_DIR) / "scenarios" / "layered.yaml";
  std::ifstream in(file);
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  const Json run = result("run @", text);
  ASSERT_TRUE(run.contains("energy"));
  EXPECT_LT(std::abs(run["energy"]["energy_audit"].get<double>()), 1e-3) << run["energy"];
  EXPECT_GT(run["energy"]["energy_damping"].get<double>(), 0.0);
  EXPECT_GT(run["channels"]["sinkage"]["mean"].get<double>(), 1e-3);
}

TEST_F(GroundKeys, VehiclesFeelLayersLawsAndFeet) {
  const auto drive = [&](const std::string& more) {
    const Json run = result("run @", "vehicle: skid-steer-robot\n" + kSoil + "terrain: {node_spacing: 10 mm}\nscript: [{duration: 2 s, speed: 0.2}]\n" + more);
    return run["wheels"][0]["sinkage"].get<double>();
  };
  const double plain = drive("");
  EXPECT_LT(drive("soil_layers: [{thickness: 2 mm}, {soil: {bekker: {k: 2 MPa}}}]\n"), 0.8 * plain);
  EXPECT_GT(drive("laws: {pressure: {name: wong, kp: 100 kN/m^3, mm: 10 kN/m^3, hydraulic_diameter: 12 cm}}\n"), 1.2 * plain);
  // A sledge that stands on the point of a foot of convex hulls beside its wheels.
  const std::string cart = R"(vehicle:
  name: cart
  bodies:
    - {name: frame, mass: 20 kg, position: [0, 0, 0.2], size: [0.5, 0.3, 0.1], pieces: [[[0.28, -0.03, -0.205], [0.34, -0.03, -0.205], [0.34, 0.03, -0.205], [0.28, 0.03, -0.205], [0.28, 0, 0], [0.34, 0, 0]]]}
  wheels:
    - {name: left, parent: frame, centre: [-0.2, 0.2, 0.1], mass: 1 kg, radius: 100 mm, width: 80 mm, drive: {kind: speed, max_torque: 5 N m}, grousers: {count: 12, height: 5 mm, thickness: 4 mm, shape: triangular}}
    - {name: right, parent: frame, centre: [-0.2, -0.2, 0.1], mass: 1 kg, radius: 100 mm, width: 80 mm, drive: {kind: speed, max_torque: 5 N m}}
)";
  const Json run = result("run @", cart + kSoil + "terrain: {node_spacing: 10 mm}\nscript: [{duration: 1 s, speed: 0.05}]\n");
  ASSERT_TRUE(run.contains("wheels")) << run;
  double carried = 0.0;
  for (const Json& w : run["wheels"]) carried += w["normal_load"].get<double>();
  const double weight = 22 * 9.81;
  EXPECT_LT(carried, 0.85 * weight);  // the foot carries the rest
  EXPECT_GT(carried, 0.3 * weight);
}

}  // namespace
