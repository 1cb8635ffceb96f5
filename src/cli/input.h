// How commands load what they are given.
#pragma once

#include <string>

#include "cli/commands.h"
#include "scenario/scenario.h"

namespace terrode::cli {

// A scenario, or a recording as a scenario; soil parameters that a recording does not believe anything about come from
// its soil tests. Notes are printed. Throws InputError.
scenario::Scenario load_input(const std::string& path, const Common& common);

}  // namespace terrode::cli
