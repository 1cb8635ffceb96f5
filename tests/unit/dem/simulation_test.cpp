// The engine: same bits for any thread count, vector width and after a restart; conservation; periodicity; walls;
// clumps; what it refuses.
#include "dem/simulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "core/random.h"

namespace terrode::dem {
namespace {

struct BedOptions {
  int threads = 1;
  const char* kernel = "";
  int layers = 12;
  double time_step = 8e-6;
  bool lid = false;
};

// A loose lattice of grains falling in a periodic cell onto a smooth floor.
Simulation falling_bed(const BedOptions& o) {
  Settings s;
  s.time_step = o.time_step;
  s.period = Vec3(0.06, 0.06, 0.0);
  s.threads = o.threads;
  s.kernel = o.kernel;
  Simulation sim(s);
  const int m = sim.add_material({});
  const int w = sim.add_material({"wall"});
  sim.set_interaction(m, m, {});
  sim.set_interaction(m, w, Interaction::smooth_wall());
  sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), w);
  Random random(7);
  for (int z = 0; z < o.layers; ++z)
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x) {
        Sphere p;
        p.radius = random.uniform(0.002, 0.0035);
        p.density = 3090;
        p.position = Vec3((x + 0.5) * 0.0075, (y + 0.5) * 0.0075, 0.004 + z * 0.0072);
        p.velocity = Vec3(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), random.uniform(-1.0, 0.0));
        sim.add_particle(p);
      }
  if (o.lid) {
    Body lid;
    lid.position = Vec3(0.03, 0.03, 0.12);
    lid.free_translation = {false, false, true};
    lid.mass = 0.05;
    const int b = sim.add_body(lid);
    std::vector<Member> members;
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x) members.push_back({Vec3(-0.02625 + 0.0075 * x, -0.02625 + 0.0075 * y, 0.0), 0.005});
    sim.add_members(b, members, m);
  }
  return sim;
}

std::vector<double> state(const Simulation& sim) {
  std::vector<double> out;
  for (const int id : sim.ids())
    for (const Vec3& v : {sim.position(id), sim.velocity(id), sim.spin(id)})
      out.insert(out.end(), v.data(), v.data() + 3);
  for (int b = 0; b < sim.body_count(); ++b)
    for (const Vec3& v : {sim.body(b).position, sim.body(b).force}) out.insert(out.end(), v.data(), v.data() + 3);
  return out;
}

TEST(Determinism, SameBitsForAnyNumberOfThreads) {
  BedOptions o;
  o.layers = 40;  // 2560 grains: two chunks
  o.lid = true;
  Simulation one = falling_bed(o);
  one.run(500);
  EXPECT_GT(one.counters().inner_builds, 5);
  EXPECT_GT(one.pair_contacts().size(), 20u);
  o.threads = 3;
  Simulation three = falling_bed(o);
  three.run(500);
  EXPECT_EQ(state(one), state(three));
}

TEST(Determinism, SameBitsForEveryVectorWidth) {
  BedOptions o;
  o.kernel = "generic";
  Simulation generic = falling_bed(o);
  generic.run(3000);
  EXPECT_GT(generic.coordination(), 0.2);
  for (const char* name : {"avx2", "avx512"}) {
    o.kernel = name;
    try {
      kernels(name);
    } catch (const InputError&) {
      continue;  // not on this processor
    }
    Simulation wide = falling_bed(o);
    wide.run(3000);
    EXPECT_EQ(state(generic), state(wide)) << name;
  }
  EXPECT_THROW(kernels("avx1024"), InputError);
}

TEST(Restart, ContinuesBitForBit) {
  BedOptions o;
  o.lid = true;
  Simulation a = falling_bed(o);
  a.run(3333);
  std::stringstream saved;
  a.save(saved);
  a.run(2000);
  Simulation b = falling_bed(o);
  b.load(saved);
  EXPECT_GT(b.counters().list_builds, 0);
  b.run(2000);
  EXPECT_EQ(state(a), state(b));
  EXPECT_EQ(a.counters().list_builds, b.counters().list_builds);
}

TEST(Restart, RefusesAnotherSimulationsState) {
  Simulation a = falling_bed({});
  a.run(10);
  std::stringstream saved, cut;
  a.save(saved);
  BedOptions o;
  o.lid = true;
  Simulation other = falling_bed(o);
  EXPECT_THROW(other.load(saved), InputError);
  cut << saved.str().substr(0, 1000);
  Simulation c = falling_bed({});
  EXPECT_THROW(c.load(cut), InputError);
}

