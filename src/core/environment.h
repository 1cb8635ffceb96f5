// What the caller's shell says.
#pragma once

#include <string>

namespace terrode {

// An environment variable; "" where it is not set. From any thread: nothing here changes the environment.
std::string environment(const char* name);

}  // namespace terrode
