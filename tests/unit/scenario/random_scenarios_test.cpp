// Random scenarios by the steady wheel and a few on node-spring ground; random_scenarios_long_test.cpp has 10,000 and
// thousands.
#include "random_scenarios.h"

namespace terrode::scenario {
namespace {

TEST(RandomScenarios, SomeBySteadyWheel) {
  Tally tally;
  for (std::uint64_t i = 0; i < 300 && !::testing::Test::HasFailure(); ++i) try_scenario(1, i, "steady", 10.0, tally);
  tally.print();
  EXPECT_EQ(tally.stopped, 0);
  EXPECT_LT(tally.longest, 1.0);
  EXPECT_GT(tally.results, 60) << "refused " << tally.refused << ", failed " << tally.failed;
  EXPECT_GT(tally.refused, 20);
}

TEST(RandomScenarios, SomeOnNodeSpring) {
  Tally tally;
  for (std::uint64_t i = 0; i < 60 && !::testing::Test::HasFailure(); ++i) try_scenario(2, i, "node-spring", 0.2, tally);
  EXPECT_GT(tally.results + tally.failed + tally.refused, 20) << "stopped " << tally.stopped;
}

}  // namespace
}  // namespace terrode::scenario