TEST(Lists, HistorySurvivesSortingAndRebuilding) {
  // A settled bed whose lists are made again at every step goes on like one whose lists last: with the same contacts
  // and springs, sums in another order. Rounding differs, so that trajectories part slowly.
  Settings s;
  constexpr double allowed = 1e-9;  // m; grows from rounding alone over 200 steps of a quiet bed
  std::vector<Simulation> sims;
  for (const double skin : {1e-3, 1e-9}) {
    s.time_step = 8e-6;
    s.skin = skin;
    s.viscous = 0.05;
    s.period = Vec3(0.03, 0.03, 0.0);
    Simulation sim(s);
    const int m = sim.add_material({});
    sim.set_interaction(m, m, {});
    sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), m);
    Random random(3);
    for (int k = 0; k < 48; ++k)
      sim.add_particle({Vec3(0.00375 + 0.0075 * (k % 4), 0.00375 + 0.0075 * (k / 4 % 4), 0.004 + 0.0072 * (k / 16)),
                        random.uniform(0.003, 0.0036), 3090, Vec3(random.uniform(-1, 1), 0.3, -1), Vec3::Zero(), m});
    sim.run(5000);
    sims.push_back(std::move(sim));
  }
  EXPECT_GT(sims[1].counters().list_builds, 1000);
  EXPECT_LT(sims[0].counters().list_builds, 100);
  EXPECT_GT(sims[0].pair_contacts().size(), 5u);
  for (const int id : sims[0].ids()) EXPECT_LT((sims[0].position(id) - sims[1].position(id)).norm(), allowed) << id;
}

TEST(Conservation, MomentumAndAngularMomentumOfACloud) {
  Settings s;
  s.gravity.setZero();
  s.time_step = 5e-6;
  Simulation sim(s);
  const int m = sim.add_material({});
  sim.set_interaction(m, m, {});
  Random random(11);
  for (int k = 0; k < 125; ++k) {
    const Vec3 x(0.0072 * (k % 5), 0.0072 * (k / 5 % 5), 0.0072 * (k / 25));
    sim.add_particle({x, random.uniform(0.002, 0.0036), 3090, -8.0 * (x - Vec3::Constant(0.0144)) * 20.0,
                      Vec3(random.normal(), random.normal(), random.normal()) * 20, m});
  }
  const auto momentum = [&] {
    Vec3 p = Vec3::Zero(), l = Vec3::Zero();
    for (const int id : sim.ids()) {
      const double mass = sim.mass(id), r = sim.radius(id);
      p += mass * sim.velocity(id);
      // x is half a step ahead of v; x cross v is the same, since the drift is along v.
      l += mass * sim.position(id).cross(sim.velocity(id)) + 0.4 * mass * r * r * sim.spin(id);
    }
    return std::pair(p, l);
  };
  const auto before = momentum();
  const double scale = sim.total_mass() * 1.0, kinetic = sim.energy().kinetic();
  sim.run(1500);
  EXPECT_LT(sim.energy().kinetic(), 0.9 * kinetic);  // they did collide
  const auto after = momentum();
  // The contact point divides the overlap evenly, so that both arms end in one point only for equal spheres: angular
  // momentum has an error of the overlap times the difference of radii (in LIGGGHTS, too).
  EXPECT_LT((after.first - before.first).norm(), 1e-13 * scale);
  EXPECT_LT((after.second - before.second).norm(), 1e-4 * scale * 0.0144);
}

TEST(Conservation, ElasticCollisionKeepsEnergyAndDampingTakesIt) {
  constexpr double half_step_mismatch = 0.01;  // positions are half a step ahead of velocities
  for (const double e : {1.0, 0.4}) {
    Settings s;
    s.gravity.setZero();
    s.time_step = 1e-6;
    Simulation sim(s);
    const int m = sim.add_material({});
    Interaction law;
    law.restitution = e;
    law.rolling = "none";
    law.friction = 0.0;
    sim.set_interaction(m, m, law);
    sim.add_particle({Vec3(0, 0, 0), 0.003, 3090, Vec3(0.5, 0, 0), Vec3::Zero(), m});
    sim.add_particle({Vec3(0.0062, 0, 0), 0.003, 3090, Vec3(-0.5, 0, 0), Vec3::Zero(), m});
    const double before = sim.energy().total();
    double mid = 0.0;
    for (int k = 0; k < 60; ++k) {
      sim.run(20);
      mid = std::max(mid, sim.energy().normal_springs);
      EXPECT_LT(sim.energy().total(), before * (1.0 + half_step_mismatch));
    }
    EXPECT_GT(mid, 0.1 * before);
    EXPECT_NEAR(sim.energy().total() / before, e * e, 2e-3);
  }
}

