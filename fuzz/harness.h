// A fuzz harness: FUZZ(name) { ... } reads `data` and `size` and must come back, or throw InputError or RunError, for any
// bytes at all. Built with clang it is a libFuzzer program of its own (tools/fuzz); every build replays the inputs kept
// in fuzz/seeds/NAME/ (replay_test.cpp).
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "core/problem.h"

namespace terrode::fuzz {

// A file with these bytes, in a folder of this process, for readers that want a name. The same name is used again.
inline std::string as_file(const std::string& name, const std::uint8_t* data, std::size_t size) {
  static const std::string folder = [] {
    std::error_code error;
    const bool shared = std::filesystem::is_directory("/dev/shm", error);
    const std::string f = (shared ? "/dev/shm/terrode_fuzz_" : "/tmp/terrode_fuzz_") + std::to_string(::getpid());
    std::filesystem::create_directories(f, error);
    std::atexit([] {
      std::error_code ignored;
      std::filesystem::remove_all("/dev/shm/terrode_fuzz_" + std::to_string(::getpid()), ignored);
      std::filesystem::remove_all("/tmp/terrode_fuzz_" + std::to_string(::getpid()), ignored);
    });
    return f;
  }();
  const std::string path = folder + "/" + name;
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  for (std::size_t done = 0; fd >= 0 && done < size;) {
    const ssize_t n = ::write(fd, data + done, size - done);
    if (n <= 0) break;
    done += static_cast<std::size_t>(n);
  }
  if (fd >= 0) ::close(fd);
  return path;
}

}  // namespace terrode::fuzz

#ifdef TERRODE_LIBFUZZER
#define FUZZ_ENTRY(name)                                                                  \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {     \
    terrode::fuzz::name(data, size);                                                      \
    return 0;                                                                             \
  }
#else
#define FUZZ_ENTRY(name)
#endif

#define FUZZ(name)                                                                        \
  namespace terrode::fuzz {                                                               \
  static void read_##name(const std::uint8_t* data, std::size_t size);                    \
  void name(const std::uint8_t* data, std::size_t size) {                                 \
    try {                                                                                 \
      read_##name(data, size);                                                            \
    } catch (const InputError&) {                                                         \
    } catch (const RunError&) {                                                           \
    }                                                                                     \
  }                                                                                       \
  }                                                                                       \
  FUZZ_ENTRY(name)                                                                        \
  static void terrode::fuzz::read_##name(const std::uint8_t* data, std::size_t size)
