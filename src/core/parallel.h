// Independent pieces of work over a few threads, with the same result for any number of them.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace terrode {

// Calls work(i) once for each i in [0, count), on up to `threads` threads (0: all cores). Pieces may run in any order
// and must not share state; the first exception thrown (by smallest index) is rethrown after all have ended.
void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

// Number of threads that `threads` asks for: itself, or the number of cores when it is 0 or less.
int thread_count(int threads);

// Threads that stay alive between calls, for loops that are called thousands of times a second. The work must not
// throw.
class Crew {
 public:
  explicit Crew(int threads);  // 0: all cores
  ~Crew();
  Crew(const Crew&) = delete;
  Crew& operator=(const Crew&) = delete;
  int threads() const;
  // Calls work(i) once for each i in [0, count), in any order, and returns when all are done.
  void run(std::size_t count, const std::function<void(std::size_t)>& work);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace terrode
