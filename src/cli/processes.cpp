#include "cli/processes.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <map>
#include <thread>

#include "core/problem.h"
#include "core/system_error.h"

namespace terrode::cli {
namespace {

pid_t start(const Piece& piece) {
  std::vector<std::string> words = {"terrode"};
  words.insert(words.end(), piece.arguments.begin(), piece.arguments.end());
  std::vector<char*> argv;
  for (std::string& w : words) argv.push_back(w.data());
  argv.push_back(nullptr);
  const pid_t parent = getpid(), child = fork();
  if (child < 0) throw RunError(fmt::format("a process cannot be started: {}", system_error_text(errno)));
  if (child > 0) return child;
  // Only calls that are safe between fork and exec.
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  setpgid(0, 0);  // Ctrl-C goes to the parent, which ends its pieces
  const int log = open(piece.log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (log >= 0) dup2(log, 1), dup2(log, 2);
  execv("/proc/self/exe", argv.data());
  _exit(127);
}

}  // namespace

bool run_processes(const std::vector<Piece>& pieces, int together, const std::function<void(std::size_t, int)>& ended,
                   const std::function<bool()>& stop) {
  std::map<pid_t, std::size_t> running;
  std::size_t next = 0;
  const auto end_all = [&] {
    for (const auto& [pid, i] : running) kill(pid, SIGTERM);
    for (const auto& [pid, i] : running) {
      int status = 0;
      while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
      }
    }
    running.clear();
  };
  try {
    while (next < pieces.size() || !running.empty()) {
      if (stop()) {
        end_all();
        return false;
      }
      while (next < pieces.size() && running.size() < static_cast<std::size_t>(std::max(1, together))) {
        running[start(pieces[next])] = next;
        ++next;
      }
      bool any = false;
      for (auto it = running.begin(); it != running.end();) {
        int status = 0;
        const pid_t got = waitpid(it->first, &status, WNOHANG);
        if (got != it->first) {
          ++it;
          continue;
        }
        any = true;
        const std::size_t i = it->second;
        it = running.erase(it);
        if (!stop()) ended(i, WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status));
      }
      if (!any) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  } catch (...) {
    end_all();
    throw;
  }
  return true;
}

}  // namespace terrode::cli
