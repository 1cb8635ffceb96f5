#include "cli/terminal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <mutex>

#include "core/environment.h"
#include "core/system_error.h"
#include "core/units.h"

namespace terrode::cli {
namespace {

volatile sig_atomic_t stop_signals = 0;

extern "C" void on_interrupt(int) {
  stop_signals = stop_signals + 1;
  if (stop_signals > 1) _exit(130);
}

std::string duration(double seconds) {
  const long s = std::lround(seconds);
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{}:{:02} min", s / 60, s % 60);
  return fmt::format("{}:{:02} h", s / 3600, s / 60 % 60);
}

class Meter {
 public:
  Meter() : terminal_(terminal_messages()), start_(Clock::now()), shown_(start_) {}
  ~Meter() {
    if (drawn_) std::fputs("\r\033[K", stderr);
  }
  void report(double fraction, const std::string& what) {
    const std::lock_guard lock(mutex_);
    const auto now = Clock::now();
    const double since = std::chrono::duration<double>(now - shown_).count();
    if (since < (terminal_ ? 0.1 : 5.0)) return;
    shown_ = now;
    fraction = std::clamp(fraction, 0.0, 1.0);
    // Work that was begun in an earlier run, and what comes before the work proper, do not count as its pace.
    if (first_ < 0 && fraction > 1e-6) {
      first_ = fraction;
      start_ = now;
    }
    const double elapsed = std::chrono::duration<double>(now - start_).count(), done = fraction - first_;
    const std::string left = first_ >= 0 && done > 1e-6 && fraction < 1 ? duration(elapsed * (1 - fraction) / done) + " left" : "";
    if (terminal_) {
      const auto full = static_cast<std::size_t>(std::lround(fraction * 24));
      std::fprintf(stderr, "\r\033[K[%s%s] %3.0f %%  %s  %s", std::string(full, '#').c_str(), std::string(24 - full, '.').c_str(),
                   100 * fraction, left.c_str(), what.substr(0, 40).c_str());
      drawn_ = true;
    } else {
      std::fprintf(stderr, "%3.0f %%  %s  %s\n", 100 * fraction, left.c_str(), what.c_str());
    }
    std::fflush(stderr);
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::mutex mutex_;
  bool terminal_, drawn_ = false;
  Clock::time_point start_, shown_;
  double first_ = -1;  // fraction at which the measured work began
};

bool numeric(const std::string& cell) { return cell.empty() || cell == "-" || parse_number(cell.substr(0, cell.find(' '))).has_value(); }

// Columns a text takes on the screen (UTF-8 continuation bytes take none).
std::size_t columns(const std::string& s) {
  return static_cast<std::size_t>(std::count_if(s.begin(), s.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

}  // namespace

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string json_text(const Json& document, int indent) { return document.dump(indent, ' ', false, Json::error_handler_t::replace); }

void print_json(const Json& document) {
  const std::string text = json_text(document, 2) + "\n";
  std::fwrite(text.data(), 1, text.size(), stdout);
}

Json problem_json(const Problem& p) {
  return {{"file", p.file}, {"line", p.line}, {"column", p.column}, {"key", p.key}, {"message", p.message}, {"expected", p.expected}};
}

Json error_json(const std::string& what, const Problems& problems) {
  Json out = {{"error", what}};
  if (!problems.empty()) {
    out["problems"] = Json::array();
    for (const Problem& p : problems) out["problems"].push_back(problem_json(p));
  }
  return out;
}

void note(const Common& common, const std::string& text) {
  if (!common.quiet) std::fprintf(stderr, "note: %s\n", text.c_str());
}

bool terminal_messages() {
  const std::string term = environment("TERM");
  return isatty(STDERR_FILENO) && !term.empty() && term != "dumb";
}

bool colour(int file_descriptor) {
  return isatty(file_descriptor) && environment("NO_COLOR").empty();
}

Progress show_progress(const Common& common) {
  Progress out;
  out.stop_requested = [] { return interrupted(); };
  if (common.quiet) return out;
  const auto meter = std::make_shared<Meter>();
  out.report = [meter](double fraction, const std::string& what) { meter->report(fraction, what); };
  return out;
}

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // A full disk or a limit on file size is to be an error of the write, not the end of the program; so is a closed pipe.
  signal(SIGXFSZ, SIG_IGN);
  signal(SIGPIPE, SIG_IGN);
}

bool interrupted() { return stop_signals > 0; }

void write_text_atomically(const std::string& path, const std::string& text) {
  const auto fail = [&](const char* what) {
    return RunError(fmt::format("{}: {}: {}", path, what, system_error_text(errno)));
  };
  struct stat status {};
  const bool special = stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode);
  const std::string temporary = special ? path : fmt::format("{}.{}.tmp", path, getpid());
  const int file = open(temporary.c_str(), special ? O_WRONLY : (O_WRONLY | O_CREAT | O_TRUNC), 0666);
  if (file < 0) throw fail("cannot be written");
  std::size_t done = 0;
  bool good = true;
  while (good && done < text.size()) {
    const ssize_t n = ::write(file, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    good = n > 0;
    if (good) done += static_cast<std::size_t>(n);
  }
  if (good && !special) good = fsync(file) == 0;
  const int error = errno;
  if (close(file) != 0) good = false;
  if (!good) {
    if (!special) unlink(temporary.c_str());
    if (error) errno = error;
    throw fail("cannot be written");
  }
  if (!special && std::rename(temporary.c_str(), path.c_str()) != 0) {
    unlink(temporary.c_str());
    throw fail("cannot be replaced");
  }
}

std::string aligned(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> width;
  std::vector<bool> right;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      if (width.size() <= c) {
        width.push_back(0);
        right.push_back(true);
      }
      width[c] = std::max(width[c], columns(rows[r][c]));
      if (r > 0 && !numeric(rows[r][c])) right[c] = false;
    }
  }
  std::string out;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string pad(width[c] - columns(row[c]), ' ');
      line += (c ? "  " : "") + (right[c] ? pad + row[c] : row[c] + pad);
    }
    while (!line.empty() && line.back() == ' ') line.pop_back();
    out += line + "\n";
  }
  return out;
}

}  // namespace terrode::cli
