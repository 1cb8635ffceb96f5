// Particles behind the ground callback: trials leave no trace, steps are means, state comes back bit for bit, the
// window follows the wheel, a shell of spheres acts like the wheel it covers.
#include "dem/dem_terrain.h"

#include <gtest/gtest.h>

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
