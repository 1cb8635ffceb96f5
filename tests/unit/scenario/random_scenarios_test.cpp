// 10,000 random scenarios by the steady wheel and a few on node-spring ground; random_scenarios_long_test.cpp has more of
// the latter.
#include "random_scenarios.h"

namespace terrode::scenario {
namespace {

TEST(RandomScenarios, TenThousandBySteadyWheel) {
  Tally tally;
  for (std::uint64_t i = 0; i < 10'000 && !::testing::Test::HasFailure(); ++i) try_scenario(1, i, "steady", 10.0, tally);
  EXPECT_EQ(tally.stopped, 0);
  EXPECT_GT(tally.results, 3000) << "refused " << tally.refused << ", failed " << tally.failed;
  EXPECT_GT(tally.refused, 1000);
}

TEST(RandomScenarios, SomeOnNodeSpring) {
  Tally tally;
  for (std::uint64_t i = 0; i < 60 && !::testing::Test::HasFailure(); ++i) try_scenario(2, i, "node-spring", 0.2, tally);
  EXPECT_GT(tally.results + tally.failed + tally.refused, 20) << "stopped " << tally.stopped;
}

}  // namespace
}  // namespace terrode::scenario
