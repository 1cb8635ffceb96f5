// The ground of a scenario: laws, shape, soils by place and by depth.
#include "scenario/ground.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "scenario/methods.h"
#include "scenario/scenario.h"
#include "scenario/vehicle_file.h"

namespace terrode::scenario {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

const std::string kBase = R"(wheel: {radius: 130 mm, width: 160 mm}
soil: {bekker: {cohesion: 100 Pa, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1, k: 100 kPa, plate_width: 50 mm}}
rig: {normal_load: 80 N}
)";

Scenario with(const std::string& more) { return parse_scenario(kBase + more, "s.yaml"); }

std::string problems_of(const std::string& more) {
  try {
    with(more);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

bekker::LocalSoil at(const Scenario& s, double x, double y, double depth) {
  bekker::LocalSoil soil(s.bekker_soil());
  soil_field(s)->at(x, y, depth, soil);
  return soil;
}

TEST(Laws, AreChosenByName) {
  const Scenario plain = with("");
  EXPECT_EQ(point_law(plain).law.pressure_law, nullptr);
  EXPECT_EQ(point_law(plain).law.shear_law, nullptr);
  const Scenario s = with(R"(laws:
  pressure: {name: wong, kp: 300 kN/m^3, mm: 50 kN/m^3, hydraulic_diameter: 10 cm}
  shear: {name: oida, residual: 0.6, peak_displacement: 8 mm}
  failure: {name: interface_friction, delta: 20 deg, adhesion: 10 Pa}
  rate: penetration_rate
  damping: {name: viscous, coefficient: 2e4 Pa s/m}
)");
  const GroundLaw owned = point_law(s);
  const bekker::PointLaw& law = owned.law;
  ASSERT_NE(law.pressure_law, nullptr);
  ASSERT_NE(law.shear_law, nullptr);
  EXPECT_NEAR(law.pressure_law->pressure({}, {}, 0.01), 3e5 * 0.01 + 4 * 5e4 * 1e-4 / 0.1, 1e-9);
  EXPECT_NEAR(law.shear_law->mobilised({}, 8e-3), 1.0, 1e-12);
  ASSERT_EQ(s.effects.size(), 2u);
  EXPECT_EQ(s.effects[0].id, "penetration_rate");
  EXPECT_NEAR(s.effects[1].parameters.at("delta"), std::acos(-1.0) / 9, 1e-12);
  EXPECT_EQ(s.terrain.damping, 2e4);
  const Scenario again = parse_scenario(to_yaml(s), "t.yaml");
  EXPECT_EQ(to_yaml(again), to_yaml(s));
  EXPECT_EQ(again.pressure_law.parameters.at("kp"), 3e5);
  EXPECT_EQ(again.effects.size(), 2u);
}

TEST(Laws, BekkersModuliMayBeThoseOfTheSoil) {
  const std::string text =
      "wheel: {radius: 130 mm, width: 160 mm}\nrig: {normal_load: 80 N}\nlaws: {pressure: bekker}\n"
      "soil: {bekker: {cohesion: 0, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1.1, kc: 15.6 kN/m^2.1, kphi: 2407.4 kN/m^3.1}}\n";
  const Scenario s = parse_scenario(text, "s.yaml");
  bekker::Context context;
  context.width = 0.16;
  const bekker::LocalSoil soil(s.bekker_soil());
  EXPECT_NEAR(point_law(s).law.pressure_law->pressure(soil, context, 0.02), bekker::power_law_pressure(soil, 0.02), 1e-6);
}

TEST(Laws, SayWhatIsWrongAndWhere) {
  EXPECT_THAT(problems_of("laws: {pressure: wang}\n"), HasSubstr("s.yaml:4:18: laws.pressure: is 'wang'"));
  EXPECT_THAT(problems_of("laws: {pressure: wang}\n"), HasSubstr("did you mean 'wong'"));
  EXPECT_THAT(problems_of("laws: {pressure: wong}\n"), HasSubstr("laws.pressure.kp: is missing"));
  EXPECT_THAT(problems_of("laws: {shear: {name: oida, residual: 1, peak_displacement: 1 mm}}\n"), HasSubstr("laws.shear.residual"));
  EXPECT_THAT(problems_of("laws: {shear: {name: janosi, K: 1 mm}}\n"), HasSubstr("laws.shear.K: is not a known key"));
  EXPECT_THAT(problems_of("laws: {pressure: {kp: 1}}\n"), HasSubstr("laws.pressure.name: is missing"));
  EXPECT_THAT(problems_of("effects: {shear_rate: {}}\nlaws: {rate: shear_rate}\n"), HasSubstr("stands under effects too"));
  EXPECT_THAT(problems_of("terrain: {damping: 1}\nlaws: {damping: {name: viscous, coefficient: 2}}\n"), HasSubstr("laws.damping"));
  EXPECT_THAT(problems_of("laws: {pressure: reece}\nsoil_layers: [{}]\n"), HasSubstr("laws.pressure.kc: is missing"));
  EXPECT_THAT(problems_of("laws: {pressure: {name: reece, kc: 1, kphi: 1}}\nsoil_layers: [{}]\n"), HasSubstr("knows no layers"));
}

TEST(SoilLayers, GrowOnFromWhereTheOneAboveEnds) {
  const Scenario s = with("soil_layers: [{thickness: 2 cm}, {soil: {bekker: {k: 1 MPa, cohesion: 1 kPa}}}]\n");
  EXPECT_EQ(at(s, 0, 0, 0.01).k, 1e5);
  const bekker::LocalSoil deep = at(s, 3, -2, 0.03);
  EXPECT_NEAR(bekker::power_law_pressure(deep, 0.03), 1e5 * 0.4 + 1e6 * 0.2, 1e-6);
  EXPECT_EQ(deep.cohesion, 1e3);
  const Scenario again = parse_scenario(to_yaml(s), "t.yaml");
  EXPECT_EQ(to_yaml(again), to_yaml(s));
  EXPECT_EQ(at(again, 0, 0, 0.03).k, deep.k);
  EXPECT_THAT(problems_of("soil_layers: [{soil: {}}, {}]\n"), HasSubstr("soil_layers[0].thickness: is missing"));
  EXPECT_THAT(problems_of("soil_layers: {thickness: 1 cm}\n"), HasSubstr("soil_layers: is no list"));
  EXPECT_THAT(problems_of("soil_layers: [{soil: {bekker: {k: -1}}}]\n"), HasSubstr("soil_layers[0].soil.bekker.k"));
}

TEST(SoilMap, RectanglesAndSharesOfPlace) {
  const Scenario s = with(R"(soil_map:
  - {share: {kind: slope, at: 1 m, run: 2 m}, soil: {bekker: {k: 300 kPa, cohesion: 500 Pa}}}
  - {x0: 5, x1: 6, y0: -1, y1: 1, soil: {bekker: {k: 1 MPa}}}
)");
  EXPECT_EQ(at(s, 0, 0, 0.01).k, 1e5);
  EXPECT_NEAR(at(s, 2, 0, 0.01).k, 2e5, 1e-6);
  EXPECT_NEAR(at(s, 2, 0, 0.01).cohesion, 300, 1e-9);
  EXPECT_EQ(at(s, 4, 0, 0.01).k, 3e5);
  EXPECT_EQ(at(s, 5.5, 0, 0.01).k, 1e6);
  EXPECT_EQ(at(s, 5.5, 2, 0.01).k, 3e5);
  EXPECT_EQ(to_yaml(parse_scenario(to_yaml(s), "t.yaml")), to_yaml(s));
  EXPECT_THAT(problems_of("soil_map: [{x0: 0, x1: 0, y0: 0, y1: 1, soil: {}}]\n"), HasSubstr("soil_map[0].x1: makes an empty rectangle"));
  EXPECT_THAT(problems_of("soil_map: [{x0: 0, share: {kind: level}, soil: {}}]\n"), HasSubstr("soil_map[0].x0: stands beside share"));
  EXPECT_THAT(problems_of("soil_map: [{x0: 0, x1: 1, y0: 0, y1: 1}]\n"), HasSubstr("soil_map[0].soil: is missing"));
  EXPECT_THAT(problems_of("soil_map: [{share: {kind: step, at: 0}, soil: {}}]\n"), HasSubstr("soil_map[0].share.height: is missing"));
}

TEST(SoilMap, LiesOverLayersAndServesVehiclesToo) {
  const std::string keys =
      "soil_layers: [{thickness: 1 cm}, {soil: {bekker: {k: 1 MPa}}}]\n"
      "soil_map: [{x0: 0, x1: 1, y0: 0, y1: 1, soil: {bekker: {k: 20 kPa}}}]\nlaws: {shear: {name: wong_peak, residual: 0.7, peak_displacement: 5 mm}}\n";
  const Scenario s = with(keys);
  EXPECT_EQ(at(s, 0.5, 0.5, 0.05).k, 2e4);
  EXPECT_GT(at(s, 2, 2, 0.05).k, 5e5);
  const DriveScenario d = parse_drive(kBase.substr(kBase.find("soil:"), kBase.find("rig:") - kBase.find("soil:")) + keys +
                                          "vehicle: skid-steer-robot\nscript: [{duration: 1 s, speed: 0.1}]\n", "d.yaml");
  EXPECT_EQ(at(d.base, 0.5, 0.5, 0.05).k, 2e4);
  EXPECT_EQ(d.base.shear_law.name, "wong_peak");
}

TEST(GroundShape, OfARigIsThatOfItsFile) {
  const fs::path folder = fs::temp_directory_path() / ("terrode_ground_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "grid.asc") << "ncols 2\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 1\n0.1 0.2\n0.3 0.4\n";
  std::ofstream(folder / "s.yaml") << kBase << "surface: [{kind: ascii, file: grid.asc}, {kind: slope, angle: 0.1 rad}, {kind: fractal, rms_height: 1 cm, seed: 7}]\n";
  std::ofstream(folder / "bad.yaml") << kBase << "surface: {kind: ascii, file: none.asc}\n";
  const Scenario s = load_scenario((folder / "s.yaml").string());
  ASSERT_NE(s.surface, nullptr);
  const auto fractal = make_surface({[] { SurfacePart p; p.kind = "fractal"; p.seed = 7; return p; }()});
  EXPECT_NEAR(s.surface->height(1, 0), 0.4 + std::tan(0.1) + fractal->height(1, 0), 1e-12);
  EXPECT_NE(ground_files(s).find("grid.asc"), std::string::npos);
  const Scenario again = parse_scenario(to_yaml(s), "/elsewhere.yaml");
  EXPECT_EQ(again.surface->height(0.3, 0.7), s.surface->height(0.3, 0.7));
  try {
    load_scenario((folder / "bad.yaml").string());
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("bad.yaml:4:10: surface.file"));
  }
  fs::remove_all(folder);
  EXPECT_THAT(problems_of("surface: {kind: hill}\n"), HasSubstr("s.yaml:4:17: surface.kind: is 'hill'"));
  EXPECT_THAT(problems_of("surface: {kind: slope, height: 1}\n"), HasSubstr("surface.height: is not a known key"));
  EXPECT_EQ(with("surface: {kind: level}\n").surface, nullptr);
}

TEST(GroundShape, MethodsThatDoNotKnowItRefuseIt) {
  for (const char* more : {"surface: {kind: slope, angle: 0.1}\n", "soil_map: [{x0: 0, x1: 1, y0: 0, y1: 1, soil: {}}]\n"}) {
    const Scenario s = with(more);
    EXPECT_THROW(make_method("steady", s), InputError) << more;
    EXPECT_THROW(make_method("dem", s), InputError) << more;
    EXPECT_NO_THROW(make_method("node-spring", s)) << more;
  }
  const Scenario layers = with("soil_layers: [{thickness: 1 cm}, {soil: {bekker: {k: 1 MPa}}}]\n");
  EXPECT_NO_THROW(make_method("steady", layers));
  EXPECT_THROW(make_method("dem", layers), InputError);
}

}  // namespace
}  // namespace terrode::scenario
