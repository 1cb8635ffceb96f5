#include "core/utf8.h"

#include <gtest/gtest.h>

#include <string>

namespace terrode {
namespace {

TEST(Utf8, CharactersOfEveryLengthAreValid) {
  EXPECT_EQ(find_invalid_utf8(""), std::string_view::npos);
  EXPECT_EQ(find_invalid_utf8("slip \xc2\xb0 \xe2\x82\xac \xf0\x9f\x9b\x9e \xef\xbf\xbf \xf4\x8f\xbf\xbf \xed\x9f\xbf"), std::string_view::npos);
}

TEST(Utf8, FindsWhereATextIsNot) {
  struct Text {
    std::string text;
    std::size_t at;
  };
  for (const Text& c : {Text{"R\xe4" "der", 1},        // Latin-1
                        Text{"ab\xf4>\n", 2},          // breaks off within a character
                        Text{"ab\xe2\x82", 2},         // ends within one
                        Text{"\xc0\xaf", 0},           // overlong in two bytes
                        Text{"a\xe0\x9f\xbf", 1},      // in three
                        Text{"a\xf0\x8f\xbf\xbf", 1},  // in four
                        Text{"\xed\xa0\x80", 0},       // a surrogate
                        Text{"\xf4\x90\x80\x80", 0},   // beyond the last character
                        Text{"\xf0\x9f\x9b>", 0}, Text{"a\x80", 1}, Text{"\xff", 0}})
    EXPECT_EQ(find_invalid_utf8(c.text), c.at) << c.text;
}

TEST(Utf8, CountsLines) {
  EXPECT_EQ(line_of("a\nb\nc", 0), 1);
  EXPECT_EQ(line_of("a\nb\nc", 4), 3);
  EXPECT_EQ(line_of("a\n", 9), 2);
}

}  // namespace
}  // namespace terrode
