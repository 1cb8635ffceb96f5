// What can be wrong with an input, and how that is said.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace terrode {

// One thing wrong with one place of an input. `line` and `column` count from 1; 0 means "does not apply".
struct Problem {
  std::string file;
  int line = 0;
  int column = 0;
  std::string key;       // e.g. "wheel.radius"
  std::string message;   // what is wrong, with the value: "is -0.13 m"
  std::string expected;  // what would be right: "a length above 0"

  // `file:line:col: key: message, expected X`, parts that are empty left out.
  std::string text() const;
};

using Problems = std::vector<Problem>;

// Thrown where an input (file, command line, parameter struct) is wrong. Programs end with exit status 2.
class InputError : public std::runtime_error {
 public:
  explicit InputError(Problems problems);
  explicit InputError(Problem problem) : InputError(Problems{std::move(problem)}) {}
  explicit InputError(const std::string& message) : InputError(Problem{{}, 0, 0, {}, message, {}}) {}
  const Problems& problems() const { return problems_; }

 private:
  Problems problems_;
};

// Thrown where the input was right and the work failed (diverged, disk full). Programs end with exit status 1.
class RunError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Throws InputError when there are problems; otherwise does nothing.
void throw_if_any(const Problems& problems);

// Appends a problem unless the number is finite and `ok`. `key` is the field's name, `unit` its SI unit.
void require(Problems& problems, const std::string& key, double value, const char* unit, bool ok,
             const std::string& expected);

// The known word nearest to `word` by edit distance, or "" when none is near (more than a third of its length off).
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

// Number of single-character edits (insert, delete, replace, swap of neighbours) between two words.
int edit_distance(const std::string& a, const std::string& b);

}  // namespace terrode
