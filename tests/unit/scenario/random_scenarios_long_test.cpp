// Random scenarios on node-spring ground.
#include "random_scenarios.h"

namespace terrode::scenario {
namespace {

TEST(RandomScenariosLong, TenThousandBySteadyWheel) {
  Tally tally;
  for (std::uint64_t i = 0; i < 10'000 && !::testing::Test::HasFailure(); ++i) try_scenario(1, i, "steady", 10.0, tally);
  tally.print();
  EXPECT_EQ(tally.stopped, 0);
  EXPECT_GT(tally.results, 3000) << "refused " << tally.refused << ", failed " << tally.failed;
  EXPECT_GT(tally.refused, 1000);
}

TEST(RandomScenariosLong, ThousandsOnNodeSpring) {
  Tally tally;
  for (std::uint64_t i = 0; i < 5'000 && !::testing::Test::HasFailure(); ++i) try_scenario(3, i, "node-spring", 2.0, tally);
  tally.print();
  EXPECT_GT(tally.results, 1000);
}

}  // namespace
}  // namespace terrode::scenario
