#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace terrode {

int thread_count(int threads) {
  if (threads > 0) return threads;
  return static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr first;
  std::size_t first_index = count;
  const auto loop = [&] {
    for (;;) {
      const std::size_t i = next.fetch_add(1);
      if (i >= count) return;
      try {
        work(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (i < first_index) {
          first_index = i;
          first = std::current_exception();
        }
      }
    }
  };
  const auto n = std::min<std::size_t>(static_cast<std::size_t>(thread_count(threads)), count);
  std::vector<std::thread> pool;
  try {
    pool.reserve(n);
    for (std::size_t t = 1; t < n; ++t) pool.emplace_back(loop);
  } catch (const std::exception&) {
    // The system gives no more threads: those that are there do the work.
  }
  loop();
  for (std::thread& t : pool) t.join();
  if (first) std::rethrow_exception(first);
}

struct Crew::State {
  std::vector<std::thread> pool;
  std::atomic<unsigned> round{0};      // raised to start a round
  std::atomic<int> busy{0};            // members that have not finished this round
  std::atomic<bool> ending{false};
  const std::function<void(std::size_t)>* work = nullptr;

  // What a thread takes first: the same part of the work in every round, so that what it works on stays in its own cache.
  struct alignas(64) Share {
    std::atomic<std::size_t> next{0};
    std::size_t end = 0;
  };
  std::vector<Share> shares;

  void take(std::size_t self) {
    for (std::size_t k = 0; k < shares.size(); ++k) {
      Share& share = shares[(self + k) % shares.size()];
      for (std::size_t i = share.next.fetch_add(1); i < share.end; i = share.next.fetch_add(1)) (*work)(i);
    }
  }
};

namespace {
// A round is short, so its ends are awaited actively for some microseconds before the thread sleeps.
template <class T>
void await_change(const std::atomic<T>& value, T old) {
  for (int k = 0; k < 4000; ++k) {
    if (value.load(std::memory_order_acquire) != old) return;
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  value.wait(old, std::memory_order_acquire);
}
}  // namespace

Crew::Crew(int threads) : state_(std::make_unique<State>()) {
  State* s = state_.get();
  const auto wanted = static_cast<std::size_t>(thread_count(threads));
  s->shares = std::vector<State::Share>(wanted);
  const auto member = [s](std::size_t self) {
    unsigned seen = 0;
    for (;;) {
      await_change(s->round, seen);
      if (s->ending.load()) return;
      seen = s->round.load(std::memory_order_acquire);
      s->take(self);
      if (s->busy.fetch_sub(1, std::memory_order_acq_rel) == 1) s->busy.notify_one();
    }
  };
  try {
    for (std::size_t t = 1; t < wanted; ++t) s->pool.emplace_back(member, t);
  } catch (const std::exception&) {
    // As above: fewer hands, the same result.
  }
}

Crew::~Crew() {
  state_->ending.store(true);
  state_->round.fetch_add(1);
  state_->round.notify_all();
  for (std::thread& t : state_->pool) t.join();
}

int Crew::threads() const { return static_cast<int>(state_->pool.size()) + 1; }

void Crew::run(std::size_t count, const std::function<void(std::size_t)>& work) {
  State& s = *state_;
  if (s.pool.empty() || count < 2) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  s.work = &work;
  for (std::size_t t = 0; t < s.shares.size(); ++t) {
    s.shares[t].next.store(count * t / s.shares.size());
    s.shares[t].end = count * (t + 1) / s.shares.size();
  }
  s.busy.store(static_cast<int>(s.pool.size()));
  s.round.fetch_add(1, std::memory_order_release);
  s.round.notify_all();
  s.take(0);
  for (int left = s.busy.load(std::memory_order_acquire); left != 0; left = s.busy.load(std::memory_order_acquire))
    await_change(s.busy, left);
}

}  // namespace terrode
