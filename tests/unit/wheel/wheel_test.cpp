#include "wheel/wheel.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace terrode::wheel {
namespace {

std::vector<std::shared_ptr<const Body>> shapes() {
  WheelShape flat{0.13, 0.16, 0.0, {}}, crowned{0.13, 0.16, 0.2, {}}, lugs{0.12, 0.1, 0.0, {}}, tapered{0.12, 0.1, 0.3, {}};
  lugs.grousers = {12, 0.015, 0.004, 0.0, GrouserShape::straight, 0.2};
  tapered.grousers = {16, 0.012, 0.006, 0.002, GrouserShape::tapered, 0.0};
  WheelShape saw{0.12, 0.1, 0.0, {24, 0.01, 0.01, 0.0, GrouserShape::triangular, 0.1}};
  std::vector<Vec3> cube;
  for (const double x : {-0.1, 0.1})
    for (const double y : {-0.05, 0.05})
      for (const double z : {-0.02, 0.06}) cube.push_back({x, y, z});
  return {std::make_shared<Wheel>(flat),    std::make_shared<Wheel>(crowned), std::make_shared<Wheel>(lugs),
          std::make_shared<Wheel>(tapered), std::make_shared<Wheel>(saw),     make_box(0.2, 0.1, 0.05),
          std::make_shared<Sphere>(0.07),   std::make_shared<ConvexPieces>(std::vector<std::vector<Vec3>>{cube})};
}

TEST(Shapes, RaysEndOnTheSurfaceWithItsNormal) {
  for (const auto& shape : shapes()) {
    const bool by_ccd = shape->name() == "convex-pieces";
    const double close = by_ccd ? 1e-6 : 1e-12;
    Random random(7);
    int hits = 0;
    for (int i = 0; i < (by_ccd ? 40 : 400); ++i) {
      Vec3 d(random.normal(), random.normal(), random.normal());
      d.normalize();
      const Vec3 aim(random.uniform(-0.1, 0.1), random.uniform(-0.05, 0.05), random.uniform(-0.1, 0.1));
      const Vec3 origin = aim - d;
      RayHit hit;
      if (!shape->ray(origin, d, hit)) continue;
      ++hits;
      EXPECT_NEAR((origin + hit.distance * d - hit.p_B).norm(), 0.0, 1e-12);
      EXPECT_NEAR(shape->closest(hit.p_B).distance, 0.0, close) << shape->name() << i;
      EXPECT_LE(hit.n_B.dot(d), 1e-6);
      EXPECT_NEAR(hit.n_B.norm(), 1.0, 1e-9);
      // Nothing on the way is inside.
      for (double a = 0.02; a < 0.999; a += 0.05)
        EXPECT_GT(shape->closest(origin + a * hit.distance * d).distance, -1e-7) << shape->name();
    }
    EXPECT_GT(hits, 10);
  }
}

TEST(Shapes, TheNearestPointIsNearest) {
  for (const auto& shape : shapes()) {
    const bool by_ccd = shape->name() == "convex-pieces";
    Random random(11);
    for (int i = 0; i < (by_ccd ? 40 : 300); ++i) {
      const Vec3 p(random.uniform(-0.2, 0.2), random.uniform(-0.12, 0.12), random.uniform(-0.2, 0.2));
      const Closest c = shape->closest(p);
      EXPECT_NEAR((p - c.distance * c.n_B - c.p_B).norm(), 0.0, 1e-9) << shape->name() << " " << i;
      if (c.distance < 1e-6) continue;
      // No surface point found by rays from p is nearer.
      for (int k = 0; k < 20; ++k) {
        Vec3 d(random.normal(), random.normal(), random.normal());
        d.normalize();
        RayHit hit;
        if (shape->ray(p, d, hit)) {
          EXPECT_GT(hit.distance, c.distance - 1e-6) << shape->name();
        }
      }
    }
  }
}

TEST(Shapes, SupportIsTheFurthestPoint) {
  for (const auto& shape : shapes()) {
    Random random(3);
    for (int i = 0; i < 200; ++i) {
      const Vec3 d(random.normal(), random.normal(), random.normal());
      const Vec3 p = shape->support(d);
      EXPECT_LE(p.norm(), shape->bounding_radius() + 1e-12);
      const double close = shape->name() == "convex-pieces" ? 1e-5 : 1e-9;
      EXPECT_NEAR(shape->closest(p).distance, 0.0, close) << shape->name();
    }
  }
}

TEST(Wheel, LugsReachTheirHeightAndRimsLieBetween) {
  const Wheel w(WheelShape{0.12, 0.1, 0.0, {12, 0.015, 0.004, 0.0, GrouserShape::straight, 0.0}});
  RayHit hit;
  ASSERT_TRUE(w.ray(Vec3(0, 0, -1), Vec3::UnitZ(), hit));
  EXPECT_NEAR(hit.p_B.z(), -0.135, 1e-15);
  ASSERT_TRUE(w.ray(Vec3(0.02, 0, -1), Vec3::UnitZ(), hit));
  EXPECT_NEAR(std::hypot(hit.p_B.x(), hit.p_B.z()), 0.12, 1e-15);
  EXPECT_FALSE(w.plain_cylinder());
}

TEST(Wheel, ReportsEveryProblem) {
  const WheelShape s{-1, 0, 0.01, {-3, 0, 0, 0, GrouserShape::straight, 0}};
  EXPECT_GE(s.validate().size(), 3u);
  EXPECT_THROW(Wheel{s}, InputError);
  EXPECT_THROW(Prism({{0, 0}, {0, 1}, {1, 0}}, 1.0), InputError);  // clockwise
  EXPECT_THROW(ConvexPieces({{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(1, 1, 0)}}), InputError);  // flat
}

// A wheel of pieces meets lines where the wheel in closed form does that it copies.
TEST(ConvexPiecesOfAWheel, MeetLinesAsTheWheel) {
  const Wheel closed(WheelShape{0.1, 0.08, 0.0, {12, 0.01, 0.004, 0.0, GrouserShape::straight, 0.0}});
  const double step = 2.0 * std::numbers::pi / 720;
  std::vector<std::vector<Vec3>> pieces;
  for (int i = 0; i < 60; ++i) {
    pieces.emplace_back();
    for (const double y : {-0.04, 0.04}) {
      pieces.back().emplace_back(0.0, y, 0.0);
      for (const double a : {i * step, (i + 1) * step}) pieces.back().emplace_back(-0.1 * std::sin(a), y, -0.1 * std::cos(a));
    }
  }
  pieces.emplace_back();
  for (const double y : {-0.04, 0.04})
    for (const double x : {-0.002, 0.002})
      for (const double z : {-0.11, -0.05}) pieces.back().emplace_back(x, y, z);
  const ConvexPieces hulls(around_axle(pieces, 12), Rolling{0.1, 0.08, 0.0});
  EXPECT_NEAR(hulls.rolling()->outer, 0.11, 1e-4);
  EXPECT_EQ(hulls.rolling()->radius, 0.1);
  for (int i = 0; i < 400; ++i) {
    const double turn = 0.0157 * i, x = 0.09 * std::sin(1.7 * i), y = 0.039 * std::sin(2.3 * i);
    const Eigen::AngleAxisd q(turn, Vec3::UnitY());
    const Vec3 from = q * Vec3(x, y, -0.3), d = q * Vec3::UnitZ();
    RayHit a, b;
    ASSERT_EQ(closed.ray(from, d, a), hulls.ray(from, d, b));
    EXPECT_NEAR(a.distance, b.distance, 2e-5) << turn << " " << x;  // sagitta of half a degree: 1e-6, over a steep flank
    EXPECT_GT(a.n_B.dot(b.n_B), 0.9999) << turn << " " << x;
  }
}

}  // namespace
}  // namespace terrode::wheel
