// The pages whose commands take a while: they print what the pages say.
#include "page_runner.h"

namespace terrode::docs {
namespace {

TEST(Pages, TheTutorialRunsAsWritten) { EXPECT_GT(PageRunner().run(fs::path(TERRODE_SOURCE_DIR) / "docs/tutorial.md"), 6); }
TEST(Pages, ReadmePrintsWhatItSays) { EXPECT_GT(PageRunner().run(fs::path(TERRODE_SOURCE_DIR) / "README.md"), 0); }
TEST(Pages, ValidationPrintsWhatItSays) { EXPECT_GT(PageRunner().run(fs::path(TERRODE_SOURCE_DIR) / "docs/validation.md"), 0); }

}  // namespace
}  // namespace terrode::docs
