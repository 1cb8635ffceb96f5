#pragma once

#include <string>

namespace terrode::report {

// The text as a JSON string that may stand inside a <script>: no "<" survives.
std::string json_text(const std::string& text);

}  // namespace terrode::report
