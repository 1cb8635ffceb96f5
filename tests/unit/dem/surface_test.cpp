// Distances and normals of the surfaces, and that a mesh acts like the plane it tiles.
#include "dem/surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/problem.h"
#include "core/random.h"
#include "wheel/convex.h"

namespace terrode::dem {
namespace {

constexpr double exact = 1e-14;

SurfacePoint only(const SurfacePtr& s, const Vec3& p, double reach) {
  SurfacePoint out[max_surface_points];
  EXPECT_EQ(s->near(p, reach, out), 1);
  return out[0];
}
int count(const SurfacePtr& s, const Vec3& p, double reach) {
  SurfacePoint out[max_surface_points];
  return s->near(p, reach, out);
}

TEST(Surface, Plane) {
  const auto s = make_plane(Vec3(0, 0, 2), 1.0);
  EXPECT_NEAR(only(s, Vec3(3, 4, 1), 1).distance, 0.5, exact);
  EXPECT_NEAR(only(s, Vec3(3, 4, 0.2), 1).distance, -0.3, exact);
  EXPECT_EQ(count(s, Vec3(0, 0, 1.6), 1), 0);
}

TEST(Surface, PlateFaceEdgeAndCorner) {
  const auto s = make_plate(Vec3(0, 0, 1), Vec3(2, 0, 0), Vec3(0, 1, 0));
  EXPECT_NEAR(only(s, Vec3(1, 0.5, 0.7), 1).distance, 0.3, exact);
  EXPECT_NEAR(only(s, Vec3(1, 0.5, 0.7), 1).normal.z(), -1, exact);
  EXPECT_NEAR(only(s, Vec3(2.3, 0, 1.4), 1).distance, 0.5, exact);
  EXPECT_NEAR(only(s, Vec3(2.1, 1.2, 1.2), 1).distance, 0.3, exact);
  EXPECT_THROW(make_plate(Vec3::Zero(), Vec3(1, 0, 0), Vec3(1, 1, 0)), InputError);
}

TEST(Surface, BlockOutsideAndInside) {
  const auto s = make_block(Vec3(1, 2, 3));
  EXPECT_NEAR(only(s, Vec3(1.5, 0, 0), 1).distance, 0.5, exact);
  EXPECT_NEAR(only(s, Vec3(1.3, 2.4, 0), 1).distance, 0.5, exact);
  EXPECT_NEAR(only(s, Vec3(0.9, 0, 0), 1).distance, -0.1, exact);
  EXPECT_NEAR(only(s, Vec3(0.9, 0, 0), 1).normal.x(), 1, exact);
}

TEST(Surface, InsideOfABoxHasUpToThreeFaces) {
  const auto s = make_box_inside(Vec3(1, 1, 1));
  EXPECT_EQ(count(s, Vec3(0, 0, 0), 0.5), 0);
  EXPECT_EQ(count(s, Vec3(0.8, 0, 0), 0.5), 1);
  EXPECT_EQ(count(s, Vec3(0.8, 0.8, -0.8), 0.5), 3);
  EXPECT_NEAR(only(s, Vec3(0.8, 0, 0), 0.5).normal.x(), -1, exact);
}

TEST(Surface, Cylinders) {
  const auto drum = make_cylinder_inside(1, 1.0);
  EXPECT_NEAR(only(drum, Vec3(0.6, 5, 0.6), 0.5).distance, 1 - std::sqrt(0.72), exact);
  EXPECT_LT(only(drum, Vec3(0.6, 5, 0.6), 0.5).normal.x(), 0);
  const auto wheel = make_cylinder(1, 1.0, 0.5);
  EXPECT_NEAR(only(wheel, Vec3(0, 0.2, -1.3), 0.5).distance, 0.3, exact);
  EXPECT_NEAR(only(wheel, Vec3(0, 0.2, -1.3), 0.5).normal.z(), -1, exact);
  EXPECT_NEAR(only(wheel, Vec3(0.3, 0.7, 0), 0.5).normal.y(), 1, exact);
  EXPECT_NEAR(only(wheel, Vec3(1.3, 0.9, 0), 0.6).distance, 0.5, exact);
  EXPECT_NEAR(only(wheel, Vec3(0.9, 0, 0), 0.6).distance, -0.1, exact);
}

SurfacePtr floor_mesh(int n) {
  std::vector<Vec3> v;
  std::vector<std::array<int, 3>> t;
  for (int y = 0; y <= n; ++y)
    for (int x = 0; x <= n; ++x) v.emplace_back(x, y, 0.0);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      const int a = y * (n + 1) + x;
      t.push_back({a, a + 1, a + n + 2});
      t.push_back({a, a + n + 2, a + n + 1});
    }
  return make_mesh(v, t);
}

TEST(Surface, FlatMeshIsOneContactEverywhere) {
  const auto s = floor_mesh(4);
  for (const Vec3& p :
       {Vec3(1.3, 1.2, 0.4), Vec3(2, 2, 0.4), Vec3(1.5, 1.5, 0.4), Vec3(2, 1.3, 0.4), Vec3(1.999, 1.7, 0.4)}) {
    EXPECT_NEAR(only(s, p, 0.8).distance, 0.4, exact) << p.transpose();
    EXPECT_NEAR(only(s, p, 0.8).normal.z(), 1.0, 1e-9);
  }
}

TEST(Surface, MeshCornerHasTwoFacesInsideAndOneEdgeOutside) {
  // An L: floor z = 0 for x > 0 and wall x = 0 for z > 0.
  const auto s =
      make_mesh({Vec3(0, -9, 0), Vec3(0, 9, 0), Vec3(9, 9, 0), Vec3(9, -9, 0), Vec3(0, 9, 9), Vec3(0, -9, 9)},
                {{0, 2, 1}, {0, 3, 2}, {0, 1, 4}, {0, 4, 5}});
  EXPECT_EQ(count(s, Vec3(0.3, 0.2, 0.4), 0.5), 2);
  EXPECT_NEAR(only(s, Vec3(-0.3, 0.2, -0.4), 0.6).distance, 0.5, exact);
}

// However many triangles are in reach, the first contact is the nearest point of all.
TEST(Surface, RoughMeshGivesTheNearestPointOfAllItsTriangles) {
  Random random(3);
  std::vector<Vec3> v;
  std::vector<std::array<int, 3>> t;
  constexpr int n = 24;
  for (int y = 0; y <= n; ++y)
    for (int x = 0; x <= n; ++x) v.emplace_back(0.1 * x, 0.1 * y, random.uniform(0, 0.08));
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      const int a = y * (n + 1) + x;
      t.push_back({a, a + 1, a + n + 2});
      t.push_back({a, a + n + 2, a + n + 1});
    }
  const auto s = make_mesh(v, t);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p(random.uniform(0, 2.4), random.uniform(0, 2.4), random.uniform(0.1, 1.0));
    double least = 1e9;
    int in_reach = 0;
    for (const auto& k : t) {
      const Vec3 q = closest_on_triangle(p, v[static_cast<std::size_t>(k[0])], v[static_cast<std::size_t>(k[1])], v[static_cast<std::size_t>(k[2])]);
      least = std::min(least, (p - q).norm());
      in_reach += (p - q).norm() < 1.1;
    }
    ASSERT_GT(in_reach, 64);
    std::array<SurfacePoint, max_surface_points> found;
    ASSERT_GT(s->near(p, 1.1, found.data()), 0);
    EXPECT_NEAR(found[0].distance, least, exact);
    EXPECT_EQ(s->near(p, 0.999 * least, found.data()), 0);
  }
}

