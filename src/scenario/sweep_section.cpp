#include <fmt/format.h>

#include <cmath>

#include "core/units.h"
#include "scenario/section.h"

namespace terrode::scenario {
namespace {

// Slips a file may name in one list: enough for any curve, few enough that a slip of the pen is seen.
constexpr std::size_t kMostSlips = 10000;

Table<SweepCondition> condition_table() {
  Table<SweepCondition> t;
  t.number("slip", "-", any_number(), &SweepCondition::slip, "by the slip convention of the rig")
      .required()
      .number("normal_load", "N", above(0), &SweepCondition::normal_load, "absent: that of the rig")
      .number("angular_velocity", "rad/s", above(0), &SweepCondition::angular_velocity, "absent: that of the rig")
      .integer("pass", 1, 1000, &SweepCondition::pass, "how often the ground was driven over, this pass included");
  return t;
}

}  // namespace

std::vector<double> parse_slips(const std::string& text) {
  const std::string expected = "a list as 0,0.1,0.3 or a range FROM:TO:STEP";
  const auto fail = [&](const std::string& message) -> InputError {
    return InputError({{}, 0, 0, "slip", fmt::format("is '{}'{}", text.substr(0, 60), message), expected});
  };
  const auto split = [](const std::string& s, char by) {
    std::vector<std::string> out(1);
    for (const char c : s)
      if (c == by)
        out.emplace_back();
      else
        out.back() += c;
    return out;
  };
  const auto number = [&](const std::string& s) {
    const QuantityText q = parse_quantity(s, "-");
    if (!q.error.empty()) throw fail("");
    return q.value;
  };
  std::vector<double> out;
  if (text.find(':') != std::string::npos) {
    const auto parts = split(text, ':');
    if (parts.size() != 3) throw fail("");
    const double from = number(parts[0]), to = number(parts[1]), step = number(parts[2]);
    if (step == 0.0 || (to - from) * step < 0.0) throw fail(", which never ends");
    const double count = std::floor((to - from) / step + 1e-9) + 1.0;
    if (!(count <= static_cast<double>(kMostSlips))) throw fail(fmt::format(", more than {} slips", kMostSlips));
    for (double i = 0; i < count; ++i) {
      // Steps such as 0.1 leave digits behind that nobody wrote.
      const double value = from + i * step;
      out.push_back(std::abs(value) < 1e-12 ? 0.0 : std::round(value * 1e12) / 1e12);
    }
  } else {
    for (const std::string& part : split(text, ',')) out.push_back(number(part));
  }
  return out;
}

Section sweep_section() {
  Section section;
  section.name = "sweep";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    MapReader map(node, key, source);
    if (const Node* slips = map.find("slips")) {
      if (slips->kind == Node::Kind::scalar) {
        try {
          out.slips = parse_slips(slips->text);
        } catch (const InputError& e) {
          source.problem(*slips, map.key("slips"), e.problems().front().message, e.problems().front().expected);
        }
      } else {
        out.slips = read_numbers(*slips, map.key("slips"), "-", any_number(), source);
      }
    }
    for (const auto& [item_key, item] : map.items("conditions")) {
      MapReader below(*item, item_key, source);
      SweepCondition condition;
      condition_table().read(below, condition);
      out.conditions.push_back(condition);
    }
    if (map.has("slips") && map.has("conditions"))
      source.problem(node, map.key("slips"), "stands beside conditions", "one of the two");
    map.finish();
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    Node out = Node::map();
    if (!in.slips.empty()) {
      Node& list = out.set("slips", Node::sequence());
      for (const double s : in.slips) list.items.push_back(quantity_node(s, ""));
    }
    if (!in.conditions.empty()) {
      Node& list = out.set("conditions", Node::sequence());
      for (const SweepCondition& c : in.conditions) list.items.push_back(condition_table().write(c));
    }
    if (out.entries.empty()) return std::nullopt;
    return out;
  };
  section.schema = [] {
    const Json number = quantity_schema("", any_number(), "");
    return Json{{"type", "object"},
                {"additionalProperties", false},
                {"properties",
                 {{"slips", {{"description", "a list, or FROM:TO:STEP, by the slip convention of the rig"},
                             {"anyOf", Json::array({Json{{"type", "array"}, {"items", number}}, Json{{"type", "string"}}})}}},
                  {"conditions", {{"description", "single conditions in place of slips"},
                                  {"type", "array"},
                                  {"items", condition_table().schema()}}}}}};
  };
  return section;
}

}  // namespace terrode::scenario
