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
  struct Case {
    std::string text;
    std::size_t at;
  };
  for (const Case& c : {Case{"R\xe4" "der", 1},        // Latin-1
                        Case{"ab\xf4>\n", 2},          // breaks off within a character
                        Case{"ab\xe2\x82", 2},         // ends within one
                        Case{"\xc0\xaf", 0},           // overlong in two bytes
                        Case{"a\xe0\x9f\xbf", 1},      // in three
                        Case{"a\xf0\x8f\xbf\xbf", 1},  // in four
                        Case{"\xed\xa0\x80", 0},       // a surrogate
                        Case{"\xf4\x90\x80\x80", 0},   // beyond the last character
                        Case{"\xf0\x9f\x9b>", 0}, Case{"a\x80", 1}, Case{"\xff", 0}})
    EXPECT_EQ(find_invalid_utf8(c.text), c.at) << c.text;
}

TEST(Utf8, CountsLines) {
  EXPECT_EQ(line_of("a\nb\nc", 0), 1);
  EXPECT_EQ(line_of("a\nb\nc", 4), 3);
  EXPECT_EQ(line_of("a\n", 9), 2);
}

}  // namespace
}  // namespace terrode
