// Text from files is UTF-8.
#pragma once

#include <cstddef>
#include <string_view>

namespace terrode {

// Where the first byte stands that is no part of UTF-8 (RFC 3629: no overlong forms, no surrogates, nothing beyond U+10FFFF);
// npos where all are. Readers of others look beyond the end of a text that breaks off within a character.
std::size_t find_invalid_utf8(std::string_view text);

// Line of a byte, counted from 1.
int line_of(std::string_view text, std::size_t byte);

}  // namespace terrode
