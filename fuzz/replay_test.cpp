// Every input kept in fuzz/seeds/NAME/, seeds and former crashes alike, through its harness.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "harness.h"

namespace terrode::fuzz {
#define FUZZ_HARNESS(name, room) void name(const std::uint8_t* data, std::size_t size);
#include "harnesses.inc"
#undef FUZZ_HARNESS

namespace {

void replay(const std::string& name, void (*harness)(const std::uint8_t*, std::size_t)) {
  const std::filesystem::path folder = std::filesystem::path(TERRODE_SOURCE_DIR) / "fuzz" / "seeds" / name;
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().string());
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    harness(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    ++count;
  }
  EXPECT_GT(count, 0u) << "no seeds in " << folder;
}

#define FUZZ_HARNESS(name, room) \
  TEST(FuzzReplay, name) { replay(#name, name); }
#include "harnesses.inc"
#undef FUZZ_HARNESS

}  // namespace
}  // namespace terrode::fuzz
