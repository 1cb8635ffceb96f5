// Reproducible random numbers: the same seed gives the same numbers on every machine and compiler.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrode {

// SplitMix64-seeded xoshiro256++ (Blackman & Vigna 2019) with its own normal deviates, because the distributions of
// the standard library differ between implementations.
class Random {
 public:
  explicit Random(std::uint64_t seed);
  std::uint64_t next();
  double uniform();                       // in [0, 1)
  double uniform(double lo, double hi);   // in [lo, hi)
  double normal();                        // mean 0, deviation 1 (polar method)
  std::size_t below(std::size_t n);       // in [0, n)
  // A generator for the i-th independent piece of work under this seed.
  static Random stream(std::uint64_t seed, std::uint64_t i);

 private:
  std::uint64_t s_[4];
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace terrode
