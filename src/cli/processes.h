// This program once more, as processes of its own: a crash ends one piece of work, not the whole.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace terrode::cli {

struct Piece {
  std::vector<std::string> arguments;  // after the program's name
  std::string log;                     // file for what it says
};

// Runs every piece, up to `together` at a time. `ended(i, status)` is called as each ends, with its exit status, or -N
// where signal N ended it; pieces that the interruption ended are not reported. Once stop() is true the running pieces
// are ended and false is returned. Throws RunError where a process cannot be started.
bool run_processes(const std::vector<Piece>& pieces, int together, const std::function<void(std::size_t, int)>& ended,
                   const std::function<bool()>& stop);

}  // namespace terrode::cli
