// A short random run of each harness in the ordinary build: the inputs kept in fuzz/seeds/, changed at random, 200 of each
// harness (as many as go into TERRODE_FUZZ_SECONDS where that is set; others with TERRODE_FUZZ_SEED). It finds crashes, exceptions that no reader may throw,
// inputs that take longer than 60 s or more than 4 GiB. It knows nothing of coverage and is blind to what sanitizers see:
// tools/fuzz is the real thing. An input that fails is left in the folder of the build, in fuzz-findings/.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/random.h"
#include "../tests/sanitized.h"
#include "harness.h"

namespace terrode::fuzz {
#define FUZZ_HARNESS(name, room) void name(const std::uint8_t* data, std::size_t size);
#include "harnesses.inc"
#undef FUZZ_HARNESS

namespace {

constexpr std::size_t kLargest = 65536;
constexpr std::uint64_t kInputs = 200;  // the same on every machine: what tools/test says must not depend on its speed
constexpr unsigned kSlow = 60;  // s, on a busy machine

// What is being read, for the handler of a signal to write down.
struct Current {
  char file[512] = "";
  const char* data = nullptr;
  std::size_t size = 0;
};
Current current;

void write_down() {
  const int fd = ::open(current.file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  for (std::size_t done = 0; fd >= 0 && done < current.size;) {
    const ssize_t n = ::write(fd, current.data + done, current.size - done);
    if (n <= 0) break;
    done += static_cast<std::size_t>(n);
  }
  if (fd >= 0) ::close(fd);
}

extern "C" void on_signal(int number) {
  write_down();
  const char text[] = "\nThe input that failed is kept in fuzz-findings/ of the build folder.\n";
  if (::write(STDERR_FILENO, text, sizeof text - 1) < 0) ::_exit(3);
  ::signal(number, SIG_DFL);
  ::raise(number);
}

std::vector<std::string> seeds(const std::string& name) {
  std::vector<std::string> paths, all;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(TERRODE_SOURCE_DIR) / "fuzz" / "seeds" / name))
    paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) {
    std::ifstream in(path, std::ios::binary);
    all.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return all;
}

void change(std::string& s, const std::vector<std::string>& all, Random& r) {
  const auto place = [&](std::size_t room) { return r.below(s.size() + 1 - std::min(room, s.size())); };
  const auto length = [&](std::size_t from) { return r.below(std::min<std::size_t>(s.size() - from, 64) + 1); };
  const std::size_t at = place(0);
  switch (r.below(9)) {
    case 0:
      if (at < s.size()) s[at] = static_cast<char>(s[at] ^ (1 << r.below(8)));
      break;
    case 1:
      if (at < s.size()) s[at] = static_cast<char>(r.below(256));
      break;
    case 2: {  // a number where there was one, as binary
      const std::uint32_t odd[] = {0, 1, 0xffffffff, 0x7fffffff, 0x80000000, 0x10000, 0x7ff00000, 0xfffffff0, static_cast<std::uint32_t>(r.next())};
      const std::uint32_t x = odd[r.below(std::size(odd))];
      const std::size_t from = place(4);
      if (from + 4 <= s.size()) s.replace(from, 4, reinterpret_cast<const char*>(&x), 4);
      break;
    }
    case 3: {  // and as text
      const char* odd[] = {"0", "-1", "1e308", "-1e-308", ".nan", ".inf", "99999999999", "0x10", "1e", "''", "~", "[", "{", "&a", "*a", ": ", "- ", "\n", "\t", "\"", "#", "m/s", "%"};
      std::size_t end = at;
      while (end < s.size() && (std::isdigit(static_cast<unsigned char>(s[end])) != 0 || s[end] == '.' || s[end] == 'e')) ++end;
      s.replace(at, end - at, odd[r.below(std::size(odd))]);
      break;
    }
    case 4: s.erase(at, length(at)); break;
    case 5: s.insert(place(0), s.substr(at, length(at))); break;
    case 6: {  // a piece of another input
      const std::string& other = all[r.below(all.size())];
      const std::size_t from = r.below(other.size() + 1);
      s.insert(at, other.substr(from, r.below(256)));
      break;
    }
    case 7:
      if (r.below(4) == 0) s.resize(at);
      break;
    default: s.insert(at, 1 + r.below(8), static_cast<char>(r.below(256)));
  }
  s.resize(std::min(s.size(), kLargest));
}

double number_of(const char* variable, double otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::atof(text) : otherwise;
}

void mutate(const std::string& name, void (*harness)(const std::uint8_t*, std::size_t)) {
  const std::vector<std::string> all = seeds(name);
  ASSERT_FALSE(all.empty());
  const std::filesystem::path folder = std::filesystem::path(TERRODE_BINARY_DIR) / "fuzz-findings";
  std::filesystem::create_directories(folder);
  fmt::format_to_n(current.file, sizeof current.file - 1, "{}", (folder / name).string());
  if (!terrode::kSanitized) {
    const rlimit memory{rlim_t{4} << 30, RLIM_INFINITY};
    setrlimit(RLIMIT_AS, &memory);
  }
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGALRM}) ::signal(number, on_signal);
  const double seconds = number_of("TERRODE_FUZZ_SECONDS", 0.0);
  const auto seed = static_cast<std::uint64_t>(number_of("TERRODE_FUZZ_SEED", 1.0));
  const auto begin = std::chrono::steady_clock::now();
  std::uint64_t count = 0;
  do {
    Random random = Random::stream(seed, count++);
    std::string input = all[random.below(all.size())];
    for (std::size_t k = 1 + random.below(8); k > 0; --k) change(input, all, random);
    current.data = input.data();
    current.size = input.size();
    ::alarm(kSlow);
    try {
      harness(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
    } catch (const std::exception& e) {
      write_down();
      ADD_FAILURE() << "input " << count << " of seed " << seed << ", kept as " << current.file << ": " << e.what();
      break;
    }
  } while (seconds > 0.0 ? std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() < seconds : count < kInputs);
  ::alarm(0);
  EXPECT_GT(count, 3u);
  std::printf("%s: %llu inputs\n", name.c_str(), static_cast<unsigned long long>(count));
}

#define FUZZ_HARNESS(name, room) \
  TEST(FuzzMutate, name) { mutate(#name, name); }
#include "harnesses.inc"
#undef FUZZ_HARNESS

}  // namespace
}  // namespace terrode::fuzz
