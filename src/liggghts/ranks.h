// The processes that `mpirun` starts: rank 0 runs the program, the others lend it their processors.
#pragma once

#include <optional>

namespace terrode::liggghts {

// Whether this build has LIGGGHTS and MPI.
bool available();

// To be called first of all. In a process that mpirun started as rank 1 or higher: does what rank 0 asks for until that
// ends, and returns the exit status; neither prints nor writes results. Elsewhere: nothing, at once.
std::optional<int> serve();

}  // namespace terrode::liggghts
