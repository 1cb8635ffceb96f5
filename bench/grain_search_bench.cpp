// Whether the search for grain parameters finds what is hidden, and what random search and a simplex find with as many
// evaluations on the same curves.
//
//   build/bench/grain_search_bench [--evaluations 40] [--beds 1] [--seed 1] [--threads 2] [--recording DIR]
//
// Hidden grains (Y = 5 MPa, mu_c = 0.4, mu_r = 0.15) on coarse beds of about 250 grains (shear box at 2 and 8 kPa) and
// 1300 grains (plate of 30 mm), six beds of other seeds; the searches see the curves alone. All three end with four new
// beds at the place they recommend. --recording writes the curves as a recording for `terrode calibrate-dem`.
#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "../tests/analytic/calibration/hidden_grains.h"
#include "calibration/grain_search.h"
#include "core/parallel.h"

namespace {

using namespace terrode;
using namespace terrode::calibration;

void write_recording(const recording::Recording& r, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::ofstream yaml(folder / "recording.yaml");
  yaml << "format: recording/1\ntitle: " << r.title << "\nwheel: {radius: 0.13, width: 0.16}\nslip_convention: s = 1 - v/(omega r)\nruns_table: runs.csv\nsoil_tests:\n";
  std::ofstream(folder / "runs.csv") << "slip,normal_load [N]\n0.3,115\n";
  int n = 0;
  const auto table = [&](const char* head, const std::vector<double>& x, const std::vector<double>& y) {
    const std::string name = fmt::format("test_{:02}.csv", ++n);
    std::ofstream csv(folder / name);
    csv << head << "\n";
    for (std::size_t i = 0; i < x.size(); ++i) csv << x[i] << "," << y[i] << "\n";
    return name;
  };
  for (const auto& t : r.direct_shear)
    yaml << fmt::format("  - {{kind: direct_shear, normal_stress: {}, file: {}}}\n", t.normal_stress, table("shear_displacement [m],shear_stress [Pa]", t.shear_displacement, t.shear_stress));
  for (const auto& t : r.pressure_sinkage)
    yaml << fmt::format("  - {{kind: pressure_sinkage, plate_width: {}, plate_length: {}, file: {}}}\n", t.plate_width, t.plate_length, table("sinkage [m],pressure [Pa]", t.sinkage, t.pressure));
}

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  int evaluations = 40, beds = 1, threads = 2;
  std::uint64_t seed = 1;
  std::string folder;
  for (int k = 1; k < argc; ++k) {
    const std::string a = argv[k];
    if (k + 1 == argc) {
      std::cerr << "usage: grain_search_bench [--evaluations N] [--beds N] [--seed N] [--threads N] [--recording DIR]\n";
      return 2;
    }
    const char* value = argv[++k];
    if (a == "--evaluations") evaluations = std::atoi(value);
    else if (a == "--beds") beds = std::atoi(value);
    else if (a == "--seed") seed = static_cast<std::uint64_t>(std::atoi(value));
    else if (a == "--threads") threads = std::atoi(value);
    else if (a == "--recording") folder = value;
  }
  DemTestSettings settings;
  const auto cache = std::filesystem::temp_directory_path() / ("terrode_grain_search_" + std::to_string(::getpid()));
  settings.cache = cache.string();
  const recording::Recording measured = laboratory_of_hidden_grains(settings, threads);
  if (!folder.empty()) {
    write_recording(measured, folder);
    std::filesystem::remove_all(cache);
    fmt::print("wrote {}\n", folder);
    return 0;
  }
  std::vector<std::string> notes;
  const std::vector<TestTarget> targets = test_targets(measured, {}, notes);
  settings.beds = beds;
  fmt::print("hidden: Y = 5 MPa, mu_c = 0.40, mu_r = 0.150; {} evaluations of {} bed(s)\n", evaluations, beds);
  fmt::print("{:<11} {:>22} {:>20} {:>22} {:>28} {:>24} {:>8}\n", "search", "Y [MPa]", "mu_c", "mu_r", "curves, four new beds", "standard errors away", "CPU s");
  for (const SearchMethod method : {SearchMethod::surrogate, SearchMethod::random, SearchMethod::simplex}) {
    SearchOptions o;
    o.method = method;
    o.seed = seed;
    o.evaluations = {evaluations};
    const GrainSearch search(targets, o);
    std::vector<Evaluation> done;
    for (;;) {
      auto batch = search.next(done);
      if (batch.empty()) break;
      parallel_for(batch.size(), threads, [&](std::size_t i) {
        const double from = cpu_seconds();
        try {
          batch[i].curves = simulate_tests(targets, settings, search.values(batch[i].unit), batch[i].seed);
        } catch (const RunError& e) {
          batch[i].error = e.what();
        }
        batch[i].seconds = cpu_seconds() - from;
      });
      std::filesystem::remove_all(cache);
      done.insert(done.end(), batch.begin(), batch.end());
    }
    const SearchResult r = search.result(done);
    double seconds = 0.0;
    for (const Evaluation& e : done) seconds += e.seconds;
    const auto text = [&](const char* name, double unit) {
      const Estimate& e = *r.find(name);
      return r.sample.empty() ? fmt::format("{:.3g}", e.value / unit) : fmt::format("{:.3g} ({:.3g} to {:.3g})", e.value / unit, e.low / unit, e.high / unit);
    };
    std::string away;
    for (const double z : r.standardised) away += fmt::format(" {:.1f}", z);
    fmt::print("{:<11} {:>22} {:>20} {:>22} {:>28} {:>24} {:>8.0f}\n", method == SearchMethod::surrogate ? "surrogate" : method == SearchMethod::random ? "random" : "simplex",
               text("young_modulus", 1e6), text("friction", 1.0), text("rolling_friction", 1.0),
               fmt::format("shear {:.1f} %, plate {:.1f} %", 100 * std::sqrt(r.observed.shear), 100 * std::sqrt(r.observed.plates)), away, seconds);
    for (const Warning& w : r.warnings) fmt::print("  {}: {}\n", w.id, w.text);
    std::fflush(stdout);
  }
}
