// The keys of one section of a file, said once: from the same table the section is read, written and described as
// JSON Schema.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/frames.h"
#include "scenario/reader.h"

namespace terrode::scenario {

using Json = nlohmann::ordered_json;

// JSON Schema of a quantity: a number in SI, or text with a unit.
Json quantity_schema(const std::string& unit, const Range& range, const std::string& description);
// A number as it is written to a file: the shortest digits that read back to the same value, and its unit.
Node quantity_node(double value, const std::string& unit);
// Three numbers at a key; on anything else nothing, and a problem.
std::optional<Vec3> read_vector(MapReader& map, const std::string& key, const std::string& unit, const Range& range = {});

template <class T>
class Table {
 public:
  struct Key {
    std::string name;
    bool required = false;
    Json schema;
    std::function<void(MapReader&, T&)> read;              // called where the key is present
    std::function<std::optional<Node>(const T&)> write;    // nothing: the key is left out
  };

  Table& number(const std::string& name, const std::string& unit, Range range, double T::*member, const std::string& text) {
    Json schema = quantity_schema(unit, range, text);
    const double standard = T{}.*member;
    if (std::isfinite(standard)) schema["default"] = standard;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = map.number(name, unit, range)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> {
                  if (!std::isfinite(in.*member)) return std::nullopt;
                  return quantity_node(in.*member, unit);
                }});
  }
  Table& number(const std::string& name, const std::string& unit, Range range, std::optional<double> T::*member,
                const std::string& text) {
    return add({name, false, quantity_schema(unit, range, text),
                [=](MapReader& map, T& out) { if (const auto v = map.number(name, unit, range)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> {
                  if (!(in.*member)) return std::nullopt;
                  return quantity_node(*(in.*member), unit);
                }});
  }
  // A list of numbers, or one.
  Table& numbers(const std::string& name, const std::string& unit, Range range, std::vector<double> T::*member,
                 const std::string& text) {
    Json one = quantity_schema(unit, range, ""), schema = Json::object();
    schema["description"] = text;
    schema["anyOf"] = one["anyOf"];
    schema["anyOf"].push_back({{"type", "array"}, {"items", one}});
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { out.*member = map.numbers(name, unit, range); },
                [=](const T& in) -> std::optional<Node> {
                  if ((in.*member).empty()) return std::nullopt;
                  Node list = Node::sequence();
                  for (const double v : in.*member) list.items.push_back(quantity_node(v, unit));
                  return list;
                }});
  }
  // Three numbers: x, y, z.
  Table& vector(const std::string& name, const std::string& unit, Range range, Vec3 T::*member, const std::string& text) {
    Json schema = {{"type", "array"}, {"description", text}, {"items", quantity_schema(unit, range, "")}, {"minItems", 3}, {"maxItems", 3}};
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = read_vector(map, name, unit, range)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> {
                  Node list = Node::sequence();
                  for (const double v : in.*member) list.items.push_back(quantity_node(v, unit));
                  return list;
                }});
  }
  Table& integer(const std::string& name, long lo, long hi, int T::*member, const std::string& text) {
    Json schema = {{"type", "integer"}, {"minimum", lo}, {"maximum", hi}, {"description", text}, {"default", T{}.*member}};
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = map.integer(name, lo, hi)) out.*member = static_cast<int>(*v); },
                [=](const T& in) -> std::optional<Node> { return Node::scalar(std::to_string(in.*member)); }});
  }
  Table& flag(const std::string& name, bool T::*member, const std::string& text) {
    Json schema = {{"type", "boolean"}, {"description", text}, {"default", T{}.*member}};
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = map.flag(name)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> { return Node::scalar(in.*member ? "true" : "false"); }});
  }
  Table& text(const std::string& name, std::string T::*member, const std::string& description) {
    Json schema = {{"type", Json::array({"string", "number"})}, {"description", description}};
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = map.text(name)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> {
                  if ((in.*member).empty()) return std::nullopt;
                  return Node::scalar(in.*member);
                }});
  }
  Table& choice(const std::string& name, std::vector<std::string> choices, std::string T::*member, const std::string& text) {
    Json schema = {{"enum", choices}, {"description", text}};
    if (!(T{}.*member).empty()) schema["default"] = T{}.*member;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = map.choice(name, choices)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> {
                  if ((in.*member).empty()) return std::nullopt;
                  return Node::scalar(in.*member);
                }});
  }
  // One of several words, each for a value.
  template <class E>
  Table& choice(const std::string& name, std::vector<std::pair<std::string, E>> choices, E T::*member, const std::string& text) {
    std::vector<std::string> words;
    for (const auto& [word, value] : choices) words.push_back(word);
    const auto word_of = [choices](E value) -> std::optional<std::string> {
      for (const auto& [word, v] : choices)
        if (v == value) return word;
      return std::nullopt;
    };
    Json schema = {{"enum", words}, {"description", text}};
    if (const auto standard = word_of(T{}.*member)) schema["default"] = *standard;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) {
                  if (const auto given = map.choice(name, words))
                    for (const auto& [word, value] : choices)
                      if (word == *given) out.*member = value;
                },
                [=](const T& in) -> std::optional<Node> {
                  const auto word = word_of(in.*member);
                  if (!word) return std::nullopt;
                  return Node::scalar(*word);
                }});
  }
  template <class S>
  Table& section(const std::string& name, S T::*member, Table<S> table, const std::string& text) {
    Json schema = table.schema();
    schema["description"] = text;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (auto below = map.section(name)) table.read(*below, out.*member); },
                [=](const T& in) -> std::optional<Node> {
                  Node below = table.write(in.*member);
                  if (below.entries.empty()) return std::nullopt;
                  return below;
                }});
  }
  // A section that may be absent.
  template <class S>
  Table& section(const std::string& name, std::optional<S> T::*member, Table<S> table, const std::string& text) {
    Json schema = table.schema();
    schema["description"] = text;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) {
                  if (auto below = map.section(name)) table.read(*below, (out.*member).emplace());
                },
                [=](const T& in) -> std::optional<Node> {
                  if (!(in.*member)) return std::nullopt;
                  return table.write(*(in.*member));
                }});
  }
  // A list of sections.
  template <class S>
  Table& list(const std::string& name, std::vector<S> T::*member, Table<S> table, const std::string& text) {
    Json schema = {{"type", "array"}, {"description", text}, {"items", table.schema()}};
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) {
                  for (const auto& [key, item] : map.items(name)) {
                    MapReader below(*item, key, map.source());
                    table.read(below, (out.*member).emplace_back());
                  }
                },
                [=](const T& in) -> std::optional<Node> {
                  if ((in.*member).empty()) return std::nullopt;
                  Node out = Node::sequence();
                  for (const S& item : in.*member) out.items.push_back(table.write(item));
                  return out;
                }});
  }
  // The keys of a struct within the struct, beside its own.
  template <class S>
  Table& embed(S T::*member, const Table<S>& table) {
    for (const auto& key : table.keys())
      add({key.name, key.required, key.schema, [read = key.read, member](MapReader& map, T& out) { read(map, out.*member); },
           [write = key.write, member](const T& in) { return write(in.*member); }});
    return *this;
  }
  // A section of the file whose keys belong to the same struct.
  Table& group(const std::string& name, Table<T> table, const std::string& text) {
    Json schema = table.schema();
    schema["description"] = text;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (auto below = map.section(name)) table.read(*below, out); },
                [=](const T& in) -> std::optional<Node> {
                  Node below = table.write(in);
                  if (below.entries.empty()) return std::nullopt;
                  return below;
                }});
  }
  Table& add(Key key) {
    keys_.push_back(std::move(key));
    return *this;
  }
  // Marks the key added last as one that must be given.
  Table& required() {
    keys_.back().required = true;
    keys_.back().schema.erase("default");
    return *this;
  }

  // Reads the keys that are present into `out`, says which required ones are missing and which are not known.
  void read(MapReader& map, T& out) const {
    read_known(map, out);
    map.finish();
  }
  // The same where further keys are read by others.
  void read_known(MapReader& map, T& out) const {
    for (const Key& key : keys_) {
      if (key.required) map.need(key.name);
      if (map.has(key.name)) key.read(map, out);
    }
  }
  Node write(const T& in) const {
    Node out = Node::map();
    for (const Key& key : keys_)
      if (auto value = key.write(in)) out.set(key.name, std::move(*value));
    return out;
  }
  Json schema() const {
    Json properties = Json::object(), needed = Json::array();
    for (const Key& key : keys_) {
      properties[key.name] = key.schema;
      if (key.required) needed.push_back(key.name);
    }
    Json out = {{"type", "object"}, {"additionalProperties", false}, {"properties", properties}};
    if (!needed.empty()) out["required"] = needed;
    return out;
  }
  const std::vector<Key>& keys() const { return keys_; }
  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const Key& key : keys_) out.push_back(key.name);
    return out;
  }

 private:
  std::vector<Key> keys_;
};

}  // namespace terrode::scenario
