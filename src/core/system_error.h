// The system's words for what went wrong.
#pragma once

#include <string>

namespace terrode {

// What the system says of an error number (errno): "No such file or directory". Unlike std::strerror it may be called from
// several threads at a time.
std::string system_error_text(int number);

}  // namespace terrode
