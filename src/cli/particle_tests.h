// `terrode run` on a file of soil tests on particles.
#pragma once

#include <string>

#include "cli/commands.h"

namespace terrode::cli {

// Runs the tests of the file that are not yet in `output`, fits Eqs. 24 and 25 to them, prints and writes the result:
// `output` HDF5, `csv` all curves with their means, `soil` a soil file; each may be empty. `overwrite`: nothing of what `output` holds is
// used.
void run_particle_tests(const std::string& path, const std::string& output, const std::string& csv, const std::string& soil,
                        bool overwrite, Common& common);

}  // namespace terrode::cli
