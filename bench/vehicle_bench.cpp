// CPU seconds per simulated second of whole machines on node-spring ground of 10 mm: the counter `real_time` is how
// many times faster than real time one core runs them.
#include <benchmark/benchmark.h>

#include "core/parallel.h"
#include "terrain/node_spring.h"
#include "vehicle/machines.h"

namespace {

using namespace terrode;

vehicle::Vehicle make(const std::string& name) {
  terrain::NodeSpringParams ground;
  ground.spacing = 0.01;
  return {vehicle::machine(name), {}, std::make_unique<terrain::NodeSpringTerrain>(ground)};
}

void advance(vehicle::Vehicle& machine, double seconds) {
  const auto steps = static_cast<int>(seconds / machine.options().time_step);
  for (int i = 0; i < steps; ++i) machine.step();
}

void drive(benchmark::State& state, const std::string& name) {
  vehicle::Vehicle machine = make(name);
  machine.drive_path(0.1, 0.0);
  advance(machine, 0.5);
  for (auto _ : state) advance(machine, 0.5);
  state.counters["real_time"] =
      benchmark::Counter(0.5 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK_CAPTURE(drive, rocker_bogie_rover, "rocker-bogie-rover")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(drive, skid_steer_robot, "skid-steer-robot")->Unit(benchmark::kMillisecond);

// Twenty robots at once; with two cores free, wall time is half of that with one thread.
void batch(benchmark::State& state) {
  for (auto _ : state)
    parallel_for(20, static_cast<int>(state.range(0)), [](std::size_t) {
      vehicle::Vehicle machine = make("skid-steer-robot");
      machine.drive_path(0.1, 0.0);
      advance(machine, 0.5);
    });
}
BENCHMARK(batch)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(1);

}  // namespace

BENCHMARK_MAIN();
