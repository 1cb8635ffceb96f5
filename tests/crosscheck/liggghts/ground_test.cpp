// The ground on LIGGGHTS against our own particles: the same grains, the same wheel, the same motion. Skipped where this
// build has no LIGGGHTS.
#include "liggghts/liggghts_terrain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "../../unit/dem/small_ground.h"
#include "liggghts/ranks.h"
#include "terrain/particle_view.h"

namespace terrode::liggghts {
namespace {

#define SKIP_WITHOUT_LIGGGHTS() \
  if (!available()) GTEST_SKIP() << "this build has no LIGGGHTS (libliggghts-dev and libopenmpi-dev)"

// A law that both express to the letter.
LiggghtsParams same_law(dem::DemTerrainParams bed) {
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

struct Grains {
  std::vector<float> position, radius;
};

Grains grains_of(const terrain::Terrain& ground) {
  Grains g;
  dynamic_cast<const terrain::ParticleView&>(ground).particles(g.position, g.radius);
  return g;
}

TEST(LiggghtsGround, FallingGrainsMeetAsOurOwnDo) {
  SKIP_WITHOUT_LIGGGHTS();
  // Five a tile, one above the other and each a little aside: they fall on the floor and on each other.
  dem::DemTerrainParams bed;
  bed.prism.width = bed.prism.length = 0.03;
  bed.prism.height = 0.03;
  bed.prism.grain_density = 2500;
  for (int k = 0; k < 5; ++k)
    bed.prism.grains.push_back({0.0022 - 0.0001 * k, Vec3(0.014 + 0.0007 * k, 0.015 - 0.0005 * (k % 3), 0.003 + 0.0046 * k)});
  bed.tiles_y = 2;
  bed.full_length = 0.06;
  bed.full_behind = 0.03;
  bed.border = 0.0;
  LiggghtsParams p = same_law(bed);
  p.bed.wheel.rolling_friction = 0.0;
  const auto theirs = make_terrain(p);
  dem::DemTerrain ours(p.bed);
  constexpr int steps = 55;
  const Grains start = [&] {
    dem::DemTerrain still(p.bed);
    still.add_body(dem::small_wheel());
    still.begin_step(0, 1e-9);
    still.wrench(0, dem::at(0, 0.1), {});
    still.end_step();
    return grains_of(still);
  }();
  for (terrain::Terrain* ground : {theirs.get(), static_cast<terrain::Terrain*>(&ours)}) {
    ground->add_body(dem::small_wheel());
    for (int k = 0; k < steps; ++k) {
      ground->begin_step(k * dem::h, dem::h);
      EXPECT_EQ(ground->wrench(0, dem::at(0, 0.1), {}).contact_count, 0);
      ground->end_step();
    }
  }
  const Grains a = grains_of(*theirs), b = grains_of(ours);
  ASSERT_EQ(a.radius.size(), 20u);
  EXPECT_EQ(a.radius, b.radius);
  const double t = steps * dem::h, fall = 0.5 * p.bed.gravity * t * t;
  double met = 0.0, apart = 0.0;
  for (std::size_t k = 0; k < a.position.size(); ++k) {
    const double moved = a.position[k] - start.position[k];
    met = std::max(met, std::abs(k % 3 == 2 ? moved + fall : moved));
    apart = std::max(apart, static_cast<double>(std::abs(a.position[k] - b.position[k])));
  }
  EXPECT_GT(met, 1e-3) << "nothing but a fall";
  EXPECT_LT(apart, 1e-7);  // each further impact magnifies it some ten times
  EXPECT_NEAR(theirs->height(0.014, 0.0), ours.height(0.014, 0.0), 1e-6);
}

struct Phases {
  double first = 0.0;          // N: the force of the first grain that is met, summed over steps
  Vec3 pressed, held, rolled;  // N: mean force while the rim goes from 4 to 8 mm deep, held there, rolling and sinking on
  double torque = 0.0;         // N m, mean about the axle while rolling
  int contacts = 0;
};

// Pushes the wheel in, holds it, lets it roll at slip 0.3.
Phases drive(terrain::Terrain& ground) {
  ground.add_body(dem::small_wheel());
  Pose pose = dem::at(0.0, 0.04 + ground.roughness());
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

TEST(LiggghtsGround, AWheelFeelsWhatItFeelsOnOurOwnParticles) {
  SKIP_WITHOUT_LIGGGHTS();
  dem::DemTerrainParams bed = dem::params();
  bed.window_ahead = bed.window_behind = 0.03;
  LiggghtsParams p = same_law(bed);
  p.bed.time_step = 1.5e-5;
  p.reach_ahead = 0.01;
  Phases a, b;
  {
    const auto theirs = make_terrain(p);
    a = drive(*theirs);
  }
  {
    dem::DemTerrain ours(p.bed);
    b = drive(ours);
  }
  const auto say = [](const char* who, const Phases& f) {
    std::printf("%s pressed %.4f held %.4f rolled %.4f %.4f torque %.5f contacts %d\n", who, f.pressed.z(), f.held.z(), f.rolled.z(), f.rolled.x(), f.torque, f.contacts);
  };
  say("theirs", a);
  say("ours  ", b);
  EXPECT_GT(b.contacts, 5);
  EXPECT_GT(b.pressed.z(), 1.0);
  EXPECT_NEAR(a.pressed.z() / b.pressed.z(), 1.0, 0.05);
  EXPECT_NEAR(a.held.z() / b.held.z(), 1.0, 0.15);
  EXPECT_NEAR(a.rolled.z() / b.rolled.z(), 1.0, 0.25);
}

}  // namespace
}  // namespace terrode::liggghts
