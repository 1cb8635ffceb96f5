// The tutorial, done as it is written.
#include "page_runner.h"

namespace terrode::docs {
namespace {

TEST(Tutorial, RunsAndPrintsWhatItSays) {
  EXPECT_GT(PageRunner().run(fs::path(TERRODE_SOURCE_DIR) / "docs/tutorial.md"), 6);
}

}  // namespace
}  // namespace terrode::docs
