#include <cstdio>
#include <memory>

#include "cli/effects_agreement.h"
#include "cli/terminal.h"
#include "effects/catalogue.h"

namespace terrode::cli {
namespace {

using effects::EffectType;

Json effect_json(const EffectType& type) {
  const effects::Info& i = *type.info;
  const effects::Fingerprint& f = i.fingerprint;
  Json parameters = Json::array();
  for (const effects::Parameter& p : i.parameters)
    parameters.push_back({{"name", p.name},
                          {"unit", p.unit},
                          {"meaning", p.meaning},
                          {"strength", p.strength},
                          {"null_value", number(p.null_value)},
                          {"lower", number(p.lower)},
                          {"upper", number(p.upper)},
                          {"typical", number(p.typical)},
                          {"prior_scale", number(p.prior_scale)},
                          {"scale", effects::scale_name(p.scale)}});
  const effects::Reading d = effects::reference_change(type);
  return {{"id", i.id},
          {"class", effects::class_name(i.cls)},
          {"name", i.name},
          {"physics", i.physics},
          {"equation", i.equation},
          {"source", i.source},
          {"hook", i.hook},
          {"parameters", parameters},
          {"fingerprint",
           {{"drawbar_pull", f.pull},
            {"driving_torque", f.torque},
            {"sinkage", f.sinkage},
            {"with_speed", f.with_speed},
            {"with_pass", f.with_pass},
            {"with_position", f.with_position},
            {"with_time", f.with_time},
            {"with_wheel_angle", f.with_angle},
            {"text", f.text}}},
          {"reference_change",
           {{"drawbar_pull", number(d.drawbar_pull)}, {"driving_torque", number(d.driving_torque)}, {"sinkage", number(d.sinkage)}}},
          {"confused_with", i.confused_with},
          {"separated_by", i.separated_by},
          {"parts_in_time", i.parts_in_time},
          {"energy", i.energy}};
}

Json reading_json(const effects::Reading& r) {
  return {{"drawbar_pull", number(r.drawbar_pull)}, {"driving_torque", number(r.driving_torque)}, {"sinkage", number(r.sinkage)}};
}

void agreement(const Common& common) {
  const std::vector<Agreement> rows = effects_agreement(common.threads);
  if (!common.json) {
    std::fputs(agreement_markdown(rows, effects_without_reason(common.threads)).c_str(), stdout);
    return;
  }
  Json all = Json::array();
  for (const Agreement& r : rows) {
    if (!r.error.empty()) {
      all.push_back({{"id", r.id}, {"error", r.error}});
      continue;
    }
    all.push_back({{"id", r.id},
                   {"steady", reading_json(r.steady)},
                   {"node_spring", reading_json(r.node_spring)},
                   {"ripple", reading_json(r.ripple)},
                   {"gap", number(r.gap)},
                   {"reason", effects::find_effect(r.id)->info->parts_in_time}});
  }
  print_json({{"effects", all}});
}

void list(const std::string& id, bool markdown, const Common& common) {
  std::vector<EffectType> chosen = effects::all_effects();
  if (!id.empty()) {
    const EffectType* one = effects::find_effect(id);
    if (!one) {
      std::vector<std::string> ids;
      for (const EffectType& t : effects::all_effects()) ids.emplace_back(t.info->id);
      const std::string near = nearest_word(id, ids);
      throw InputError({{}, 0, 0, "effect", "is '" + id + "', which is no effect", near.empty() ? "an id that 'terrode effects' lists" : near});
    }
    chosen = {*one};
  }
  if (markdown) {
    std::fputs(effects::catalogue_markdown().c_str(), stdout);
  } else if (common.json) {
    Json all = Json::array();
    for (const EffectType& t : chosen) all.push_back(effect_json(t));
    print_json({{"effects", all}});
  } else if (!id.empty()) {
    std::fputs(effects::catalogue_entry(chosen.front()).c_str(), stdout);
  } else {
    std::fputs(aligned(effects::catalogue_rows()).c_str(), stdout);
  }
}

}  // namespace

void add_effects(Command& app, Common& common) {
  Command* command = app.add_subcommand("effects", "the missing-physics parts: law, parameters, fingerprint, source");
  const auto id = std::make_shared<std::string>();
  const auto markdown = std::make_shared<bool>(false);
  command->add_option("ID", *id, "one effect in full; none: a table of all")->type_name("");
  command->add_flag("--markdown", *markdown, "the page docs/effects.md");
  const auto both = std::make_shared<bool>(false);
  command->add_flag("--agreement", *both, "what each changes in the steady wheel and in a node-spring run: the page docs/effects-agreement.md");
  add_common(*command, common, false);
  for (const EffectType& t : effects::all_effects()) common.words["effects ID"].emplace_back(t.info->id);
  command->callback([id, markdown, both, &common] {
    if (*both) agreement(common);
    else list(*id, *markdown, common);
  });
}

}  // namespace terrode::cli
