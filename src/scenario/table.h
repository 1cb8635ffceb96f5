// The keys of one section of a file, said once: from the same table the section is read, written and described as
// JSON Schema.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "scenario/reader.h"

namespace terrode::scenario {

using Json = nlohmann::ordered_json;

// JSON Schema of a quantity: a number in SI, or text with a unit.
Json quantity_schema(const std::string& unit, const Range& range, const std::string& description);
// A number as it is written to a file: the shortest digits that read back to the same value, and its unit.
Node quantity_node(double value, const std::string& unit);

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
    schema["default"] = T{}.*member;
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { if (const auto v = map.number(name, unit, range)) out.*member = *v; },
                [=](const T& in) -> std::optional<Node> { return quantity_node(in.*member, unit); }});
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
  Table& numbers(const std::string& name, const std::string& unit, Range range, std::vector<double> T::*member,
                 const std::string& text) {
    Json schema = {{"type", "array"}, {"description", text}, {"items", quantity_schema(unit, range, "")}};
    return add({name, false, std::move(schema),
                [=](MapReader& map, T& out) { out.*member = map.numbers(name, unit, range); },
                [=](const T& in) -> std::optional<Node> {
                  if ((in.*member).empty()) return std::nullopt;
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
    for (const Key& key : keys_) {
      if (key.required) map.need(key.name);
      if (map.has(key.name)) key.read(map, out);
    }
    map.finish();
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
