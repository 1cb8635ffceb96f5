#include "core/environment.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace terrode {
namespace {

TEST(Environment, IsReadAndEmptyWhereNotSet) {
  ASSERT_EQ(setenv("TERRODE_TEST_OF_ENVIRONMENT", "here", 1), 0);
  EXPECT_EQ(environment("TERRODE_TEST_OF_ENVIRONMENT"), "here");
  ASSERT_EQ(unsetenv("TERRODE_TEST_OF_ENVIRONMENT"), 0);
  EXPECT_EQ(environment("TERRODE_TEST_OF_ENVIRONMENT"), "");
}

}  // namespace
}  // namespace terrode
