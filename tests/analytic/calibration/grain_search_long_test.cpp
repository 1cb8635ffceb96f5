// The search for grain parameters on particles: hidden grains found from the curves of coarse beds. About a minute of
// processor time. bench/grain_search_bench.cpp shows random search and a simplex beside it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "calibration/grain_search.h"
#include "core/parallel.h"
#include "hidden_grains.h"

namespace terrode::calibration {
namespace {

TEST(GrainSearchOnParticles, RecoversHiddenGrainsInFortyEvaluations) {
  DemTestSettings settings;
  const auto cache = std::filesystem::temp_directory_path() / ("terrode_grain_search_" + std::to_string(::getpid()));
  settings.cache = cache.string();
  const recording::Recording measured = laboratory_of_hidden_grains(settings, 2);
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
    EXPECT_LE(e.low, kHiddenGrains.at(e.name)) << e.name;
    EXPECT_GE(e.high, kHiddenGrains.at(e.name)) << e.name;
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
