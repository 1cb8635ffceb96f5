// Reading recordings: a table of a million rows and seven channels.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <string>

#include "recording/csv.h"

namespace {

std::string million_rows() {
  std::string text = "time [s],drawbar_pull [N],driving_torque [N m],sinkage [m],normal_load [N],angular_velocity [rad/s],forward_velocity [m/s]\n";
  for (int i = 0; i < 1'000'000; ++i) {
    const double x = 1e-3 * (i % 977);
    fmt::format_to(std::back_inserter(text), "{:.3f},{:.3f},{:.4f},{:.6f},{:.2f},{:.4f},{:.5f}\n", 1e-3 * i, 20.0 + x,
                   -0.2 + x, 0.01 + 1e-3 * x, 115.0 - x, 0.29 + 1e-2 * x, 0.038);
  }
  return text;
}

void read_million_rows(benchmark::State& state) {
  const std::string text = million_rows();
  for (auto _ : state) benchmark::DoNotOptimize(terrode::recording::parse_csv(text, "bench.csv"));
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(text.size()));
}
BENCHMARK(read_million_rows)->Unit(benchmark::kMillisecond)->Iterations(3);

}  // namespace

BENCHMARK_MAIN();
