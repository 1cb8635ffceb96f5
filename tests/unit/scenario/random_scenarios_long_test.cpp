// Random scenarios on node-spring ground.
#include "random_scenarios.h"

namespace terrode::scenario {
namespace {

TEST(RandomScenariosLong, ThousandsOnNodeSpring) {
  Tally tally;
  for (std::uint64_t i = 0; i < 5'000 && !::testing::Test::HasFailure(); ++i) try_scenario(3, i, "node-spring", 2.0, tally);
  RecordProperty("results", tally.results);
  RecordProperty("refused", tally.refused);
  RecordProperty("failed", tally.failed);
  RecordProperty("stopped", tally.stopped);
  EXPECT_GT(tally.results, 1000);
}

}  // namespace
}  // namespace terrode::scenario
