// Files in which the unfinished points of a sweep are kept beside its result file, so that the same command goes on
// with them after the program was ended: OUT.h5.unfinished/, one file a point.
#pragma once

#include <memory>
#include <string>

#include "vehicle/slip_sweep.h"

namespace terrode::cli {

class Checkpoints {
 public:
  // `work` is all that decides the numbers of a point but its condition: what is there of other work is left aside.
  // Nothing is written before the first saving.
  Checkpoints(const std::string& result_file, const std::string& method, const std::string& work, double seconds);
  // Throws RunError where the folder or a file cannot be written; what cannot be read counts as not there.
  vehicle::RunMemory memory() const;
  // How many points were gone on with.
  int resumed() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace terrode::cli