TEST(Surface, StlIsReadAsciiAndBinary) {
  const auto folder = std::filesystem::temp_directory_path();
  const std::string ascii = (folder / "terrode_ascii.stl").string(), binary = (folder / "terrode_binary.stl").string();
  std::ofstream(ascii) << "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1e3 0 0\nvertex 0 1e3 0\n"
                          "endloop\nendfacet\nendsolid\n";
  {
    std::ofstream out(binary, std::ios::binary);
    const std::string header(80, 'x');
    const std::uint32_t n = 1;
    const float f[12] = {0, 0, 1, 0, 0, 0, 1000, 0, 0, 0, 1000, 0};
    out << header;
    out.write(reinterpret_cast<const char*>(&n), 4);
    out.write(reinterpret_cast<const char*>(f), sizeof f);
    out.write("\0\0", 2);
  }
  for (const auto& path : {ascii, binary})
    EXPECT_NEAR(only(load_stl(path, 1e-3), Vec3(0.2, 0.2, 0.1), 1).distance, 0.1, exact);
  EXPECT_THROW(load_stl("/nowhere.stl", 1), InputError);
}

TEST(Surface, ConvexPiecesAgreeWithTheBlock) {
  std::vector<Vec3> corners;
  for (int k = 0; k < 8; ++k) corners.emplace_back(k & 1 ? 1 : -1, k & 2 ? 2 : -2, k & 4 ? 3 : -3);
  const auto hull = make_shape(std::make_shared<wheel::ConvexPieces>(std::vector<std::vector<Vec3>>{corners}));
  const auto block = make_block(Vec3(1, 2, 3));
  constexpr double portal_accuracy = 5e-3;  // portal refinement does not find the least depth beside an edge
  for (const Vec3& p : {Vec3(1.4, 0.3, 0.2), Vec3(1.2, 2.3, 0.1), Vec3(0, 0.4, 3.2)}) {
    const SurfacePoint a = only(hull, p, 1), b = only(block, p, 1);
    EXPECT_NEAR(a.distance, b.distance, portal_accuracy);
    EXPECT_LT((a.normal - b.normal).norm(), 0.15);
  }
}

}  // namespace
}  // namespace terrode::dem
