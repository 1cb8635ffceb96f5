// Small statistics that several rooms need.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace terrode {

// The middle value; of an even count the upper of the two. `if_empty` where there is none. Takes a copy to reorder.
inline double median(std::vector<double> v, double if_empty = 0.0) {
  if (v.empty()) return if_empty;
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

}  // namespace terrode
