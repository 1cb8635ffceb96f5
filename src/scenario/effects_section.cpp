#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "effects/effect.h"
#include "scenario/section.h"

namespace terrode::scenario {
namespace {

Range bounds(const effects::Parameter& p) {
  // The null value is right as well, so that a file can say that the effect is off.
  const double null = std::isfinite(p.null_value) ? p.null_value : p.lower;
  return from_to(std::min(p.lower, null), std::max(p.upper, null));
}

}  // namespace

EffectSpec read_effect(const std::string& id, MapReader& parameters) {
  EffectSpec effect{id, {}};
  for (const effects::Parameter& p : effects::find_effect(id)->info->parameters) {
    const std::string name(p.name);
    if (const auto v = parameters.number(name, std::string(p.unit), bounds(p))) effect.parameters[name] = *v;
  }
  return effect;
}

Json effect_parameters_schema(const std::string& id) {
  Json parameters = Json::object();
  for (const effects::Parameter& p : effects::find_effect(id)->info->parameters)
    parameters[std::string(p.name)] = quantity_schema(std::string(p.unit), bounds(p),
                                                      fmt::format("{}{}typically {}", p.meaning, p.meaning.empty() ? "" : "; ", p.typical));
  return parameters;
}

Section effects_section() {
  Section section;
  section.name = "effects";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    MapReader map(node, key, source);
    for (const effects::EffectType& type : effects::all_effects()) {
      const std::string id(type.info->id);
      const auto below = map.section(id);
      if (!below) continue;
      MapReader parameters = *below;
      out.effects.push_back(read_effect(id, parameters));
      parameters.finish();
    }
    map.finish();
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    if (in.effects.empty()) return std::nullopt;
    Node out = Node::map();
    for (const EffectSpec& e : in.effects) {
      Node& below = out.set(e.id, Node::map());
      const effects::EffectType* type = effects::find_effect(e.id);
      for (const auto& [name, value] : e.parameters) {
        std::string unit;
        if (type)
          for (const effects::Parameter& p : type->info->parameters)
            if (p.name == name) unit = std::string(p.unit);
        below.set(name, quantity_node(value, unit));
      }
    }
    return out;
  };
  section.schema = [] {
    Json properties = Json::object();
    for (const effects::EffectType& type : effects::all_effects()) {
      properties[std::string(type.info->id)] = {{"type", "object"},
                                                {"description", std::string(type.info->name) + ": " + std::string(type.info->equation)},
                                                {"additionalProperties", false},
                                                {"properties", effect_parameters_schema(std::string(type.info->id))}};
    }
    return Json{{"type", "object"},
                {"description", "missing physics that is switched on: id and its parameters"},
                {"additionalProperties", false},
                {"properties", properties}};
  };
  return section;
}

}  // namespace terrode::scenario
