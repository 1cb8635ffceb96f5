#include "effects/catalogue.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace terrode::effects {
namespace {

std::string number(double v) {
  if (std::isinf(v)) return v > 0 ? "infinity" : "-infinity";
  return fmt::format("{:.4g}", v);
}

std::string sign(int s) { return s > 0 ? "+" : s < 0 ? "-" : "0"; }

// Two digits, or 0 for what is rounding.
std::string change(double v, double unit) {
  const double x = v / unit;
  return std::abs(x) < 5e-5 ? "0" : fmt::format("{:+.2g}", x);
}

// The name of a heading as Markdown renderers write it.
std::string anchor(std::string_view id) {
  std::string out(id);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

std::string join(const std::vector<std::string_view>& words) { return fmt::format("{}", fmt::join(words, ", ")); }

std::string quantity(double v, std::string_view unit) {
  return unit == "-" ? number(v) : fmt::format("{} {}", number(v), unit);
}

}  // namespace

bekker::WheelSize reference_wheel() { return {0.13, 0.16}; }

bekker::Soil reference_soil() {
  bekker::Soil out;
  out.shear_modulus = 0.008;
  return out;
}

bekker::Operating reference_operating() {
  bekker::Operating out;
  out.slip = 0.3;
  out.normal_load = 115.0;
  out.angular_velocity = 0.3;
  out.position = 0.2;
  out.time = 5.0;
  out.pass = 3;
  out.wheel_angle = 3.0;
  out.travel_length = 0.7;
  return out;
}

Reading reference_change(const EffectType& type) {
  const EffectSet set(std::map<std::string, std::map<std::string, double>>{{std::string(type.info->id), {}}});
  const bekker::SteadyWheel plain(reference_wheel(), reference_soil(), {});
  const bekker::SteadyWheel changed(reference_wheel(), reference_soil(), {}, {nullptr, nullptr, set.modifiers()});
  const Reading a = steady_reading(plain, EffectSet(), reference_operating());
  const Reading b = steady_reading(changed, set, reference_operating());
  return {b.drawbar_pull - a.drawbar_pull, b.driving_torque - a.driving_torque, b.sinkage - a.sinkage,
          b.normal_load - a.normal_load};
}

std::string varies_with(const Fingerprint& f) {
  std::vector<std::string> out;
  if (f.with_speed) out.emplace_back("speed");
  if (f.with_pass) out.emplace_back("pass");
  if (f.with_position) out.emplace_back("position");
  if (f.with_time) out.emplace_back("time");
  if (f.with_angle) out.emplace_back("wheel angle");
  return fmt::format("{}", fmt::join(out, ", "));
}

const char* scale_name(Scale scale) {
  switch (scale) {
    case Scale::linear:
      return "linear";
    case Scale::log:
      return "log";
    case Scale::inverse:
      return "inverse";
    case Scale::choice:
      return "choice";
  }
  return "";
}

std::vector<std::vector<std::string>> catalogue_rows() {
  std::vector<std::vector<std::string>> rows = {{"effect", "class", "pull", "torque", "sinkage", "varies with", "parameters"}};
  for (const EffectType& t : all_effects()) {
    const Fingerprint& f = t.info->fingerprint;
    std::vector<std::string_view> names;
    for (const Parameter& p : t.info->parameters) names.push_back(p.name);
    rows.push_back({std::string(t.info->id), class_name(t.info->cls), sign(f.pull), sign(f.torque), sign(f.sinkage), varies_with(f), join(names)});
  }
  return rows;
}

std::string catalogue_entry(const EffectType& type) {
  const Info& i = *type.info;
  const Reading d = reference_change(type);
  std::string out = fmt::format("{} ({}): {}\n\n{}\n\n", i.id, class_name(i.cls), i.name, i.physics);
  const auto line = [&out](const char* head, const std::string& text) { out += fmt::format("{:<15}{}\n", head, text); };
  line("equation", std::string(i.equation));
  line("source", std::string(i.source));
  line("acts on", std::string(i.hook));
  for (const Parameter& p : i.parameters)
    line(p.strength ? "strength" : "parameter",
         fmt::format("{}: {}; off at {}, from {} to {}, typically {}", p.name, p.meaning,
                     p.strength ? quantity(p.null_value, p.unit) : "no value", number(p.lower), quantity(p.upper, p.unit),
                     quantity(p.typical, p.unit)));
  line("fingerprint", std::string(i.fingerprint.text));
  line("", fmt::format("typically {} N, {} N m, {} mm at the reference", change(d.drawbar_pull, 1), change(d.driving_torque, 1),
                       change(d.sinkage, 1e-3)));
  if (!varies_with(i.fingerprint).empty()) line("varies with", varies_with(i.fingerprint));
  if (!i.confused_with.empty()) line("confused with", join(i.confused_with));
  line("told apart by", std::string(i.separated_by));
  if (!i.parts_in_time.empty()) line("in time", std::string(i.parts_in_time));
  if (!i.energy.empty()) line("energy", std::string(i.energy));
  return out;
}

std::string catalogue_markdown() {
  std::string out =
      "# Missing physics\n\n"
      "<!-- Written by `terrode effects --markdown > docs/effects.md`; a test compares. Edit src/effects/ instead. -->\n\n"
      "What a model of a wheel on soil may leave out, as parts that a scenario switches on by id:\n\n"
      "```yaml\neffects: {slip_sinkage: {n1: 0.4}, slope: {angle: 1.5 deg}}\n```\n\n"
      "An effect that is named without its parameters has its typical strength; at its null value it leaves every number bit\n"
      "for bit as it was. Several effects act in the order of the table, whatever their order in a file: first contact geometry\n"
      "and load, then the soil's parameters, pressure, shear, wedges, the bed, then rig and sensors. Effects of soil, wheel and\n"
      "wedges change the stress at each point of the contact: the steady wheel integrates it, every node of the node-spring\n"
      "ground evaluates it. A bed effect is the height of the ground in time series and its quasi-static consequence in the\n"
      "steady wheel. Effects of rig and sensors change what is measured, and nothing else. Ripples average to zero in means.\n"
      "`docs/effects-agreement.md` holds both methods against each other.\n\n"
      "Energy: with effects of soil, wheel and wedges the power that the wheel takes less the power that it gives still is what\n"
      "compaction, sliding, soil pushed in front and sliding behind lugs take; a bed gives or takes what the wheel's fall or rise\n"
      "does; a slope likewise; friction of drive and guide is heat in the rig. Bias, gain, cross-talk, drift, lag, datum and\n"
      "resonance are errors of reading: a balance of what was measured misses them, and no energy flows.\n\n"
      "The changes are those of a wheel of 130 mm by 160 mm at s = 0.3 and 0.3 rad/s under 115 N on Mojave Martian Simulant with\n"
      "K = 8 mm, third pass, 0.2 m along a run of 0.7 m, 5 s after its start, with the effect at its typical strength, by the\n"
      "steady wheel. `docs/adding-an-effect.md` shows how to add one.\n\n"
      "| effect | class | dDP [N] | dT [N m] | dz [mm] | varies with |\n|---|---|---|---|---|---|\n";
  for (const EffectType& t : all_effects()) {
    const Reading d = reference_change(t);
    out += fmt::format("| [`{}`](#{}) | {} | {} | {} | {} | {} |\n", t.info->id, anchor(t.info->id), class_name(t.info->cls), change(d.drawbar_pull, 1),
                       change(d.driving_torque, 1), change(d.sinkage, 1e-3), varies_with(t.info->fingerprint));
  }
  for (const EffectType& t : all_effects()) {
    const Info& i = *t.info;
    out += fmt::format("\n## {}\n\n**{}** ({}). {}\n\n", i.id, i.name, class_name(i.cls), i.physics);
    out += fmt::format("`{}`\n\n", i.equation);
    out += "| parameter | unit | meaning | off at | bounds | typical |\n|---|---|---|---|---|---|\n";
    for (const Parameter& p : i.parameters)
      out += fmt::format("| `{}` | {} | {} | {} | {} to {} | {} |\n", p.name, p.unit, p.meaning, p.strength ? number(p.null_value) : "",
                         number(p.lower), number(p.upper), number(p.typical));
    out += fmt::format("\n* Acts on: {}.\n* Fingerprint: {}.\n", i.hook, i.fingerprint.text);
    if (!i.confused_with.empty()) {
      out += "* Confused with: ";
      for (std::size_t k = 0; k < i.confused_with.size(); ++k)
        out += fmt::format("{}[`{}`](#{})", k ? ", " : "", i.confused_with[k], anchor(i.confused_with[k]));
      out += ".\n";
    }
    out += fmt::format("* Told apart by: {}.\n* Source: {}.\n", i.separated_by, i.source);
    if (!i.energy.empty()) out += fmt::format("* Energy: {}.\n", i.energy);
  }
  return out;
}

}  // namespace terrode::effects
