#include "scenario/reader.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <sstream>

#include "core/system_error.h"
#include "core/units.h"
#include "core/utf8.h"

namespace terrode::scenario {
namespace {

std::string shortened(const std::string& text) {
  std::string out;
  for (const char c : text.substr(0, 60)) out += (c == '\n' || c == '\r' || c == '\t') ? ' ' : c;
  return text.size() > 60 ? out + "..." : out;
}

std::string join_key(const std::string& path, const std::string& name) { return path.empty() ? name : path + "." + name; }

// Builds a Node tree from the parser's events: no library tree, so that duplicates are seen and aliases are counted.
class TreeBuilder : public YAML::EventHandler {
 public:
  TreeBuilder(std::string file, ReadLimits limits) : file_(std::move(file)), limits_(limits) {}

  Node take_root() { return std::move(root_); }
  const Node& last_scalar() const { return last_scalar_; }
  Problems problems;

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    Node node;
    place(node, mark);
    finish_node(std::move(node), anchor, mark);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, const std::string& value) override {
    check_tag(tag, mark);
    Node node;
    node.kind = Node::Kind::scalar;
    node.text = value;
    node.quoted = tag == "!";
    place(node, mark);
    last_scalar_ = node;
    finish_node(std::move(node), anchor, mark);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end()) fail(mark, "an alias refers to a value that contains it", "a value written out");
    count(found->second.size, mark);
    Node copy = found->second;
    place(copy, mark);
    attach(std::move(copy), mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(Node::Kind::sequence, mark, tag, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, YAML::EmitterStyle::value) override {
    open(Node::Kind::map, mark, tag, anchor);
  }
  void OnMapEnd() override { close(); }

 private:
  struct Open {
    Node node;
    YAML::anchor_t anchor = 0;
    YAML::Mark mark;
    bool has_key = false;
    std::string key;
    int key_line = 0, key_column = 0;
  };

  [[noreturn]] void fail(const YAML::Mark& mark, const std::string& message, const std::string& expected) const {
    Problems all = problems;
    all.push_back({file_, mark.line + 1, mark.column + 1, path(), message, expected});
    throw InputError(std::move(all));
  }
  static void place(Node& node, const YAML::Mark& mark) {
    node.line = mark.line + 1;
    node.column = mark.column + 1;
  }
  void check_tag(const std::string& tag, const YAML::Mark& mark) const {
    if (tag.empty() || tag == "?" || tag == "!" || tag.starts_with("tag:yaml.org,2002:")) return;
    fail(mark, fmt::format("has the tag '{}'", shortened(tag)), "a plain value");
  }
  void count(std::size_t more, const YAML::Mark& mark) {
    total_ += more;
    if (total_ > limits_.nodes) fail(mark, fmt::format("the file has more than {} values", limits_.nodes), "a smaller file");
  }
  void open(Node::Kind kind, const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) {
    check_tag(tag, mark);
    if (static_cast<int>(open_.size()) >= limits_.depth)
      fail(mark, fmt::format("is nested more than {} levels deep", limits_.depth), "a flatter file");
    count(1, mark);
    Open o;
    o.node.kind = kind;
    place(o.node, mark);
    o.anchor = anchor;
    o.mark = mark;
    open_.push_back(std::move(o));
  }
  void close() {
    Open o = std::move(open_.back());
    open_.pop_back();
    if (o.anchor) anchors_[o.anchor] = o.node;
    attach(std::move(o.node), o.mark);
  }
  void finish_node(Node node, YAML::anchor_t anchor, const YAML::Mark& mark) {
    count(1, mark);
    if (anchor) anchors_[anchor] = node;
    attach(std::move(node), mark);
  }
  void attach(Node node, const YAML::Mark& mark) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& parent = open_.back();
    if (parent.node.kind == Node::Kind::sequence) {
      parent.node.size += node.size;
      parent.node.items.push_back(std::move(node));
      return;
    }
    if (!parent.has_key) {
      if (node.kind != Node::Kind::scalar) fail(mark, "has a key that is not text", "a name followed by ':'");
      parent.has_key = true;
      parent.key = node.text;
      parent.key_line = mark.line + 1;
      parent.key_column = mark.column + 1;
      return;
    }
    parent.has_key = false;
    for (const Node::Entry& e : parent.node.entries) {
      if (e.key != parent.key) continue;
      problems.push_back({file_, parent.key_line, parent.key_column, join_key(path(), parent.key),
                          fmt::format("is given twice (first in line {})", e.line), "each key once"});
      return;
    }
    parent.node.size += node.size;
    parent.node.entries.push_back({parent.key, parent.key_line, parent.key_column, std::move(node)});
  }
  std::string path() const {
    std::string out;
    for (std::size_t i = 0; i + 1 <= open_.size(); ++i) {
      const Open& o = open_[i];
      if (o.node.kind == Node::Kind::sequence)
        out += fmt::format("[{}]", o.node.items.size());
      else if (o.has_key)
        out = join_key(out, shortened(o.key));
    }
    return out;
  }