TEST(Periodic, ContactsAcrossTheCellActLikeContactsInside) {
  const auto run = [](double shift) {
    Settings s;
    s.gravity.setZero();
    s.time_step = 4e-6;
    s.period = Vec3(0.05, 0.05, 0.05);
    Simulation sim(s);
    const int m = sim.add_material({});
    sim.set_interaction(m, m, {});
    sim.add_particle({Vec3(0.025 + shift, 0.025 + shift, 0.025), 0.003, 3090, Vec3(1, 0.2, 0), Vec3(0, 0, 30), m});
    sim.add_particle({Vec3(0.0312 + shift - (shift > 0 ? 0.05 : 0), 0.025 + shift, 0.025), 0.004, 3090, Vec3(-1, 0, 0),
                      Vec3::Zero(), m});
    sim.run(400);
    return std::pair(sim.velocity(0), sim.spin(1));
  };
  const auto inside = run(0.0), across = run(0.0225);
  EXPECT_LT(inside.first.x(), 0.5);
  EXPECT_LT((inside.first - across.first).norm(), 1e-9);
  EXPECT_LT((inside.second - across.second).norm(), 1e-6);
}

TEST(Periodic, RefusesACellSmallerThanTwoReaches) {
  Settings s;
  s.period = Vec3(0.02, 0, 0);
  Simulation sim(s);
  const int m = sim.add_material({});
  sim.set_interaction(m, m, {});
  sim.add_particle({Vec3::Zero(), 0.005, 3090});
  EXPECT_THROW(sim.run(1), InputError);
}

TEST(TimeStep, SuggestedFromRayleighAndRefusedAboveTheLimit) {
  Settings s;
  Simulation sim(s);
  const int m = sim.add_material({});
  sim.set_interaction(m, m, {});
  sim.add_particle({Vec3::Zero(), 0.005, 3090});
  sim.add_particle({Vec3(0, 0, 0.1), 0.00125, 3090});
  const double expected = std::numbers::pi * 0.00125 * std::sqrt(3090 / (7e7 / 2.7)) / (0.1631 * 0.35 + 0.8766);
  EXPECT_NEAR(sim.rayleigh_time() / expected, 1.0, 1e-12);
  sim.run(1);
  EXPECT_DOUBLE_EQ(sim.time_step(), sim.suggested_time_step());
  sim.set_time_step(1.01 * largest_rayleigh_fraction * expected);
  try {
    sim.run(1);
    FAIL() << "a step too large was taken";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("Rayleigh"), std::string::npos);
  }
}

TEST(Energy, GrowthThatNothingPutInStopsTheRun) {
  // Two grains pressed far into each other hold energy; a grain that overlaps from nowhere, put in between two checks,
  // is growth.
  Simulation sim = falling_bed({});
  sim.run(400);
  const Vec3 at = sim.position(100);
  for (int k = 0; k < 3; ++k) sim.add_particle({at + Vec3(0.001 * k, 0, 0), 0.003, 3e4});
  EXPECT_THROW(sim.run(1000), RunError);
}

TEST(Missing, InteractionIsNamed) {
  Settings s;
  Simulation sim(s);
  sim.add_material({"sand"});
  sim.add_particle({Vec3::Zero(), 0.005, 3090});
  try {
    sim.run(1);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("sand"), std::string::npos);
  }
}

TEST(Walls, FloorCarriesTheWeight) {
  Simulation sim = falling_bed({});
  sim.run(60000);
  double mean = 0.0;
  for (int k = 0; k < 200; ++k) {
    sim.run(10);
    mean += sim.body(0).force.z() / 200;
  }
  constexpr double rattling = 0.02;  // of the weight: waves that still run through the bed
  EXPECT_NEAR(-mean / (sim.total_mass() * 9.81), 1.0, rattling);
  EXPECT_LT(sim.unbalanced_force(), 0.2);
  EXPECT_GT(sim.coordination(), 2.0);
}

