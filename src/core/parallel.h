// Independent pieces of work over a few threads, with the same result for any number of them.
#pragma once

#include <cstddef>
#include <functional>

namespace terrode {

// Calls work(i) once for each i in [0, count), on up to `threads` threads (0: all cores). Pieces may run in any order
// and must not share state; the first exception thrown (by smallest index) is rethrown after all have ended.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

// Number of threads that `threads` asks for: itself, or the number of cores when it is 0 or less.
int thread_count(int threads);

}  // namespace terrode