  std::string file_;
  ReadLimits limits_;
  Node root_;
  Node last_scalar_;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, Node> anchors_;
  std::size_t total_ = 0;
};

// The YAML library takes a quote that is never closed for text that ends with the file; this finds it.
bool quote_is_closed(const std::string& text, const Node& scalar) {
  std::size_t i = 0;
  for (int line = 1; line < scalar.line; ++line) i = std::min(text.find('\n', i), text.size() - 1) + 1;
  i += static_cast<std::size_t>(scalar.column - 1);
  i = text.find_first_of("\"'", i);
  if (i == std::string::npos) return true;
  const char quote = text[i];
  for (++i; i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"')
      ++i;
    else if (text[i] == quote && quote == '\'' && i + 1 < text.size() && text[i + 1] == quote)
      ++i;
    else if (text[i] == quote)
      return true;
  }
  return false;
}

bool plain_scalar_reads_back(const std::string& text) {
  if (text.empty()) return false;
  if (text == "~" || text == "null" || text == "Null" || text == "NULL") return false;
  static const std::string first = "!&*-?|>@`\"'%#{}[],: ";
  const bool minus_number = text.size() > 1 && text[0] == '-' && (std::isdigit(static_cast<unsigned char>(text[1])) || text[1] == '.');
  if (first.find(text[0]) != std::string::npos && !minus_number) return false;
  if (text.back() == ' ' || text.back() == ':') return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const unsigned char c = static_cast<unsigned char>(text[i]);
    if (c < 0x20 || c == 0x7f) return false;
    if (std::strchr("{}[],", c)) return false;
    if (c == ':' && i + 1 < text.size() && text[i + 1] == ' ') return false;
    if (c == '#' && i > 0 && text[i - 1] == ' ') return false;
  }
  return true;
}

std::string scalar_text(const Node& node) {
  if (node.kind == Node::Kind::null) return "~";
  if (!node.quoted && plain_scalar_reads_back(node.text)) return node.text;
  std::string out = "\"";
  for (const char ch : node.text) {
    const unsigned char c = static_cast<unsigned char>(ch);
    if (c == '"' || c == '\\')
      out += std::string("\\") + ch;
    else if (c == '\n')
      out += "\\n";
    else if (c == '\t')
      out += "\\t";
    else if (c < 0x20 || c == 0x7f)
      out += fmt::format("\\x{:02x}", c);
    else
      out += ch;
  }
  return out + "\"";
}

