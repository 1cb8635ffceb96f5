// The same scenario, seed and version give the same bytes for any number of threads on one machine, and numbers that
// agree to 1e-9 between machines, compilers and vector widths (stored_numbers.h).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "dem/bed.h"
#include "dem/dem_terrain.h"
#include "dem/kernel.h"
#include "killed.h"
#include "scenario/methods.h"
#include "scenario/vehicle_file.h"
#include "stored_numbers.h"

namespace terrode {
namespace {

class SameNumbers : public Killed {
 protected:
  std::uint64_t hash(const std::string& path) const {
    const std::string all = contents(recording::Hdf5File::open(path));
    return terrain::digest({reinterpret_cast<const std::uint8_t*>(all.data()), all.size()});
  }
};

TEST_F(SameNumbers, ResultFilesForOneAndTwoThreads) {
  const std::string name = rig_scenario("steady, node-spring", 0.05);
  for (const char* threads : {"1", "2"}) run(program({"sweep", name, "-j", threads, "--quiet", "-o", file(threads)}));
  EXPECT_EQ(hash(file("1")), hash(file("2")));
}

dem::Simulation small_pile(int threads, const std::string& kernel) {
  dem::Settings settings;
  settings.threads = threads;
  settings.kernel = kernel;
  settings.gravity = Vec3(0, 0, -9.81);
  settings.period = Vec3(0.06, 0.06, 0.0);
  dem::Simulation sim(settings);
  const int grain = sim.add_material({"grain", 5e6, 0.3});
  sim.set_interaction(grain, grain, {});
  sim.add_surface(sim.add_body({}), dem::make_plane(Vec3::UnitZ(), 0.0), grain);
  Random random(5);
  for (int k = 0; k < 12; ++k)
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 6; ++i)
        sim.add_particle({Vec3(0.01 * i + 0.005 + random.uniform(-1e-3, 1e-3), 0.01 * j + 0.005, 0.0105 * k + 0.005),
                          0.0045 + 1e-4 * random.uniform(), 2600.0, Vec3::Zero(), Vec3::Zero(), grain});
  sim.set_time_step(0.15 * sim.rayleigh_time());
  return sim;
}

std::uint64_t hash(const dem::Simulation& sim) {
  std::uint64_t h = 0;
  for (const int id : sim.ids()) {
    const Vec3 x = sim.position(id), v = sim.velocity(id), w = sim.spin(id);
    const double all[] = {x.x(), x.y(), x.z(), v.x(), v.y(), v.z(), w.x(), w.y(), w.z()};
    h = 31 * h + terrain::digest({reinterpret_cast<const std::uint8_t*>(all), sizeof all});
  }
  return h;
}

TEST(SameParticles, ForAnyNumberOfThreads) {
  std::vector<std::uint64_t> hashes;
  for (const int threads : {1, 2, 3}) {
    dem::Simulation sim = small_pile(threads, "");
    sim.run(400);
    hashes.push_back(hash(sim));
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(hashes[0], hashes[2]);
}

// Kinetic energy and the mean height: sums over all grains while they fall and hit the floor; later, contacts multiply
// every difference in rounding.
std::vector<double> pile_numbers(const std::string& kernel) {
  dem::Simulation sim = small_pile(1, kernel);
  sim.run(100);
  double height = 0.0;
  for (const int id : sim.ids()) height += sim.position(id).z();
  return {sim.energy().kinetic(), sim.energy().total(), height, sim.largest_speed()};
}

void expect_stored(const std::string& name, const std::vector<double>& now) {
  const auto found = stored_numbers().find(name);
  std::string text;
  for (const double x : now) text += fmt::format("{:.17g}, ", x);
  ASSERT_NE(found, stored_numbers().end()) << "{\"" << name << "\", {" << text << "}},";
  ASSERT_EQ(found->second.size(), now.size()) << text;
  for (std::size_t i = 0; i < now.size(); ++i)
    EXPECT_NEAR(now[i], found->second[i], 1e-9 * std::abs(found->second[i])) << name << " " << i << ": " << text;
}

TEST(StoredNumbers, ParticlesByEveryKernelOfThisProcessor) {
  for (const char* kernel : {"generic", "avx2", "avx512"}) {
    try {
      dem::kernels(kernel);
    } catch (const InputError&) {
      continue;  // not on this processor
    }
    SCOPED_TRACE(kernel);
    expect_stored("particles", pile_numbers(kernel));
  }
}

TEST(StoredNumbers, WheelBySteadyAndNodeSpring) {
  for (const char* method : {"steady", "node-spring"}) {
    scenario::Scenario s = scenario::load_scenario(std::string(TERRODE_SOURCE_DIR) + "/scenarios/mms_table8.yaml");
    s.rig.travel = 0.02;
    s.terrain.node_spacing = 0.01;
    const vehicle::SweepMethod m = scenario::make_method(method, s);
    std::vector<double> numbers;
    for (const scenario::OperatingPoint& at : s.operating_points({-0.2, 0.1, 0.4})) {
      const recording::Run run = m.run(scenario::condition_of(at, s.wheel.radius), {}).run;
      for (const char* name : {"drawbar_pull", "driving_torque", "sinkage"})
        numbers.push_back(run.time.empty() ? run.steady.at(name).mean : run.find(name)->values.back());
    }
    expect_stored(method, numbers);
  }
}

TEST(StoredNumbers, Vehicle) {
  scenario::DriveScenario d = scenario::load_drive(std::string(TERRODE_SOURCE_DIR) + "/scenarios/rover.yaml");
  d.duration = 1.0;
  const recording::Run run = scenario::run_drive(d).run;
  std::vector<double> numbers;
  for (const char* name : {"position_x", "position_z", "power", "front_left_sinkage"}) numbers.push_back(run.find(name)->values.back());
  expect_stored("vehicle", numbers);
}

}  // namespace
}  // namespace terrode