TEST(Walls, BodyMovesAndFeelsTheReaction) {
  // A plate pushes a grain along: after the impact it has at most (1 + e) times the plate's speed, and what the plate
  // gave is what it felt.
  Settings s;
  s.gravity.setZero();
  s.time_step = 2e-6;
  Simulation sim(s);
  const int m = sim.add_material({});
  sim.set_interaction(m, m, {});
  Body plate;
  plate.velocity = Vec3(0.3, 0, 0);
  const int b = sim.add_body(plate);
  sim.add_surface(b, make_plate(Vec3::Zero(), Vec3(0, 0.01, 0), Vec3(0, 0, 0.01)), m);
  sim.add_particle({Vec3(0.0031, 0, 0), 0.003, 3090, Vec3::Zero(), Vec3::Zero(), m});
  double impulse = 0.0;
  for (int k = 0; k < 1500; ++k) {
    sim.run(1);
    impulse -= sim.body(b).force.x() * 2e-6;
  }
  EXPECT_NEAR(sim.velocity(0).x(), 0.3 * 1.4, 2e-3);
  EXPECT_NEAR(impulse / (sim.mass(0) * sim.velocity(0).x()), 1.0, 1e-6);
  EXPECT_NEAR(sim.body(b).position.x(), 0.3 * 1500 * 2e-6, 1e-12);
  EXPECT_NEAR(sim.body_work() / (0.3 * impulse), 1.0, 1e-6);
}

TEST(Clumps, FreeBodyOfSpheresFallsAndRollsLikeARigidBody) {
  Settings s;
  s.time_step = 5e-6;
  Simulation sim(s);
  const int m = sim.add_material({});
  Interaction law;
  law.rolling = "none";
  law.friction = 0.0;
  law.restitution = 1.0;
  sim.set_interaction(m, m, law);
  sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), m);
  Body stick;
  stick.position = Vec3(0, 0, 0.02);
  stick.free_translation = {true, true, true};
  stick.free_rotation = true;
  stick.mass = 0.002;
  stick.inertia = Vec3(2e-7, 1e-8, 2e-7).asDiagonal();
  const int b = sim.add_body(stick);
  sim.add_members(b, {{Vec3(0, -0.01, 0), 0.004}, {Vec3(0, 0, 0), 0.004}, {Vec3(0, 0.01, 0), 0.004}}, m);
  sim.body(b).spin = Vec3(5.0, 0.0, 0.0);
  const auto energy = [&] {
    const Body& k = sim.body(b);
    const Mat3 R = k.orientation.toRotationMatrix();
    return 0.5 * k.mass * k.velocity.squaredNorm() + 0.5 * k.spin.dot(R * k.inertia * R.transpose() * k.spin) +
           k.mass * 9.81 * k.position.z();
  };
  const double before = energy();
  sim.run(20000);  // 0.1 s: falls, hits with one end, tumbles
  EXPECT_NEAR(sim.body(b).spin.y(), 0.0, 1e-9);
  EXPECT_GT(std::abs(sim.body(b).spin.x() - 5.0), 1.0);
  EXPECT_NEAR(sim.body(b).position.x(), 0.0, 1e-12);
  EXPECT_NEAR(energy() / before, 1.0, 0.01);
  EXPECT_EQ(sim.free_count(), 0u);
  EXPECT_EQ(sim.particle_count(), 3u);
}

TEST(Particles, RemovedOnesAreGoneAndOthersGoOn) {
  Simulation sim = falling_bed({});
  sim.run(500);
  const std::size_t before = sim.free_count();
  sim.remove_particles([](const Vec3& x, double) { return x.z() > 0.05; });
  EXPECT_LT(sim.free_count(), before);
  EXPECT_EQ(sim.ids().size(), sim.free_count());
  sim.run(500);
  sim.scale_density(0.5);
  const double mass = sim.total_mass();
  sim.scale_density(2.0);
  EXPECT_NEAR(sim.total_mass() / mass, 2.0, 1e-12);
}

TEST(Particles, FrozenOnesStayAndHoldTheOthers) {
  Simulation sim = falling_bed({});
  sim.run(500);
  const std::size_t before = sim.free_count();
  const double mass = sim.total_mass();
  sim.set_frozen([](const Vec3& x, double) { return x.z() < 0.03; }, 3090);
  EXPECT_LT(sim.free_count(), before);
  std::vector<Vec3> frozen;
  const auto low = [&] {
    std::vector<Vec3> out;
    sim.for_each_grain([&](const Vec3& x, double) {
      if (x.z() < 0.02) out.push_back(x);
    });
    std::sort(out.begin(), out.end(), [](const Vec3& a, const Vec3& b) { return a.x() < b.x(); });
    return out;
  };
  const auto held = low();
  sim.run(3000);
  EXPECT_EQ(low(), held);
  sim.set_frozen([](const Vec3&, double) { return false; }, 3090);
  EXPECT_EQ(sim.free_count(), before);
  EXPECT_NEAR(sim.total_mass() / mass, 1.0, 1e-12);
  sim.run(500);
  EXPECT_NE(low(), held);
}

}  // namespace
}  // namespace terrode::dem