void emit(const Node& node, int indent, std::string& out) {
  const std::string pad(static_cast<std::size_t>(indent), ' ');
  const auto leaf = [](const Node& n) {
    return n.kind == Node::Kind::null || n.kind == Node::Kind::scalar || (n.items.empty() && n.entries.empty());
  };
  const auto leaf_text = [](const Node& n) -> std::string {
    if (n.kind == Node::Kind::map) return "{}";
    if (n.kind == Node::Kind::sequence) return "[]";
    return scalar_text(n);
  };
  if (leaf(node)) {
    out += pad + leaf_text(node) + "\n";
    return;
  }
  if (node.kind == Node::Kind::map) {
    for (const Node::Entry& e : node.entries) {
      out += pad + scalar_text(Node::scalar(e.key)) + ":";
      const bool short_list = e.value.kind == Node::Kind::sequence && !e.value.items.empty() &&
                              std::all_of(e.value.items.begin(), e.value.items.end(), leaf);
      if (leaf(e.value)) {
        out += " " + leaf_text(e.value) + "\n";
      } else if (short_list) {
        out += " [";
        for (std::size_t i = 0; i < e.value.items.size(); ++i) out += (i ? ", " : "") + leaf_text(e.value.items[i]);
        out += "]\n";
      } else {
        out += "\n";
        emit(e.value, indent + 2, out);
      }
    }
    return;
  }
  for (const Node& item : node.items) {
    if (leaf(item)) {
      out += pad + "- " + leaf_text(item) + "\n";
      continue;
    }
    std::string below;
    emit(item, indent + 2, below);
    out += pad + "- " + below.substr(static_cast<std::size_t>(indent) + 2);
  }
}

std::string kind_text(const Node& node) {
  switch (node.kind) {
    case Node::Kind::null: return "has no value";
    case Node::Kind::scalar: return fmt::format("is '{}'", shortened(node.text));
    case Node::Kind::sequence: return "is a list";
    case Node::Kind::map: return "is a section with keys of its own";
  }
  return {};
}

}  // namespace

Node Node::scalar(std::string text) {
  Node n;
  n.kind = Kind::scalar;
  n.text = std::move(text);
  return n;
}
Node Node::map() {
  Node n;
  n.kind = Kind::map;
  return n;
}
Node Node::sequence() {
  Node n;
  n.kind = Kind::sequence;
  return n;
}

const Node* Node::find(const std::string& key) const {
  for (const Entry& e : entries)
    if (e.key == key) return &e.value;
  return nullptr;
}

const Node* Node::at(const std::string& path) const {
  const Node* node = this;
  std::size_t i = 0;
  while (node && i < path.size()) {
    if (path[i] == '[') {
      const std::size_t end = path.find(']', i);
      if (end == std::string::npos) return nullptr;
      const auto index = parse_number(std::string_view(path).substr(i + 1, end - i - 1));
      if (!index || *index < 0 || *index >= static_cast<double>(node->items.size())) return nullptr;
      node = &node->items[static_cast<std::size_t>(*index)];
      i = end + 1;
    } else {
      if (path[i] == '.') ++i;
      const std::size_t end = std::min(path.find_first_of(".[", i), path.size());
      node = node->find(path.substr(i, end - i));
      i = end;
    }
  }
  return node;
}

Node& Node::set(const std::string& key, Node value) {
  for (Entry& e : entries)
    if (e.key == key) return e.value = std::move(value);
  entries.push_back({key, 0, 0, std::move(value)});
  return entries.back().value;
}

void Source::problem(const Node& where, const std::string& key, const std::string& message, const std::string& expected) {
  problems.push_back({file, where.line, where.column, key, message, expected});
}

void Source::note(const Node& where, const std::string& key, const std::string& message) {
  notes.push_back(Problem{file, where.line, where.column, key, message, {}}.text());
}

std::string read_text_file(const std::string& path, std::size_t limit) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) throw InputError({path, 0, 0, {}, "is a folder", "a file"});
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!in) throw InputError({path, 0, 0, {}, fmt::format("cannot be read: {}", system_error_text(errno)), {}});
  std::string text;
  char buffer[1 << 16];
  for (;;) {
    const std::size_t n = std::fread(buffer, 1, sizeof buffer, in.get());
    text.append(buffer, n);
    if (text.size() > limit) throw InputError({path, 0, 0, {}, fmt::format("is larger than {} bytes", limit), "a smaller file"});
    if (n < sizeof buffer) break;
  }
  if (std::ferror(in.get())) throw InputError({path, 0, 0, {}, fmt::format("cannot be read: {}", system_error_text(errno)), {}});
  return text;
}

