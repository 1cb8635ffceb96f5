#include "effects/effect.h"

#include <fmt/format.h>

#include <cmath>

namespace terrode::effects {

const char* class_name(Class c) {
  switch (c) {
    case Class::compaction:
      return "compaction";
    case Class::shear:
      return "shear";
    case Class::wedge:
      return "wedge";
    case Class::bed:
      return "bed";
    case Class::wheel:
      return "wheel";
    case Class::rig:
      return "rig";
    case Class::numerics:
      return "numerics";
  }
  return "";
}

bool Effect::is_null() const {
  for (std::size_t i = 0; i < values_.size(); ++i)
    if (info_->parameters[i].strength && values_[i] == info_->parameters[i].null_value) return true;
  return false;
}

const EffectType* find_effect(const std::string& id) {
  for (const EffectType& t : all_effects())
    if (t.info->id == id) return &t;
  return nullptr;
}

EffectSet::EffectSet(const std::map<std::string, std::map<std::string, double>>& wanted) {
  Problems problems;
  std::vector<std::string> ids;
  for (const EffectType& t : all_effects()) ids.emplace_back(t.info->id);
  for (const auto& [id, given] : wanted) {
    if (find_effect(id)) continue;
    const std::string near = nearest_word(id, ids);
    problems.push_back({{},
                        0,
                        0,
                        "effects." + id,
                        "is no effect",
                        near.empty() ? "an id of `terrode effects`" : "'" + near + "' perhaps"});
  }
  for (const EffectType& t : all_effects()) {
    const auto found = wanted.find(std::string(t.info->id));
    if (found == wanted.end()) continue;
    std::vector<double> values;
    std::vector<std::string> names;
    for (const Parameter& p : t.info->parameters) {
      names.emplace_back(p.name);
      const auto v = found->second.find(names.back());
      const double value = v == found->second.end() ? p.typical : v->second;
      if (!(value == p.null_value || (value >= p.lower && value <= p.upper)))
        problems.push_back({{},
                            0,
                            0,
                            fmt::format("effects.{}.{}", t.info->id, p.name),
                            fmt::format("is {} {}", value, p.unit),
                            fmt::format("from {} to {} {}", p.lower, p.upper, p.unit)});
      if (p.scale == Scale::choice && value != std::floor(value))
        problems.push_back({{},
                            0,
                            0,
                            fmt::format("effects.{}.{}", t.info->id, p.name),
                            fmt::format("is {}", value),
                            "a whole number"});
      values.push_back(value);
    }
    for (const auto& [name, value] : found->second) {
      bool known = false;
      for (const std::string& n : names) known = known || n == name;
      if (!known)
        problems.push_back({{},
                            0,
                            0,
                            fmt::format("effects.{}.{}", t.info->id, name),
                            "is no parameter of this effect",
                            fmt::format("one of {}", fmt::join(names, ", "))});
    }
    if (!problems.empty()) continue;
    std::shared_ptr<const Effect> effect = t.make(std::move(values));
    if (effect->is_null()) continue;
    if (effect->hooks()) modifiers_.push_back(effect.get());
    effects_.push_back(std::move(effect));
  }
  throw_if_any(problems);
}

EffectSet EffectSet::for_ground() const {
  EffectSet out;
  for (const auto& e : effects_) {
    if (e->carried_by_rig()) continue;
    if (e->hooks()) out.modifiers_.push_back(e.get());
    out.effects_.push_back(e);
  }
  return out;
}

bekker::ContactShape EffectSet::carried_by_rig(const bekker::Context& context) const {
  bekker::ContactShape shape{context.radius, context.slip, context.normal_load, 0.0};
  for (const auto& e : effects_)
    if (e->carried_by_rig()) e->contact(context, shape);
  return shape;
}

bool EffectSet::has_bed() const {
  for (const auto& e : effects_)
    if (e->has_bed()) return true;
  return false;
}

double EffectSet::bed_height(double x) const {
  double h = 0;
  for (const auto& e : effects_) h += e->bed_height(x);
  return h;
}

void EffectSet::quasi_static(const Sample& sample, Reading& reading) const {
  for (const auto& e : effects_) e->quasi_static(sample, reading);
}

bool EffectSet::measures() const {
  for (const auto& e : effects_)
    if (e->measures()) return true;
  return false;
}

void EffectSet::measure(const Sample& sample, Reading& reading, std::span<SensorState> states) const {
  for (std::size_t i = 0; i < effects_.size(); ++i) effects_[i]->measure(sample, reading, states[i]);
}

void EffectSet::measure(const Sample& sample, Reading& reading) const {
  for (const auto& e : effects_) {
    SensorState settled;
    e->measure(sample, reading, settled);
  }
}

bool EffectSet::soil_varies() const {
  for (const auto& e : effects_) {
    const Fingerprint& f = e->info().fingerprint;
    if (e->hooks() && (f.with_position || f.with_time || f.with_angle)) return true;
  }
  return false;
}

}  // namespace terrode::effects
