// The search for grain parameters on particles: hidden grains found from the curves of coarse beds. About a minute of
// processor time. bench/grain_search_bench.cpp shows random search and a simplex beside it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "calibration/grain_search.h"
#include "core/parallel.h"

namespace terrode::calibration {
namespace {

TEST(GrainSearchOnParticles, RecoversHiddenGrainsInFortyEvaluations) {
  const GrainValues hidden = {{"young_modulus", 5e6}, {"friction", 0.4}, {"rolling_friction", 0.15}};
  std::vector<TestTarget> conditions(3);
  for (std::size_t t = 0; t < 3; ++t) {
    TestTarget& c = conditions[t];
    c.test = t < 2 ? "direct_shear" : "pressure_sinkage";
    if (t < 2) c.normal_stress = t == 0 ? 2000 : 8000;
    else c.plate_width = c.plate_length = 0.03;
    for (int i = 1; i <= 24; ++i) c.at.push_back((t < 2 ? 5e-3 : 8e-3) * i / 24);
  }
  DemTestSettings settings;
  const auto cache = std::filesystem::temp_directory_path() / ("terrode_grain_search_" + std::to_string(::getpid()));
  settings.cache = cache.string();
  constexpr int kRepeats = 6;
  std::vector<std::vector<std::vector<double>>> curves(kRepeats);
  parallel_for(kRepeats, 2, [&](std::size_t r) { curves[r] = simulate_tests(conditions, settings, hidden, 777000 + r); });
  recording::Recording measured;
  for (const auto& c : curves)
    for (std::size_t t = 0; t < 3; ++t) {
      std::vector<double> x = {0.0}, y = {0.0};
      x.insert(x.end(), conditions[t].at.begin(), conditions[t].at.end());
      y.insert(y.end(), c[t].begin(), c[t].end());
      if (t < 2) {
        recording::DirectShearTest test;
        test.normal_stress = conditions[t].normal_stress;
        test.shear_displacement = x;
        test.shear_stress = y;
        measured.direct_shear.push_back(test);
      } else {
        recording::PressureSinkageTest test;
        test.plate_width = test.plate_length = conditions[t].plate_width;
        test.sinkage = x;
        test.pressure = y;
        measured.pressure_sinkage.push_back(test);
      }
    }
  std::vector<std::string> notes;
  const GrainSearch search(test_targets(measured, {}, notes), {});
  std::vector<Evaluation> done;
  for (;;) {
    auto batch = search.next(done);
    if (batch.empty()) break;
    parallel_for(batch.size(), 2, [&](std::size_t i) {
      try {
        batch[i].curves = simulate_tests(search.targets(), settings, search.values(batch[i].unit), batch[i].seed);
      } catch (const RunError& e) {
        batch[i].error = e.what();
      }
    });
    std::filesystem::remove_all(cache);
    done.insert(done.end(), batch.begin(), batch.end());
  }
  EXPECT_EQ(done.size(), 40u);
  const SearchResult r = search.result(done);
  EXPECT_LE(r.failed, 4);
  for (const Estimate& e : r.estimates) {
    EXPECT_LE(e.low, hidden.at(e.name)) << e.name;
    EXPECT_GE(e.high, hidden.at(e.name)) << e.name;
  }
  // What these tests can tell: stiffness comes from the grains' modulus alone.
  EXPECT_TRUE(r.find("young_modulus")->identified);
  EXPECT_GT(r.find("young_modulus")->value, 5e6 / 3);
  EXPECT_LT(r.find("young_modulus")->value, 5e6 * 3);
  // The curves within their scatter: standardised differences of correlated points stay below 2.5 in root mean square.
  for (const double z : r.standardised) EXPECT_LT(z, 2.5);
}

}  // namespace
}  // namespace terrode::calibration