Node parse_yaml(const std::string& text, const std::string& file, const ReadLimits& limits) {
  if (text.size() > limits.bytes)
    throw InputError({file, 0, 0, {}, fmt::format("is larger than {} bytes", limits.bytes), "a smaller file"});
  if (const std::size_t nul = text.find('\0'); nul != std::string::npos)
    throw InputError({file, line_of(text, nul), 0, {}, "holds a zero byte", "YAML text in UTF-8"});
  if (const std::size_t bad = find_invalid_utf8(text); bad != std::string::npos)
    throw InputError({file, line_of(text, bad), 0, {}, "is not UTF-8 text", "YAML text in UTF-8 (save it as UTF-8)"});
  TreeBuilder builder(file, limits);
  try {
    std::istringstream in(text);
    YAML::Parser parser(in);
    parser.HandleNextDocument(builder);
    Node root = builder.take_root();
    TreeBuilder second(file, limits);
    if (parser.HandleNextDocument(second)) {
      const Node extra = second.take_root();
      builder.problems.push_back({file, extra.line, extra.column, {}, "a second document begins", "one document in a file"});
    }
    const Node& last = builder.last_scalar();
    if (last.quoted && !quote_is_closed(text, last))
      builder.problems.push_back({file, last.line, last.column, {}, "is not YAML here: a quote is not closed", {}});
    throw_if_any(builder.problems);
    return root;
  } catch (const YAML::Exception& e) {
    Problems problems = builder.problems;
    const bool placed = !e.mark.is_null();
    problems.push_back({file, placed ? e.mark.line + 1 : 0, placed ? e.mark.column + 1 : 0, {},
                        fmt::format("is not YAML here: {}", e.msg), {}});
    throw InputError(std::move(problems));
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& e) {
    throw InputError({file, 0, 0, {}, fmt::format("cannot be parsed: {}", e.what()), "YAML text"});
  }
}

std::string named_files(const Node& node, const std::string& folder) {
  std::string out;
  if (node.kind == Node::Kind::scalar && !node.text.empty() && node.text.size() < 4096) {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::path(folder) / node.text;
    if (std::filesystem::is_regular_file(path, error)) {
      std::uint64_t hash = 1469598103934665603ull;  // FNV-1a
      const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(path.c_str(), "rb"), &std::fclose);
      char buffer[1 << 14];
      for (std::size_t n = 1; in && n > 0;) {
        n = std::fread(buffer, 1, sizeof buffer, in.get());
        for (std::size_t i = 0; i < n; ++i) hash = (hash ^ static_cast<unsigned char>(buffer[i])) * 1099511628211ull;
      }
      out += fmt::format("{} {:016x}\n", node.text, hash);
    }
  }
  for (const Node& item : node.items) out += named_files(item, folder);
  for (const Node::Entry& e : node.entries) out += named_files(e.value, folder);
  return out;
}

Node read_yaml(const std::string& path, const ReadLimits& limits) {
  return parse_yaml(read_text_file(path, limits.bytes), path, limits);
}

std::string to_yaml(const Node& node) {
  std::string out;
  emit(node, 0, out);
  return out;
}

std::string Range::text(const std::string& unit) const {
  const std::string u = unit.empty() || unit == "-" ? "" : " " + unit;
  const bool low = std::isfinite(lo), high = std::isfinite(hi);
  const std::string what = u.empty() ? "a number" : "a value";
  if (low && high)
    return lo_open && hi_open ? fmt::format("{} between {} and {}{}", what, lo, hi, u)
                              : fmt::format("{} from {} to {}{}", what, lo, hi, u);
  if (low) return fmt::format("{} {} {}{}", what, lo_open ? "above" : "of at least", lo, u);
  if (high) return fmt::format("{} {} {}{}", what, hi_open ? "below" : "of at most", hi, u);
  return u.empty() ? "a number" : fmt::format("a value in{}", u);
}

std::optional<double> read_number(const Node& node, const std::string& key, const std::string& unit, const Range& range,
                                  Source& source) {
  if (node.kind != Node::Kind::scalar) {
    source.problem(node, key, kind_text(node), range.text(unit));
    return std::nullopt;
  }
  const QuantityText q = parse_quantity(node.text, unit);
  if (!q.error.empty()) {
    source.problem(node, key, q.error, range.text(unit));
    return std::nullopt;
  }
  if (!range.contains(q.value)) {
    source.problem(node, key, fmt::format("is {}", shortened(node.text)), range.text(unit));
    return std::nullopt;
  }
  return q.value;
}

