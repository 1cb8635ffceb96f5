// A wheel of convex pieces, whose contacts libccd finds, beside the wheel in closed form that it copies.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "scenario/methods.h"

namespace terrode::scenario {
namespace {

const char* const rig = R"(
soil: {bekker: {cohesion: 139.28 Pa, friction_angle: 0.606, shear_modulus: 5 mm, k: 1e5 Pa, n: 1, plate_width: 50 mm}}
rig: {normal_load: 80 N, angular_velocity: 17 deg/s, slip: 0.3, travel: 0.25 m, ramp: 0.3 s}
terrain: {node_spacing: 10 mm}
)";

std::string points(const std::vector<Vec3>& list) {
  std::string out = "[";
  for (const Vec3& p : list) out += fmt::format("{}[{}, {}, {}]", out.size() > 1 ? ", " : "", p.x(), p.y(), p.z());
  return out + "]";
}

// Of a wheel r = 100 mm, b = 80 mm: a sector from the axle to the chord of a rim that has its radius in the mean.
std::vector<Vec3> sector(double from, double to) {
  const double r = 0.1 / std::cos(0.25 * (to - from));
  std::vector<Vec3> out;
  for (const double y : {-0.04, 0.04}) {
    out.emplace_back(0.0, y, 0.0);
    for (const double a : {from, to}) out.emplace_back(-r * std::sin(a), y, -r * std::cos(a));
  }
  return out;
}

// Means of the last two fifths of a run, in which twelve lugs pass more than once.
std::array<double, 3> result_of(const std::string& wheel) {
  const Scenario s = parse_scenario("wheel: " + wheel + rig, "wheel.yaml");
  const vehicle::PointResult r = make_method("node-spring", s, {}).run(condition_of(s.operating_points({0.3}).front(), s.wheel.radius), {});
  std::array<double, 3> out{};
  const char* const channels[] = {"drawbar_pull", "driving_torque", "sinkage"};
  for (std::size_t c = 0; c < 3; ++c) {
    const std::vector<double>& v = r.run.find(channels[c])->values;
    const std::size_t from = v.size() * 3 / 5;
    for (std::size_t i = from; i < v.size(); ++i) out[c] += v[i] / static_cast<double>(v.size() - from);
  }
  return out;
}

// Tolerance in load, load times radius, and radius.
void expect_alike(const std::string& pieces, const std::string& closed, double tolerance) {
  const auto a = result_of(pieces), b = result_of(closed);
  EXPECT_NEAR(a[0], b[0], tolerance * 80.0);
  EXPECT_NEAR(a[1], b[1], tolerance * 8.0);
  EXPECT_NEAR(a[2], b[2], tolerance * 0.1);
}

// A polygon of 72 corners is a circle within 0.05 % of the radius.
TEST(WheelOfPieces, PolygonRollsAsTheCylinder) {
  const double step = 2.0 * std::numbers::pi / 72;
  expect_alike("{radius: 100 mm, width: 80 mm, piece_count: 72, pieces: [" + points(sector(-0.5 * step, 0.5 * step)) + "]}", "{radius: 100 mm, width: 80 mm}",
               0.005);
}

// Lugs wider than the nodes are apart: which nodes a thin lug meets hangs on rounding.
TEST(WheelOfPieces, LugsOfPiecesPullAsGrousers) {
  const double step = 2.0 * std::numbers::pi / 72;
  std::string pieces;
  for (int i = 0; i < 6; ++i) pieces += points(sector((i - 0.5) * step, (i + 0.5) * step)) + ", ";
  std::vector<Vec3> lug;
  for (const double y : {-0.04, 0.04})
    for (const double x : {-0.006, 0.006})
      for (const double z : {-0.105, -0.05}) lug.emplace_back(x, y, z);
  expect_alike("{radius: 100 mm, width: 80 mm, piece_count: 12, pieces: [" + pieces + points(lug) + "]}",
               "{radius: 100 mm, width: 80 mm, grousers: {count: 12, height: 5 mm, thickness: 12 mm}}", 0.02);
}

TEST(WheelOfPieces, WrongPiecesAreRefused) {
  for (const char* wheel : {"{radius: 0.1, width: 0.1, pieces: [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]}",
                            "{radius: 0.1, width: 0.1, pieces: [[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]]}",
                            "{radius: 0.1, width: 0.1, pieces: [[[0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]]}",
                            "{radius: 0.1, width: 0.1, pieces: [[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]], grousers: {count: 3, height: 1 mm}}"})
    EXPECT_THROW(parse_scenario(std::string("wheel: ") + wheel + rig, "wheel.yaml"), InputError) << wheel;
  const Scenario s = parse_scenario(
      std::string("wheel: {radius: 0.1, width: 0.1, piece_count: 3, pieces: [[[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]]}") + rig, "wheel.yaml");
  EXPECT_EQ(parse_scenario(to_yaml(s), "again.yaml").wheel.pieces, s.wheel.pieces);
}

}  // namespace
}  // namespace terrode::scenario
