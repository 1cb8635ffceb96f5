// Also what tools/sanitize tsan looks at: rounds of a crew are short, so that a race between two of them would show.
#include "core/parallel.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace terrode {
namespace {

TEST(Parallel, EachPieceIsDoneOnce) {
  for (const int threads : {1, 2, 7}) {
    std::vector<int> done(1000, 0);  // not atomic: pieces share nothing
    parallel_for(done.size(), threads, [&](std::size_t i) { ++done[i]; });
    EXPECT_EQ(done, std::vector<int>(1000, 1)) << threads;
  }
  parallel_for(0, 2, [](std::size_t) { FAIL(); });
}

TEST(Parallel, TheFirstFailureIsToldAndTheRestIsDone) {
  std::vector<int> done(100, 0);
  try {
    parallel_for(done.size(), 4, [&](std::size_t i) {
      ++done[i];
      if (i % 10 == 3) throw std::runtime_error(std::to_string(i));
    });
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(), "3");
  }
  EXPECT_EQ(done, std::vector<int>(100, 1));
}

TEST(Crew, RoundsFollowEachOther) {
  for (const int threads : {1, 2, 5}) {
    Crew crew(threads);
    EXPECT_EQ(crew.threads(), threads);
    std::vector<double> values(64, 0.0);
    for (int round = 0; round < 300; ++round) {
      // Each round reads what another thread may have written in the round before.
      std::vector<double> next(values.size());
      crew.run(values.size(), [&](std::size_t i) { next[i] = values[(i + 17) % values.size()] + 1.0; });
      values = next;
    }
    EXPECT_EQ(values, std::vector<double>(64, 300.0)) << threads;
    int one = 0;
    crew.run(1, [&](std::size_t) { ++one; });
    crew.run(0, [&](std::size_t) { ++one; });
    EXPECT_EQ(one, 1);
  }
}

TEST(Crew, MayEndWithoutWork) {
  for (int k = 0; k < 50; ++k) Crew idle(3);
}

}  // namespace
}  // namespace terrode
