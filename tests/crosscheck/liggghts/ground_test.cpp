// The ground on LIGGGHTS against our own particles: the same grains, the same wheel, the same motion. Skipped where this
// build has no LIGGGHTS.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "mpi_program.h"
#include "same_motion.h"
#include "terrain/particle_view.h"
#include "wheel/convex.h"
#ifdef TERRODE_LIGGGHTS
#include "liggghts/workers.h"
#endif

namespace terrode::liggghts {
namespace {

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

TEST(LiggghtsGround, AWheelFeelsWhatItFeelsOnOurOwnParticles) {
  SKIP_WITHOUT_LIGGGHTS();
  const LiggghtsParams p = small_ground(0.01);
  Phases a, b;
  {
    const auto theirs = make_terrain(p);
    a = drive(*theirs);
  }
  {
    dem::DemTerrain ours(p.bed);
    b = drive(ours);
  }
  // Of one place alone: such forces differ between places by a quarter (ground_long_test.cpp has six).
  constexpr double scatter = 0.25;
  EXPECT_GT(b.pressed.z(), 10.0);
  EXPECT_NEAR(a.pressed.z() / b.pressed.z(), 1.0, scatter);
  // What is left of it at rest may be next to nothing where grains give way: six places say something of that.
  EXPECT_NEAR(static_cast<double>(a.contacts) / b.contacts, 1.0, scatter);
  EXPECT_GT(a.torque, 0.0);
  EXPECT_GT(a.rolled.z(), 1.0);
}

// A wheel pushed into the grains; the mean force of steps `from` to `to`.
double push(terrain::Terrain& ground, int from, int to) {
  double force = 0.0;
  for (int k = from; k < to; ++k) {
    Twist t;
    t.v_W = Vec3(0, 0, -0.2);
    ground.begin_step(0, dem::h);
    force += ground.wrench(0, dem::at(0, 0.04 + ground.roughness() - 0.2 * k * dem::h), t).wrench.F_W.z() / (to - from);
    ground.end_step();
  }
  return force;
}

TEST(LiggghtsGround, AFreshGroundGoesOnFromASnapshot) {
  SKIP_WITHOUT_LIGGGHTS();
  const LiggghtsParams p = small_ground(0.0);
  std::vector<std::uint8_t> saved;
  double straight = 0.0;
  Grains before;
  {
    const auto ground = make_terrain(p);
    ground->add_body(dem::small_wheel());
    push(*ground, 0, 60);
    saved = ground->snapshot();
    before = grains_of(*ground);
    straight = push(*ground, 60, 70);
  }
  const auto fresh = make_terrain(p);
  fresh->add_body(dem::small_wheel());
  fresh->restore(saved);
  EXPECT_EQ(grains_of(*fresh).position, before.position);
  EXPECT_GT(straight, 1.0);
  // What is set up anew takes its first half step with the wheel at rest, which is 3 % of these forces.
  EXPECT_NEAR(push(*fresh, 60, 70), straight, 0.1 * straight);
  fresh->begin_step(0, dem::h);
  EXPECT_THROW(fresh->wrench(0, dem::at(9.0, 0.1), {}), RunError);  // beyond the bed
  fresh->restore(saved);
  EXPECT_NEAR(push(*fresh, 60, 70), straight, 0.1 * straight);
  saved.resize(20);
  EXPECT_THROW(fresh->restore(saved), InputError);
}

// This program again, on its own or by mpirun, pushes the wheel for 12 steps and prints the forces in place of its tests.
constexpr const char* push_variable = "TERRODE_TEST_PUSH";
[[maybe_unused]] const bool served = [] {
  if (const auto status = serve()) std::_Exit(*status);
  if (!std::getenv(push_variable)) return true;
  const auto ground = make_terrain(small_ground(0.0));
  ground->add_body(dem::small_wheel());
  for (int k = 0; k < 12; ++k) std::printf("%.12g\n", push(*ground, k, k + 1));
  std::fflush(stdout);
  std::exit(0);
}();

std::vector<double> pushed(const std::string& launcher) {
  const std::string command = kOwnMpi + " " + push_variable + "=1; " + launcher + " " +
                              std::filesystem::read_symlink("/proc/self/exe").string();
  std::vector<double> out;
  FILE* pipe = popen(command.c_str(), "r");
  for (double f = 0.0; pipe && std::fscanf(pipe, "%lf", &f) == 1;) out.push_back(f);
  EXPECT_TRUE(pipe && pclose(pipe) == 0) << command;
  return out;
}

TEST(LiggghtsGround, TwoRanksGiveTheForcesOfOne) {
  SKIP_WITHOUT_LIGGGHTS();
  if (std::system("command -v mpirun > /dev/null 2>&1") != 0) GTEST_SKIP() << "mpirun is not installed";
  const std::vector<double> one = pushed(""), two = pushed("mpirun --oversubscribe -np 2");
  ASSERT_EQ(one.size(), 12u);
  ASSERT_EQ(two.size(), 12u);
  EXPECT_GT(one.back(), 0.0);
  // Sums in another order; grains magnify that with time.
  for (std::size_t k = 0; k < one.size(); ++k) EXPECT_NEAR(two[k], one[k], 1e-6 * std::max(1.0, one[k])) << k;
}

TEST(LiggghtsGround, MisuseAndFailuresAreRefusedAndLeaveTheNextGroundWhole) {
  SKIP_WITHOUT_LIGGGHTS();
  LiggghtsParams p = small_ground(0.01);
  {
    const auto ground = make_terrain(p);
    ground->add_body(dem::small_wheel());
    EXPECT_THROW(ground->add_body(wheel::make_box(0.1, 0.1, 0.1)), InputError);
    ground->begin_step(0, dem::h);
    ground->wrench(0, dem::at(0, 0.1), {});
    ground->wrench(0, dem::at(0, 0.1), {});  // the same trial again
    EXPECT_THAT([&] { ground->wrench(0, dem::at(0, 0.09), {}); }, ::testing::ThrowsMessage<RunError>(::testing::HasSubstr("a second trial")));
    ground->end_step();
    const auto other = make_terrain(p);
    other->begin_step(0, dem::h);
    EXPECT_THAT([&] { other->end_step(); }, ::testing::ThrowsMessage<RunError>(::testing::HasSubstr("one ground at a time")));
    ground->begin_step(0, dem::h);
    EXPECT_THAT([&] { ground->wrench(0, dem::at(0.02, 0.1), {}); }, ::testing::ThrowsMessage<RunError>(::testing::HasSubstr("beyond the bed")));
  }
#ifdef TERRODE_LIGGGHTS
  EXPECT_THAT([] { Workers::instance().commands("no_such_command at all"); },
              ::testing::ThrowsMessage<RunError>("LIGGGHTS: Unknown command: no_such_command at all"));
#endif
  const auto next = make_terrain(p);
  next->add_body(dem::small_wheel());
  next->begin_step(0, dem::h);
  EXPECT_EQ(next->wrench(0, dem::at(0, 0.1), {}).contact_count, 0);
  next->end_step();
  p.bed.time_step = 1.0;
  EXPECT_THROW(make_terrain(p), InputError);
}

}  // namespace
}  // namespace terrode::liggghts
