#include "core/system_error.h"

#include <cstring>

namespace terrode {
namespace {

// strerror_r returns the text in the GNU library, and whether it wrote the text into the buffer elsewhere.
[[maybe_unused]] std::string text_of(const char* text, const char*, int) { return text; }
[[maybe_unused]] std::string text_of(int failed, const char* buffer, int number) {
  return failed == 0 ? std::string(buffer) : "error " + std::to_string(number);
}

}  // namespace

std::string system_error_text(int number) {
  char buffer[256] = "";
  return text_of(strerror_r(number, buffer, sizeof buffer), buffer, number);
}

}  // namespace terrode
