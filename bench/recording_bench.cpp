// Reading recordings: a table of a million rows and seven channels, from memory and as a recording on disk (with its
// clock checked), against a loop of strtod over the same text; medians of three rounds in this run, and their ratios.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "recording/csv.h"
#include "scenario/recording_file.h"

using namespace terrode;

namespace {

constexpr int kRows = 1'000'000;

std::string million_rows() {
  std::string text = "time [s],drawbar_pull [N],driving_torque [N m],sinkage [m],normal_load [N],angular_velocity [rad/s],forward_velocity [m/s]\n";
  for (int i = 0; i < kRows; ++i) {
    const double x = 1e-3 * (i % 977);
    fmt::format_to(std::back_inserter(text), "{:.3f},{:.3f},{:.4f},{:.6f},{:.2f},{:.4f},{:.5f}\n", 1e-3 * i, 20.0 + x,
                   -0.2 + x, 0.01 + 1e-3 * x, 115.0 - x, 0.29 + 1e-2 * x, 0.038);
  }
  return text;
}

double seconds(const std::function<double()>& work) {
  std::array<double, 3> rounds{};
  for (double& t : rounds) {
    const auto start = std::chrono::steady_clock::now();
    const double sum = work();
    t = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (sum == 12345.678) std::printf(" ");
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds[1];
}

}  // namespace

int main() {
  const std::string text = million_rows();
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / fmt::format("terrode_recording_bench_{}", ::getpid());
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "run.csv") << text;
  std::ofstream(folder / "recording.yaml") << "format: recording/1\nwheel: {radius: 0.13, width: 0.16}\n"
                                              "runs:\n- {id: a, file: run.csv, slip: 0.2, normal_load: 115, angular_velocity: 0.3}\n";
  const double reference = seconds([&] {
    double sum = 0.0;
    const char* at = text.c_str() + text.find('\n') + 1;
    for (int i = 0; i < 7 * kRows; ++i) {
      char* end = nullptr;
      sum += std::strtod(at, &end);
      at = end + 1;
    }
    return sum;
  });
  const double parse = seconds([&] { return static_cast<double>(recording::parse_csv(text, "bench.csv").columns.size()); });
  const double load = seconds([&] { return static_cast<double>(scenario::load_recording(folder.string(), 1).runs.front().time.size()); });
  std::filesystem::remove_all(folder);
  std::printf("a million rows, seven channels, %.0f MB, one thread\n", 1e-6 * static_cast<double>(text.size()));
  std::printf("strtod over the text: %.3f s\n", reference);
  std::printf("parse_csv:            %.3f s, %.2f times strtod\n", parse, parse / reference);
  std::printf("load_recording:       %.3f s, %.2f times strtod\n", load, load / reference);
}
