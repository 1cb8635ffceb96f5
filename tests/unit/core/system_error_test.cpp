#include "core/system_error.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

#include "core/parallel.h"

namespace terrode {
namespace {

TEST(SystemError, SaysWhatTheSystemSays) {
  EXPECT_EQ(system_error_text(ENOENT), "No such file or directory");
  EXPECT_EQ(system_error_text(ENOSPC), "No space left on device");
}

// The numbers the system has no words for are those where the text is made anew, in memory that std::strerror shares.
TEST(SystemError, ThreadsDoNotShareTheText) {
  std::vector<std::string> texts(1000);
  parallel_for(texts.size(), 3, [&](std::size_t i) { texts[i] = system_error_text(100000 + static_cast<int>(i)); });
  for (std::size_t i = 0; i < texts.size(); ++i)
    EXPECT_NE(texts[i].find(std::to_string(100000 + i)), std::string::npos) << texts[i];
}

}  // namespace
}  // namespace terrode
