// A strict reader of YAML: every value has its place in the file, a key that is not known or given twice is a problem,
// numbers carry units, and all problems of a file are said at once.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/problem.h"

namespace terrode::scenario {

// What a file may hold at most; beyond it reading stops with a problem. Aliases count as often as they are used.
struct ReadLimits {
  std::size_t bytes = 4u << 20;
  int depth = 32;
  std::size_t nodes = 200000;
};

// One value of a YAML document and where it stands (line and column count from 1; 0 for a value made by a program).
struct Node {
  enum class Kind { null, scalar, sequence, map };
  struct Entry;

  Kind kind = Kind::null;
  std::string text;             // of a scalar
  bool quoted = false;          // the scalar stood in quotes
  int line = 0, column = 0;
  std::vector<Node> items;      // of a sequence
  std::vector<Entry> entries;   // of a map, in the order of the file
  std::size_t size = 1;         // number of nodes below and including this one

  static Node scalar(std::string text);
  static Node map();
  static Node sequence();

  // The value of a key of this map; null where absent (or where this is no map).
  const Node* find(const std::string& key) const;
  // The value at a path such as "soil.bekker.k" or "runs[2].file"; null where there is none.
  const Node* at(const std::string& path) const;
  // Sets a key of this map (appends or replaces) and returns its value.
  Node& set(const std::string& key, Node value);
};

struct Node::Entry {
  std::string key;
  int line = 0, column = 0;  // of the key
  Node value;
};

// A file being read: its name for messages, what is wrong so far, and notes that are no errors.
struct Source {
  std::string file;
  Problems problems;
  std::vector<std::string> notes;

  void problem(const Node& where, const std::string& key, const std::string& message, const std::string& expected = {});
  void note(const Node& where, const std::string& key, const std::string& message);
};

// Reads a whole file, at most `limit` bytes. Throws InputError naming the file and the system's reason.
std::string read_text_file(const std::string& path, std::size_t limit);

// Parses one YAML document. `file` is the name used in messages. Throws InputError (syntax with its line, key given
// twice, more than the limits, a tag or a second document); never an exception of the YAML library.
Node parse_yaml(const std::string& text, const std::string& file, const ReadLimits& limits = {});

// read_text_file and parse_yaml in one.
Node read_yaml(const std::string& path, const ReadLimits& limits = {});

// Every file that a text of the tree names (relative to `folder`) and that is there, with a digest of its bytes, one a
// line: two trees with equal text and equal lines mean the same.
std::string named_files(const Node& node, const std::string& folder);

// Writes a node as block YAML that parse_yaml reads back to the same values.
std::string to_yaml(const Node& node);

// Which values of a number are right.
struct Range {
  double lo = -std::numeric_limits<double>::infinity();
  double hi = std::numeric_limits<double>::infinity();
  bool lo_open = false, hi_open = false;

  bool contains(double x) const { return (lo_open ? x > lo : x >= lo) && (hi_open ? x < hi : x <= hi); }
  // "a number above 0 m", "a number from -1 to 1"; "a number" alone where everything is right.
  std::string text(const std::string& unit) const;
};
inline Range any_number() { return {}; }
inline Range above(double lo) { return {lo, std::numeric_limits<double>::infinity(), true, false}; }
inline Range at_least(double lo) { return {lo, std::numeric_limits<double>::infinity(), false, false}; }
inline Range from_to(double lo, double hi) { return {lo, hi, false, false}; }
inline Range between(double lo, double hi) { return {lo, hi, true, true}; }

// A scalar as a finite number in the SI unit `unit`; a bare number is in SI, text carries its unit. On anything else
// nothing, and a problem for `key`.
std::optional<double> read_number(const Node& node, const std::string& key, const std::string& unit, const Range& range,
                                  Source& source);
std::optional<long> read_integer(const Node& node, const std::string& key, long lo, long hi, Source& source);
std::optional<bool> read_flag(const Node& node, const std::string& key, Source& source);
std::optional<std::string> read_text(const Node& node, const std::string& key, Source& source);
std::optional<std::string> read_choice(const Node& node, const std::string& key, const std::vector<std::string>& choices,
                                       Source& source);
// A list of numbers; a single number is a list of one.
std::vector<double> read_numbers(const Node& node, const std::string& key, const std::string& unit, const Range& range,
                                 Source& source);

// The path of a file that the text `name` at `where` names, relative to the folder of source.file. A path that leads out
// of that folder (by "..", as an absolute path or by a link) is noted, one to a device or a pipe is a problem.
std::string named_path(const std::string& name, const Node& where, const std::string& key, Source& source);

// Sets `out` where there is a value: how what a file leaves out keeps its default.
template <class T, class V>
void set_if(T& out, const std::optional<V>& value) {
  if (value) out = static_cast<T>(*value);
}

// Reads one map key by key. Each getter returns nothing when the key is absent or wrong (then a problem was added), and
// remembers that the key is known; finish() says what is left over.
class MapReader {
 public:
  enum class Unknown {
    error,  // every key left over is a problem, with the nearest known key
    keep,   // a key one letter away from a known one is a problem, others become a note
  };

  // `path` is the key of this map in messages ("soil.bekker"), "" for the whole file. A node that is no map is a problem.
  MapReader(const Node& node, std::string path, Source& source, Unknown unknown = Unknown::error);

  // The value, or null when absent. A key without a value is a problem, and null.
  const Node* find(const std::string& key);
  // As find; absent is a problem.
  const Node* need(const std::string& key);
  bool has(const std::string& key);
  // Keys that may stand here and that somebody else reads.
  void know(const std::string& key) { known_.insert(key); }

  std::optional<double> number(const std::string& key, const std::string& unit, const Range& range = {});
  std::optional<long> integer(const std::string& key, long lo, long hi);
  std::optional<bool> flag(const std::string& key);
  std::optional<std::string> text(const std::string& key);
  std::optional<std::string> choice(const std::string& key, const std::vector<std::string>& choices);
  std::vector<double> numbers(const std::string& key, const std::string& unit, const Range& range = {});
  // A map below this one, with the same rule for unknown keys; nothing when absent or no map.
  std::optional<MapReader> section(const std::string& key);
  // The items of a list below this one, each with its key in messages ("runs[3]"); empty when absent or no list.
  std::vector<std::pair<std::string, const Node*>> items(const std::string& key);

  // Says which keys are left over; returns them (for Unknown::keep, to keep).
  std::vector<std::pair<std::string, const Node*>> finish();

  std::string key(const std::string& name) const { return path_.empty() ? name : path_ + "." + name; }
  Source& source() { return source_; }
  const Node& node() const { return node_; }

 private:
  const Node& node_;
  std::string path_;
  Source& source_;
  Unknown unknown_;
  std::set<std::string> known_;
};

// Fills in file, line and column of problems whose keys are paths below `prefix` in `root` (as those of a struct's
// validate()), and puts the prefix before the key.
void locate(Problems& problems, const Node& root, const std::string& file, const std::string& prefix);

}  // namespace terrode::scenario