std::optional<long> read_integer(const Node& node, const std::string& key, long lo, long hi, Source& source) {
  const std::string expected = fmt::format("a whole number from {} to {}", lo, hi);
  const auto value = node.kind == Node::Kind::scalar ? parse_number(node.text) : std::nullopt;
  if (!value || *value != std::floor(*value) || *value < static_cast<double>(lo) || *value > static_cast<double>(hi)) {
    source.problem(node, key, kind_text(node), expected);
    return std::nullopt;
  }
  return static_cast<long>(*value);
}

std::optional<bool> read_flag(const Node& node, const std::string& key, Source& source) {
  if (node.kind == Node::Kind::scalar && (node.text == "true" || node.text == "yes" || node.text == "on")) return true;
  if (node.kind == Node::Kind::scalar && (node.text == "false" || node.text == "no" || node.text == "off")) return false;
  source.problem(node, key, kind_text(node), "true or false");
  return std::nullopt;
}

std::optional<std::string> read_text(const Node& node, const std::string& key, Source& source) {
  if (node.kind == Node::Kind::scalar) return node.text;
  source.problem(node, key, kind_text(node), "text");
  return std::nullopt;
}

std::optional<std::string> read_choice(const Node& node, const std::string& key, const std::vector<std::string>& choices,
                                       Source& source) {
  if (node.kind == Node::Kind::scalar && std::find(choices.begin(), choices.end(), node.text) != choices.end())
    return node.text;
  std::string list;
  for (const std::string& c : choices) list += (list.empty() ? "" : " | ") + c;
  std::string message = kind_text(node);
  if (node.kind == Node::Kind::scalar) {
    const std::string near = nearest_word(node.text, choices);
    if (!near.empty()) message += fmt::format(" (did you mean '{}'?)", near);
  }
  source.problem(node, key, message, list);
  return std::nullopt;
}

std::vector<double> read_numbers(const Node& node, const std::string& key, const std::string& unit, const Range& range,
                                 Source& source) {
  std::vector<double> out;
  if (node.kind == Node::Kind::scalar) {
    if (const auto v = read_number(node, key, unit, range, source)) out.push_back(*v);
    return out;
  }
  if (node.kind != Node::Kind::sequence) {
    source.problem(node, key, kind_text(node), "a list of numbers");
    return out;
  }
  for (std::size_t i = 0; i < node.items.size(); ++i)
    if (const auto v = read_number(node.items[i], fmt::format("{}[{}]", key, i), unit, range, source)) out.push_back(*v);
  return out;
}

std::string named_path(const std::string& name, const Node& where, const std::string& key, Source& source) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(source.file).parent_path();
  const fs::path path = fs::path(name).is_absolute() ? fs::path(name) : folder / name;
  std::error_code error;
  const fs::path here = fs::weakly_canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path there = fs::weakly_canonical(path, error);
  const fs::path relative = there.lexically_relative(here);
  if (relative.empty() || *relative.begin() == "..")
    source.note(where, key, fmt::format("names '{}', outside the folder of this file", there.string()));
  const fs::file_status status = fs::status(path, error);
  if (fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status))
    source.problem(where, key, fmt::format("names '{}', a device or pipe", path.string()), "a file");
  return path.lexically_normal().string();
}

MapReader::MapReader(const Node& node, std::string path, Source& source, Unknown unknown)
    : node_(node), path_(std::move(path)), source_(source), unknown_(unknown) {
  if (node.kind != Node::Kind::map)
    source.problem(node, path_, path_.empty() && node.kind == Node::Kind::null ? "the file is empty" : kind_text(node),
                   "a section of 'key: value' lines");
}

const Node* MapReader::find(const std::string& name) {
  known_.insert(name);
  const Node* value = node_.find(name);
  if (value && value->kind == Node::Kind::null) {
    source_.problem(*value, key(name), "has no value", "a value, or leave the key out");
    return nullptr;
  }
  return value;
}

