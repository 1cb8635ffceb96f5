// The JSON Schemas that editors use, held against the files of the repository by a small validator of the words that the
// schemas use.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "scenario/particle_tests.h"
#include "scenario/scenario.h"
#include "scenario/vehicle_file.h"

namespace terrode::scenario {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// What a YAML reader of an editor makes of a node.
json value_of(const Node& node) {
  if (node.kind == Node::Kind::map) {
    json out = json::object();
    for (const auto& e : node.entries) out[e.key] = value_of(e.value);
    return out;
  }
  if (node.kind == Node::Kind::sequence) {
    json out = json::array();
    for (const Node& n : node.items) out.push_back(value_of(n));
    return out;
  }
  if (node.kind == Node::Kind::null) return nullptr;
  if (!node.quoted) {
    if (node.text == "true" || node.text == "false") return node.text == "true";
    char* end = nullptr;
    const double number = std::strtod(node.text.c_str(), &end);
    if (end && *end == '\0' && end != node.text.c_str()) {
      if (node.text.find_first_of(".eE") == std::string::npos) return static_cast<std::int64_t>(number);
      return number;
    }
  }
  return node.text;
}

bool is_of(const json& v, const std::string& type) {
  return type == "object" ? v.is_object() : type == "array" ? v.is_array() : type == "string" ? v.is_string()
         : type == "number" ? v.is_number() : type == "integer" ? v.is_number_integer() : type == "boolean" ? v.is_boolean() : v.is_null();
}

// Where the value does not follow the schema; empty: it does.
std::string wrong(const json& schema, const json& value, const std::string& at) {
  if (!schema.is_object()) return at + ": the schema itself is no object: " + schema.dump();
  if (schema.contains("type")) {
    const json& t = schema["type"];
    bool ok = false;
    for (const json& one : t.is_array() ? t : json::array({t})) ok = ok || is_of(value, one.get<std::string>());
    if (!ok) return at + ": is no " + t.dump();
  }
  if (schema.contains("enum") && std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end())
    return at + ": " + value.dump() + " is none of " + schema["enum"].dump();
  if (value.is_number()) {
    const double x = value.get<double>();
    if (schema.contains("minimum") && x < schema["minimum"].get<double>()) return at + ": below the minimum";
    if (schema.contains("maximum") && x > schema["maximum"].get<double>()) return at + ": above the maximum";
    if (schema.contains("exclusiveMinimum") && x <= schema["exclusiveMinimum"].get<double>()) return at + ": below the minimum";
    if (schema.contains("exclusiveMaximum") && x >= schema["exclusiveMaximum"].get<double>()) return at + ": above the maximum";
  }
  if (value.is_string() && schema.contains("pattern") && !std::regex_search(value.get<std::string>(), std::regex(schema["pattern"].get<std::string>())))
    return at + ": does not look like " + schema["pattern"].dump();
  if (value.is_array()) {
    if (schema.contains("minItems") && value.size() < schema["minItems"].get<std::size_t>()) return at + ": too short";
    if (schema.contains("maxItems") && value.size() > schema["maxItems"].get<std::size_t>()) return at + ": too long";
    if (schema.contains("items"))
      for (std::size_t i = 0; i < value.size(); ++i)
        if (const std::string w = wrong(schema["items"], value[i], at + "[" + std::to_string(i) + "]"); !w.empty()) return w;
  }
  if (value.is_object()) {
    for (const json& key : schema.value("required", json::array()))
      if (!value.contains(key.get<std::string>())) return at + ": lacks " + key.get<std::string>();
    const json properties = schema.value("properties", json::object());
    const json others = schema.value("additionalProperties", json(true));
    for (const auto& [key, v] : value.items()) {
      if (properties.contains(key)) {
        if (const std::string w = wrong(properties[key], v, at + "." + key); !w.empty()) return w;
      } else if (others.is_boolean() && !others.get<bool>()) {
        return at + "." + key + ": is not known";
      } else if (others.is_object()) {
        if (const std::string w = wrong(others, v, at + "." + key); !w.empty()) return w;
      }
    }
  }
  if (schema.contains("anyOf")) {
    std::string why;
    for (const json& one : schema["anyOf"]) {
      const std::string w = wrong(one, value, at);
      if (w.empty()) return {};
      why += "\n    " + w;
    }
    return at + ": follows none of" + why;
  }
  return {};
}

std::string schema_of(const fs::path& path) {
  if (is_drive(path.string())) return vehicle_schema();
  return is_particle_tests(path.string()) ? particle_tests_schema() : scenario_schema();
}

TEST(Schema, EveryFileOfTheRepositoryFollowsItsSchema) {
  std::size_t count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TERRODE_SOURCE_DIR) / "scenarios")) {
    if (entry.path().extension() != ".yaml" || is_machine(entry.path().string())) continue;
    ++count;
    EXPECT_EQ(wrong(json::parse(schema_of(entry.path())), value_of(read_yaml(entry.path().string())), ""), "") << entry.path();
  }
  EXPECT_GE(count, 10u);
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(TERRODE_SOURCE_DIR) / "recordings")) {
    if (entry.path().filename() != "recording.yaml") continue;
    EXPECT_EQ(wrong(json::parse(recording_schema()), value_of(read_yaml(entry.path().string())), ""), "") << entry.path();
  }
}

TEST(Schema, RefusesWhatTheReaderRefuses) {
  const json vehicle = json::parse(vehicle_schema());
  const char* const good = "vehicle: skid-steer-robot\nscript: [{duration: 1, speed: 10 cm/s}]\n";
  EXPECT_EQ(wrong(vehicle, value_of(parse_yaml(good, "a.yaml")), ""), "");
  const std::string machine =
      "vehicle: {name: a, bodies: [{name: b, mass: 1}], wheels: [{name: w, parent: b, centre: [0, 0, 1], mass: 1, radius: 1, width: 1}]}\n"
      "script: [{duration: 1}]\n";
  EXPECT_EQ(wrong(vehicle, value_of(parse_yaml(machine, "a.yaml")), ""), "");
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{{"duration: 1", "duration: -1"},
                                                                                   {"duration: 1", "durations: 1"},
                                                                                   {"mass: 1, radius", "mas: 1, radius"},
                                                                                   {"[0, 0, 1]", "[0, 1]"},
                                                                                   {"parent: b, ", ""},
                                                                                   {"width: 1", "width: wide"},
                                                                                   {"width: 1", "width: 1, drive: {kind: steam}"},
                                                                                   {"script:", "gravity: venus\nscript:"}}) {
    std::string bad = machine;
    ASSERT_NE(bad.find(from), std::string::npos) << from;
    bad.replace(bad.find(from), from.size(), to);
    EXPECT_NE(wrong(vehicle, value_of(parse_yaml(bad, "a.yaml")), ""), "") << bad;
    EXPECT_THROW(parse_drive(bad, "a.yaml"), InputError) << bad;
  }
}

}  // namespace
}  // namespace terrode::scenario
