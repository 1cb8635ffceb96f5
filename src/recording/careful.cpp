#include "recording/careful.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "core/problem.h"

namespace terrode::recording {

namespace {

constexpr rlim_t kMoreMemory = rlim_t{4} << 30;
constexpr rlim_t kSeconds = 30;

// Address space that the process has now; 0 where the system does not tell.
rlim_t address_space() {
  unsigned long pages = 0;
  if (std::FILE* f = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(f, "%lu", &pages) != 1) pages = 0;
    std::fclose(f);
  }
  return rlim_t{pages} * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

void lower(__rlimit_resource what, rlim_t to) {
  rlimit limit{};
  if (getrlimit(what, &limit) != 0) return;
  if (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur > to) limit.rlim_cur = to;
  setrlimit(what, &limit);
}

}  // namespace

void try_in_child(const std::string& path, const std::function<void()>& read) {
  const rlim_t now = address_space();
  std::fflush(stdout);
  std::fflush(stderr);
  const pid_t child = fork();
  if (child < 0) return;  // no room for a child: read without
  if (child == 0) {
    for (const int s : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGXCPU, SIGINT, SIGTERM}) signal(s, SIG_DFL);
    lower(RLIMIT_CORE, 0);
    lower(RLIMIT_CPU, kSeconds);
    if (now > 0) lower(RLIMIT_AS, now + kMoreMemory);
    if (std::freopen("/dev/null", "w", stderr) == nullptr) _exit(0);
    try {
      read();
    } catch (...) {
    }
    _exit(0);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  const bool died = WIFSIGNALED(status) && WTERMSIG(status) != SIGINT && WTERMSIG(status) != SIGTERM && WTERMSIG(status) != SIGKILL;
  if (died || (WIFEXITED(status) && WEXITSTATUS(status) != 0))
    throw InputError(Problem{path, 0, 0, {}, "is damaged: the library that reads such files fails on it", "a file that it can read"});
}

}  // namespace terrode::recording
