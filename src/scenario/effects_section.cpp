#include "scenario/section.h"

namespace terrode::scenario {

Section effects_section() {
  Section section;
  section.name = "effects";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    MapReader map(node, key, source);
    for (const Node::Entry& e : node.entries) {
      map.know(e.key);
      MapReader parameters(e.value, map.key(e.key), source);
      out.effects.push_back({e.key, e.value});
    }
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    if (in.effects.empty()) return std::nullopt;
    Node out = Node::map();
    for (const EffectSpec& e : in.effects) out.set(e.id, e.parameters);
    return out;
  };
  section.schema = [] {
    return Json{{"type", "object"},
                {"description", "missing physics that is switched on: id and its parameters"},
                {"additionalProperties", Json{{"type", "object"}}}};
  };
  return section;
}

}  // namespace terrode::scenario
