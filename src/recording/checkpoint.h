// The state of unfinished work, kept in the group /checkpoint of a result file.
//
// A checkpoint is written with everything else by write_atomically(): at each moment the file on disk is a whole one,
// with the results and the state of the same moment. What was killed goes on from the state, bit for bit.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "recording/hdf5_file.h"
#include "recording/recording.h"

namespace terrode::recording {

struct Checkpoint {
  std::string work;  // version, scenario, seed, ...: taken up only where this is equal
  std::map<std::string, std::vector<double>> numbers;
  std::map<std::string, std::vector<std::uint8_t>> bytes;

  // A part by its name. Throw InputError where it is missing.
  const std::vector<double>& number(const std::string& name) const;
  const std::vector<std::uint8_t>& byte(const std::string& name) const;
  // The samples of a run; a run is taken out into channels of the same names and units in the same order. Throws
  // InputError where the numbers do not fit.
  void put_samples(const Run& run);
  void take_samples(Run& run) const;
};

void write_checkpoint(Hdf5File& file, const Checkpoint& checkpoint);
// Nothing where the file has none: its work had ended. Throws InputError where it is damaged (a digest is kept).
std::optional<Checkpoint> read_checkpoint(const Hdf5File& file);

// When to write again: `seconds` of wall time after the last write ended, so that a slow disk does not take all of it.
class Regularly {
 public:
  explicit Regularly(double seconds) : seconds_(seconds), last_(Clock::now()) {}
  bool due() const { return std::chrono::duration<double>(Clock::now() - last_).count() >= seconds_; }
  void done() { last_ = Clock::now(); }

 private:
  using Clock = std::chrono::steady_clock;
  double seconds_;
  Clock::time_point last_;
};

}  // namespace terrode::recording
