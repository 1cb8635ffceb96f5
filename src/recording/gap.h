#pragma once

#include <limits>

namespace terrode::recording {

// What stands where a file leaves a value out.
inline constexpr double kGap = std::numeric_limits<double>::quiet_NaN();

}  // namespace terrode::recording
