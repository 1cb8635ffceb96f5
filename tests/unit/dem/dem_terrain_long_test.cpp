// The window follows the wheel and the rut stays; a shell of spheres acts like the wheel it covers.
#include <gtest/gtest.h>

#include <cmath>

#include "dem/dem_terrain.h"
#include "wheel/wheel.h"
#include "small_ground.h"

namespace terrode::dem {
namespace {

TEST(DemTerrain, WindowFollowsAndTheRutStays) {
  DemTerrain a(params());
  a.add_body(small_wheel());
  EXPECT_EQ(a.height(0.0, 0.0), 0.0);
  press(a, 55, 0.4);
  const double speed = 0.5, z = 0.043 - 0.4 * h * 55;
  for (int k = 0; k < 400; ++k) {
    a.begin_step(k * h, h);
    Twist t;
    t.v_W = Vec3(speed, 0, 0);
    t.w_W = Vec3(0, speed / 0.04, 0);
    a.wrench(0, at(speed * h * k, z, speed / 0.04 * h * k), t);
    a.end_step();
  }
  // 0.1 m on: the bed there was laid, what is behind is frozen with its rut in it.
  const auto mean_height = [&](double x0, double y0) {
    double sum = 0.0;
    for (int k = 0; k < 9; ++k) sum += a.height(x0 + 0.004 * (k % 3), y0 + 0.004 * (k / 3)) / 9;
    return sum;
  };
  EXPECT_LT(mean_height(0.03, -0.004), mean_height(0.165, -0.004) - 0.002);
  EXPECT_GT(a.particles().particle_count(), a.particles().free_count());
  EXPECT_LT(a.particles().free_count(), 6 * 2 * prism().grains.size());
}

TEST(DemTerrain, ShellOfSpheresActsLikeTheCylinder) {
  DemTerrainParams p = params();
  DemTerrain smooth(p);
  p.surface = WheelSurface::spheres;
  p.shell_diameter = 0.006;
  DemTerrain shell(p);
  double force[2];
  for (int k = 0; k < 2; ++k) {
    DemTerrain& g = k == 0 ? smooth : shell;
    g.add_body(small_wheel());
    double sum = 0.0;
    for (int s = 0; s < 80; ++s) {
      g.begin_step(s * h, h);
      Twist t;
      t.v_W = Vec3(0, 0, -0.2);
      const double f = g.wrench(0, at(0, 0.043 - 0.2 * h * s), t).wrench.F_W.z();
      g.end_step();
      if (s >= 40) sum += f / 40;
    }
    force[k] = sum;
  }
  EXPECT_GT(force[0], 1.0);
  constexpr double within_scatter = 0.4;  // the shell is bumpy, and a few grains carry the wheel here
  EXPECT_NEAR(force[1] / force[0], 1.0, within_scatter);
  EXPECT_GT(shell_of_spheres(0.13, 0.16, 0.01, 0.75).size(), 9000u);
}

}  // namespace
}  // namespace terrode::dem
