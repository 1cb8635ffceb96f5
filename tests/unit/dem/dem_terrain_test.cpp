// Particles behind the ground callback: trials leave no trace, steps are means, state comes back bit for bit, the
// window follows the wheel, a shell of spheres acts like the wheel it covers.
#include "dem/dem_terrain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "wheel/wheel.h"
#include "small_ground.h"

namespace terrode::dem {
namespace {

TEST(DemTerrain, TrialsLeaveNoTraceAndTheLastIsCommitted) {
  DemTerrain a(params()), b(params());
  for (DemTerrain* g : {&a, &b}) {
    g->add_body(small_wheel());
    press(*g, 20, 0.4);
  }
  EXPECT_EQ(a.hash(), b.hash());
  Twist down;
  down.v_W = Vec3(0.1, 0, -0.4);
  Twist other;
  other.v_W = Vec3(0, 0, 0.5);
  const Pose pose = at(0, 0.043 - 0.4 * h * 20);
  a.begin_step(0, h);
  const auto once = a.wrench(0, pose, down);
  a.end_step();
  b.begin_step(0, h);
  b.wrench(0, pose, other);
  b.wrench(0, pose, down);
  b.wrench(0, at(0, 0.035), other);
  const auto again = b.wrench(0, pose, down);
  EXPECT_EQ(b.wrench(0, pose, down).wrench.F_W, again.wrench.F_W);
  b.end_step();
  EXPECT_EQ(once.wrench.F_W, again.wrench.F_W);
  EXPECT_EQ(once.wrench.M_W, again.wrench.M_W);
  EXPECT_EQ(a.hash(), b.hash());
  EXPECT_GT(once.wrench.F_W.z(), 0.0);
  EXPECT_GT(once.contact_count, 0);
  EXPECT_GT(once.max_sinkage, 0.0);
}

TEST(DemTerrain, SnapshotComesBackBitForBit) {
  DemTerrain a(params());
  a.add_body(small_wheel());
  press(a, 20, 0.4);
  const auto saved = a.snapshot();
  const double first = press(a, 5, 0.2);
  a.restore(saved);
  EXPECT_EQ(press(a, 5, 0.2), first);
  a.begin_step(0, h);  // ends in an error of some other kind: taken back, the step was never begun
  a.wrench(0, at(0, 0.1), {});
  a.restore(saved);
  EXPECT_EQ(press(a, 5, 0.2), first);
}

TEST(DemTerrain, AFreshGroundGoesOnFromASnapshot) {
  DemTerrain a(params()), b(params());
  a.add_body(small_wheel());
  b.add_body(small_wheel());
  press(a, 20, 0.4);
  b.restore(a.snapshot());
  EXPECT_EQ(press(b, 5, 0.2), press(a, 5, 0.2));
  EXPECT_EQ(a.hash(), b.hash());
}

TEST(DemTerrain, AFullBedIsLaidAtOnceAndItsBorderStandsStill) {
  DemTerrainParams p = params();
  p.tiles_y = 3;
  p.full_length = 0.15;
  p.full_behind = 0.06;
  p.border = 0.008;
  DemTerrain a(p);
  a.add_body(small_wheel());
  press(a, 30, 0.4);
  const auto grains = 5 * 3 * prism().grains.size();
  std::size_t all = 0, moved = 0;
  a.particles().for_each_grain([&](const Vec3&, double) { ++all; });
  EXPECT_EQ(all, grains);
  EXPECT_LT(a.particles().free_count(), grains);
  // Those that are fixed are where the prism put them.
  DemTerrain still(p);
  still.add_body(small_wheel());
  still.begin_step(0, h);
  still.wrench(0, at(0, 0.1), {});
  still.end_step();
  std::vector<Vec3> before, after;
  const auto border = [&](std::vector<Vec3>& out) {
    return [&](const Vec3& x, double) {
      if (x.x() < -p.full_behind + 0.7 * p.border || std::abs(x.y()) > 0.045 - 0.7 * p.border) out.push_back(x);
    };
  };
  still.particles().for_each_grain(border(before));
  a.particles().for_each_grain(border(after));
  EXPECT_GT(before.size(), 50u);
  for (const Vec3& x : before)
    moved += std::none_of(after.begin(), after.end(), [&](const Vec3& y) { return (x - y).norm() < 1e-12; });
  EXPECT_EQ(moved, 0u);
  a.begin_step(1, h);
  EXPECT_THAT([&] { a.wrench(0, at(0.2, 0.03), {}); },
              ::testing::ThrowsMessage<RunError>(::testing::HasSubstr("beyond the full bed")));
}

// A long, narrow prism: the window moves on by stretches as long as the prism is wide, not by whole prisms.
TEST(DemTerrain, ALongPrismThawsInStretches) {
  BedRecipe r;
  r.width = 0.12;
  r.length = 0.02;
  r.height = 0.015;
  r.sizes.smallest = 4e-3;
  r.sizes.largest = 5e-3;
  DemTerrainParams p;
  p.prism = prepare_bed(r);
  p.tiles_y = 1;
  p.window_ahead = 0.035;
  p.window_behind = 0.015;
  DemTerrain ground(p);
  ground.add_body(small_wheel());
  const double per_metre = static_cast<double>(p.prism.grains.size()) / r.width;
  std::size_t all = 0;
  for (const double x : {-0.05, -0.009, 0.0, 0.011, 0.05, 0.13, 0.05}) {
    ground.begin_step(0.0, h);
    ground.set_motion(0, at(x, 0.1), {});
    ground.end_step();
    // The window's 50 mm touch three or four stretches of 20 mm.
    const double from = 0.02 * std::floor((x - 0.015) / 0.02 + 1e-9), to = 0.02 * std::floor((x + 0.035) / 0.02 + 1e-9) + 0.02;
    EXPECT_NEAR(static_cast<double>(ground.particles().free_count()), per_metre * (to - from), 0.15 * per_metre * (to - from)) << x;
    all = 0;
    double lowest = 1.0, highest = -1.0;
    ground.particles().for_each_grain([&](const Vec3& g, double) {
      ++all;
      lowest = std::min(lowest, g.x());
      highest = std::max(highest, g.x());
    });
    EXPECT_EQ(all % p.prism.grains.size(), 0u) << x;  // what is laid is whole prisms, past either end of the window
    EXPECT_LT(lowest, from - 0.015) << x;
    EXPECT_GT(highest, to + 0.015) << x;
  }
  EXPECT_EQ(all, 3 * p.prism.grains.size());  // laid once: from -0.12 to 0.24 m
}

// Frozen grains do not give way: a wheel that sinks, or throws grains out behind it, must not meet them however short the window.
TEST(DemTerrain, AWindowTooShortForASunkWheelGrows) {
  DemTerrain wide(params());
  DemTerrainParams p = params();
  p.window_ahead = p.window_behind = 0.005;
  DemTerrain narrow(p);
  wide.add_body(small_wheel());
  narrow.add_body(small_wheel());
  press(narrow, 5, 0.4);
  press(wide, 5, 0.4);
  EXPECT_LT(narrow.particles().free_count(), wide.particles().free_count());
  for (int k = 0; k < 6; ++k) press(narrow, 1, 0.0, 0.0, 0.030), press(wide, 1, 0.0, 0.0, 0.030);
  EXPECT_EQ(narrow.particles().free_count(), wide.particles().free_count());
}

TEST(DemTerrain, AShellStandsWhereItsWheelIs) {
  DemTerrainParams p = params();
  p.surface = WheelSurface::spheres;
  p.shell_diameter = 0.006;
  DemTerrain g(p);
  g.add_body(small_wheel());
  // High above the bed nothing touches; half a radius deep at once much does.
  g.begin_step(0, h);
  EXPECT_EQ(g.wrench(0, at(0, 0.1), {}).contact_count, 0);
  g.end_step();
  DemTerrain deep(p);
  deep.add_body(small_wheel());
  deep.begin_step(0, h);
  EXPECT_GT(deep.wrench(0, at(0, 0.036), {}).contact_count, 0);
}

TEST(DemTerrain, ShowsItsGrainsInTheSameOrderWithinItsWidth) {
  DemTerrain ground(params());
  ground.add_body(small_wheel());
  Pose pose = at(0.0, 0.06);  // above the grains
  const auto go = [&](int steps) {
    Twist ahead;
    ahead.v_W = Vec3(1.0, 0, 0);
    for (int k = 0; k < steps; ++k) {
      ground.begin_step(k * h, h);
      ground.set_motion(0, pose, ahead);
      ground.end_step();
      pose.p_W += h * ahead.v_W;
    }
  };
  go(5);
  std::vector<float> before, after, radius_before, radius_after;
  ground.particles(before, radius_before);
  ASSERT_EQ(before.size(), 3 * radius_before.size());
  ASSERT_GT(radius_before.size(), 100u);
  go(100);  // 50 mm on: further tiles are laid
  ground.particles(after, radius_after);
  EXPECT_GT(after.size(), before.size());
  for (std::size_t i = 0; i < radius_before.size(); ++i) {
    EXPECT_EQ(radius_before[i], radius_after[i]);
    EXPECT_NEAR(before[3 * i], after[3 * i], 0.01);
    EXPECT_NEAR(before[3 * i + 2], after[3 * i + 2], 0.01);
    EXPECT_LE(std::abs(after[3 * i + 1]), 0.5 * ground.bed_width() * (1 + 1e-6));
  }
}

TEST(DemTerrain, MisuseIsRefused) {
  DemTerrain a(params());
  EXPECT_THROW(a.wrench(0, at(0, 0), {}), RunError);
  EXPECT_THROW(a.begin_step(0, -1), InputError);
  a.add_body(small_wheel());
  a.begin_step(0, h);
  EXPECT_THROW(a.begin_step(0, h), RunError);
  EXPECT_THROW(a.wrench(3, at(0, 0), {}), InputError);
  EXPECT_THROW(a.snapshot(), RunError);
  DemTerrainParams bad = params();
  bad.tiles_y = 0;
  bad.window_ahead = -1;
  EXPECT_EQ(bad.validate().size(), 2u);
}

}  // namespace
}  // namespace terrode::dem
