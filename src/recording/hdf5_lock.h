// The one lock around the HDF5 library, which libmatio uses too.
#pragma once

#include <mutex>

namespace terrode::recording {
std::recursive_mutex& hdf5_lock();
}  // namespace terrode::recording
