// Wheels as triangles: closed, turned outward, near the closed form, of its volume.
#include "liggghts/wheel_mesh.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>

#include "core/problem.h"
#include "wheel/convex.h"
#include "wheel/wheel.h"

namespace terrode::liggghts {
namespace {

double volume(const TriangleMesh& m) {
  double six = 0.0;
  for (const auto& t : m.triangles) {
    const auto p = [&](int k) { return m.vertices[static_cast<std::size_t>(t[static_cast<std::size_t>(k)])]; };
    six += p(0).dot(p(1).cross(p(2)));
  }
  return six / 6.0;
}

// Every edge is passed once in each direction.
void expect_closed(const TriangleMesh& m) {
  std::map<std::pair<int, int>, int> edges;
  for (const auto& t : m.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.contains({edge.second, edge.first})) << edge.first << " " << edge.second;
  }
}

void expect_near_surface(const TriangleMesh& m, const wheel::Body& body, double tolerance) {
  for (const auto& t : m.triangles) {
    Vec3 centre = Vec3::Zero();
    for (const int k : t) centre += m.vertices[static_cast<std::size_t>(k)] / 3.0;
    EXPECT_LT(body.closest(centre).distance, 1.001 * tolerance) << centre.transpose();
  }
}

TEST(WheelMesh, OfASmoothWheelHasItsVolumeAndKeepsTheTolerance) {
  wheel::WheelShape s;
  s.radius = 0.06, s.width = 0.04;
  const wheel::Wheel wheel(s);
  for (const double tolerance : {2e-4, 2e-5}) {
    const TriangleMesh m = mesh_of(wheel, tolerance);
    expect_closed(m);
    const double exact = std::numbers::pi * s.radius * s.radius * s.width;
    // The polygon of the circle's mean radius has its area to fourth order of the angle between corners.
    EXPECT_NEAR(volume(m) / exact, 1.0, 2e-4);
    double most = 0.0;
    for (const auto& t : m.triangles) {
      const Vec3 middle = 0.5 * (m.vertices[static_cast<std::size_t>(t[1])] + m.vertices[static_cast<std::size_t>(t[2])]);
      for (const Vec3& x : {middle, m.vertices[static_cast<std::size_t>(t[0])]})
        if (const double r = std::hypot(x.x(), x.z()); r > 0.9 * s.radius) most = std::max(most, std::abs(r - s.radius));
    }
    EXPECT_LT(most, tolerance);
    EXPECT_GT(most, 0.1 * tolerance);  // no finer than asked for
  }
}

TEST(WheelMesh, OfCrownAndLugsLiesOnTheWheel) {
  wheel::WheelShape s;
  s.radius = 0.1, s.width = 0.08, s.crown_radius = 0.2;
  const double tolerance = 5e-5;
  for (const auto shape : {wheel::GrouserShape::straight, wheel::GrouserShape::tapered, wheel::GrouserShape::triangular}) {
    s.grousers = {12, 0.01, 0.004, 0.002, shape, 0.3};
    const wheel::Wheel wheel(s);
    const TriangleMesh m = mesh_of(wheel, tolerance);
    expect_closed(m);
    expect_near_surface(m, wheel, tolerance);
    wheel::WheelShape bare = s;
    bare.grousers = {};
    // Lugs are turned outward, too: they add at least what stands out of the rim.
    const double mean = shape == wheel::GrouserShape::straight ? 0.004 : shape == wheel::GrouserShape::tapered ? 0.003 : 0.002;
    EXPECT_GT(volume(m) - volume(mesh_of(wheel::Wheel(bare), tolerance)), 12 * mean * 0.01 * s.width);
    // Nothing is missing: the furthest corners are those of the tips.
    for (int lug = 0; lug < 12; ++lug) {
      const double a = 0.3 + 2.0 * std::numbers::pi * lug / 12.0;
      const Vec3 out(-std::sin(a), 0.0, -std::cos(a));
      double furthest = 0.0;
      for (const Vec3& x : m.vertices) furthest = std::max(furthest, x.dot(out));
      EXPECT_NEAR(furthest, wheel.support(out).dot(out), 1e-12);
    }
  }
}

TEST(WheelMesh, IsWrittenAtItsPoseAndOtherShapesAreRefused) {
  wheel::WheelShape s;
  s.radius = 0.1, s.width = 0.08;
  const wheel::Wheel wheel(s);
  const TriangleMesh m = mesh_of(wheel, 1e-3);
  Pose pose;
  pose.p_W = Vec3(1.0, 2.0, 3.0);
  const std::string text = stl(m, pose);
  std::size_t facets = 0;
  for (std::size_t at = text.find("facet normal"); at != std::string::npos; at = text.find("facet normal", at + 1)) ++facets;
  EXPECT_EQ(facets, m.triangles.size());
  EXPECT_NE(text.find("vertex 1 2.04"), std::string::npos);
  EXPECT_THROW(mesh_of(*wheel::make_box(0.1, 0.1, 0.1), 1e-3), InputError);
  EXPECT_THROW(mesh_of(wheel, 0.0), InputError);
}

}  // namespace
}  // namespace terrode::liggghts
