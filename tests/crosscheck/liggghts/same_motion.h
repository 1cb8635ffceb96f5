// The same bed, law and motion for our own particles and for those on LIGGGHTS.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "../../unit/dem/small_ground.h"
#include "liggghts/liggghts_terrain.h"
#include "liggghts/ranks.h"

namespace terrode::liggghts {

#define SKIP_WITHOUT_LIGGGHTS() \
  if (!available()) GTEST_SKIP() << "this build has no LIGGGHTS (libliggghts-dev and libopenmpi-dev)"

// A law that both express to the letter.
inline LiggghtsParams same_law(dem::DemTerrainParams bed) {
  bed.soil.rolling = bed.wheel.rolling = "epsd2_unprojected";
  bed.soil.friction = bed.wheel.friction = 0.5;
  bed.soil.rolling_friction = 0.2;
  bed.wheel.rolling_friction = 0.0;
  bed.time_step = 1e-5;
  LiggghtsParams p;
  p.bed = std::move(bed);
  p.reach_behind = 0.0;
  p.reach_ahead = 0.03;
  return p;
}

// The small bed of the particle ground's own tests.
inline LiggghtsParams small_ground(double reach) {
  dem::DemTerrainParams bed = dem::params();
  bed.window_ahead = bed.window_behind = 0.03;
  LiggghtsParams p = same_law(bed);
  p.bed.time_step = 1.5e-5;
  p.reach_ahead = reach;
  return p;
}

struct Phases {
  Vec3 pressed, held, rolled;  // N: mean force while the rim goes from 4 to 8 mm deep, held there, rolling and sinking on
  double torque = 0.0;         // N m, mean about the axle while rolling
  int contacts = 0;
};

// Pushes the wheel in at x, holds it, lets it roll at slip 0.3 and sink on.
inline Phases drive(terrain::Terrain& ground, double x = 0.0) {
  ground.add_body(dem::small_wheel());
  Pose pose = dem::at(x, 0.04 + ground.roughness());
  Phases out;
  out.pressed = out.held = out.rolled = Vec3::Zero();
  double angle = 0.0;
  Vec3 rest = Vec3::Zero();
  double no = 0.0;
  const auto steps = [&](int n, double vx, double vz, double spin, Vec3& mean, double& torque) {
    for (int k = 0; k < n; ++k) {
      Twist t;
      t.v_W = Vec3(vx, 0, vz);
      t.w_W = Vec3(0, spin, 0);
      ground.begin_step(0, dem::h);
      const auto r = ground.wrench(0, pose, t);
      ground.end_step();
      mean += r.wrench.F_W / n;
      torque += -r.wrench.M_W.y() / n;
      out.contacts = std::max(out.contacts, r.contact_count);
      angle += spin * dem::h;
      pose = dem::at(pose.p_W.x() + vx * dem::h, pose.p_W.z() + vz * dem::h, angle);
    }
  };
  const double down = 0.2;
  while (pose.p_W.z() > 0.036) steps(1, 0, -down, 0, rest, no);
  steps(40, 0, -down, 0, out.pressed, no);
  steps(20, 0, 0, 0, rest, no);
  steps(20, 0, 0, 0, out.held, no);
  const double spin = 5.0, v = 0.7 * spin * 0.04;
  const double sinks = 0.04;  // held at its height it would roll out of what it pressed down
  steps(10, v, -sinks, spin, rest, no);
  steps(60, v, -sinks, spin, out.rolled, out.torque);
  return out;
}

}  // namespace terrode::liggghts
