// Libraries that read binary files of others were not written for files that deceive: some make them crash or ask for all
// of the memory.
#pragma once

#include <functional>
#include <string>

namespace terrode::recording {

// Tries a reading in a child process, with at most 4 GiB more memory and half a minute of processor time. Throws
// InputError naming the file where the child dies of it; what the reading itself throws there is not looked at: do it again
// here. Costs the reading twice.
void try_in_child(const std::string& path, const std::function<void()>& read);

}  // namespace terrode::recording
