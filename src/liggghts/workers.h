// Orders of rank 0 to the engines of all ranks, its own among them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "liggghts/engine.h"

namespace terrode::liggghts {

enum class Order : std::int32_t { commands, forget, set_moving, run, grains, quit };

// Rank 0's view of all ranks; starts MPI where that has not been done, and ends it and the other ranks with the program.
class Workers {
 public:
  static Workers& instance();
  int count() const { return ranks_; }

  // What Engine does, on every rank. Throws RunError with LIGGGHTS's message where it gives up.
  void commands(const std::string& lines);
  void forget();
  void set_moving(const MovingPart& part);
  std::vector<double> run(long steps, const std::vector<BodyMotion>& bodies);
  std::vector<double> grains();

 private:
  Workers();
  std::vector<double> perform(Order order, std::span<const char> data);
  int ranks_ = 1;
};

}  // namespace terrode::liggghts
