// How findings are put into words.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "diagnosis/diagnose.h"

namespace terrode::diagnosis {

// "a, b or c".
std::string plural(const std::vector<std::string>& ids);

// "n1 = 0.4 +- 0.02, depth = 0.005 m": parameters of one effect with their deviations.
std::string strength_text(const std::map<std::string, Estimate>& parameters);

}  // namespace terrode::diagnosis
