// A small bed of coarse grains with a small wheel on it, for tests of the particle ground.
#pragma once

#include <memory>

#include "dem/dem_terrain.h"
#include "wheel/wheel.h"

namespace terrode::dem {

inline const Bed& prism() {
  static const Bed bed = [] {
    BedRecipe r;
    r.width = r.length = 0.03;
    r.height = 0.03;
    r.sizes.smallest = 4e-3;
    r.sizes.largest = 5e-3;
    return prepare_bed(r);
  }();
  return bed;
}

inline DemTerrainParams params() {
  DemTerrainParams p;
  p.prism = prism();
  p.tiles_y = 2;
  p.window_ahead = 0.05;
  p.window_behind = 0.05;
  return p;
}

inline std::shared_ptr<const wheel::Wheel> small_wheel() {
  wheel::WheelShape s;
  s.radius = 0.04;
  s.width = 0.03;
  return std::make_shared<wheel::Wheel>(s);
}

inline Pose at(double x, double z, double angle = 0.0) {
  Pose p;
  p.p_W = Vec3(x, 0, z);
  p.R_WB = Quat(Eigen::AngleAxisd(angle, Vec3::UnitY()));
  return p;
}

inline constexpr double h = 5e-4;

// Pushes the wheel down at constant speed, from an axle `from` above the surface.
inline double press(DemTerrain& ground, int steps, double speed, double x = 0.0, double from = 0.043) {
  double force = 0.0;
  for (int k = 0; k < steps; ++k) {
    ground.begin_step(k * h, h);
    Twist t;
    t.v_W = Vec3(0, 0, -speed);
    force = ground.wrench(0, at(x, from - speed * h * k), t).wrench.F_W.z();
    ground.end_step();
  }
  return force;
}

}  // namespace terrode::dem