const Node* MapReader::need(const std::string& name) {
  if (node_.kind == Node::Kind::map && !node_.find(name)) source_.problem(node_, key(name), "is missing");
  return find(name);
}

bool MapReader::has(const std::string& name) {
  known_.insert(name);
  return node_.find(name) != nullptr;
}

std::optional<double> MapReader::number(const std::string& name, const std::string& unit, const Range& range) {
  const Node* n = find(name);
  return n ? read_number(*n, key(name), unit, range, source_) : std::nullopt;
}
std::optional<long> MapReader::integer(const std::string& name, long lo, long hi) {
  const Node* n = find(name);
  return n ? read_integer(*n, key(name), lo, hi, source_) : std::nullopt;
}
std::optional<bool> MapReader::flag(const std::string& name) {
  const Node* n = find(name);
  return n ? read_flag(*n, key(name), source_) : std::nullopt;
}
std::optional<std::string> MapReader::text(const std::string& name) {
  const Node* n = find(name);
  return n ? read_text(*n, key(name), source_) : std::nullopt;
}
std::optional<std::string> MapReader::choice(const std::string& name, const std::vector<std::string>& choices) {
  const Node* n = find(name);
  return n ? read_choice(*n, key(name), choices, source_) : std::nullopt;
}
std::vector<double> MapReader::numbers(const std::string& name, const std::string& unit, const Range& range) {
  const Node* n = find(name);
  return n ? read_numbers(*n, key(name), unit, range, source_) : std::vector<double>{};
}

std::optional<MapReader> MapReader::section(const std::string& name) {
  const Node* n = find(name);
  if (!n) return std::nullopt;
  std::optional<MapReader> out(std::in_place, *n, key(name), source_, unknown_);
  if (n->kind != Node::Kind::map) return std::nullopt;
  return out;
}

std::vector<std::pair<std::string, const Node*>> MapReader::items(const std::string& name) {
  std::vector<std::pair<std::string, const Node*>> out;
  const Node* n = find(name);
  if (!n) return out;
  if (n->kind != Node::Kind::sequence) {
    source_.problem(*n, key(name), kind_text(*n), "a list");
    return out;
  }
  for (std::size_t i = 0; i < n->items.size(); ++i) out.emplace_back(fmt::format("{}[{}]", key(name), i), &n->items[i]);
  return out;
}

std::vector<std::pair<std::string, const Node*>> MapReader::finish() {
  std::vector<std::pair<std::string, const Node*>> left;
  const std::vector<std::string> known(known_.begin(), known_.end());
  constexpr std::size_t kMostProblems = 200;  // more help nobody
  for (const Node::Entry& e : node_.entries) {
    if (known_.contains(e.key)) continue;
    if (source_.problems.size() >= kMostProblems) break;
    Node where;
    where.line = e.line;
    where.column = e.column;
    const std::string near = nearest_word(e.key, known);
    const bool one_off = !near.empty() && edit_distance(e.key, near) <= 1 && e.key.size() > 2;
    if (unknown_ == Unknown::error || one_off) {
      std::string expected;
      if (near.empty())
        for (const std::string& k : known) expected += (expected.empty() ? "one of " : ", ") + k;
      source_.problem(where, key(e.key), near.empty() ? "is not a known key" : fmt::format("is not a known key (did you mean '{}'?)", near),
                      expected);
    } else {
      source_.note(where, key(e.key), "is not a known key: kept and ignored");
      left.emplace_back(e.key, &e.value);
    }
  }
  return left;
}

void locate(Problems& problems, const Node& root, const std::string& file, const std::string& prefix) {
  for (Problem& p : problems) {
    std::string path = join_key(prefix, p.key);
    p.key = path;
    p.file = file;
    // The nearest place that stands in the file: the value itself, or the section it is missing from.
    for (;;) {
      if (const Node* n = root.at(path)) {
        p.line = n->line;
        p.column = n->column;
        break;
      }
      const std::size_t cut = path.find_last_of(".[");
      path = cut == std::string::npos ? std::string() : path.substr(0, cut);
    }
  }
}

}  // namespace terrode::scenario
