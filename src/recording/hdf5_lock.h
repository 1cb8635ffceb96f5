// The one lock around the HDF5 library, which libmatio uses too.
#pragma once

#include <cstdint>
#include <mutex>

namespace terrode::recording {
std::recursive_mutex& hdf5_lock();

// Whether a file of `file_bytes` can hold `count` values of `size` bytes: deflate packs at most 1032 times (RFC 1951: 258 bytes
// in two bits), and a small array may stand for its fill value. A file may declare any number and hold none of them.
constexpr bool could_be_stored(std::uint64_t count, std::uint64_t size, std::uint64_t file_bytes) {
  constexpr std::uint64_t small = std::uint64_t{16} << 20, largest_packing = 1032;
  if (size == 0 || count > (~std::uint64_t{0}) / size) return false;
  return count * size <= small || count * size / largest_packing <= file_bytes;
}
}  // namespace terrode::recording
