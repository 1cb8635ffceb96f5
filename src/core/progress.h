// How long work tells how far it is. Rooms take a Progress&; programs decide how it looks.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace terrode {

// `report(fraction in 0..1, what)` may be called from any thread, often; the receiver thins it out.
// `stop_requested()` is asked between pieces of work: when true, finish what is being written and throw Interrupted.
struct Progress {
  std::function<void(double fraction, const std::string& what)> report = [](double, const std::string&) {};
  std::function<bool()> stop_requested = [] { return false; };
};

// Thrown by long work that was asked to stop; its message says what is kept and how to go on.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace terrode
