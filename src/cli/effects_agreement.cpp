#include "cli/effects_agreement.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "core/parallel.h"
#include "effects/steady_reading.h"
#include "scenario/methods.h"

namespace terrode::cli {
namespace {

constexpr const char* kScenario = R"(title: effects by two methods
wheel: {radius: 130 mm, width: 160 mm, mass: 3.2 kg}
soil:
  bulk_density: 1600
  bekker: {cohesion: 139.28, friction_angle: 0.606, shear_modulus: 8 mm, k: 2.541e5, n: 1.387, plate_width: 50 mm}
  contact: {a0: 0.18, a1: 0.32, theta_r: 0}
rig: {normal_load: 115 N, angular_velocity: 0.3, travel: 240 mm, ramp: 0.02 s, time_step: 2 ms}
terrain: {node_spacing: 10 mm}
sweep: {slips: [0.3]}
)";
constexpr double kSmall = 0.2;  // of the largest change: what a channel is held against where it hardly changes

using Channels = std::array<double, 4>;

Channels channels(const effects::Reading& r) { return {r.drawbar_pull, r.driving_torque, r.sinkage, r.normal_load}; }

// The middle third of a run, at equal steps of the way.
struct Window {
  std::vector<Channels> samples;
  std::vector<std::array<double, 3>> at;  // time [s], position [m], wheel angle [rad]
  Channels mean{};
};

Window window_of(const recording::Run& run, double travel) {
  namespace ch = recording::channel;
  const recording::Channel *position = run.find("position"), *angle = run.find("wheel_angle");
  const std::array<const recording::Channel*, 4> shown = {run.find(ch::drawbar_pull), run.find(ch::driving_torque), run.find(ch::sinkage),
                                                          run.find(ch::normal_load)};
  Window out;
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    const double x = position->values[i];
    if (x < travel / 3.0 || x >= 2.0 * travel / 3.0) continue;
    Channels c{};
    for (std::size_t k = 0; k < c.size(); ++k) c[k] = shown[k]->values[i];
    out.samples.push_back(c);
    out.at.push_back({run.time[i], x, angle->values[i]});
  }
  for (const Channels& c : out.samples)
    for (std::size_t k = 0; k < c.size(); ++k) out.mean[k] += c[k] / static_cast<double>(out.samples.size());
  return out;
}

struct Both {
  Channels steady{};
  Channels steady_ripple{};  // deviation over the window
  Window node_spring;
};

// Standard deviations about a mean.
Channels deviations(const std::vector<Channels>& samples, const Channels& mean) {
  Channels out{};
  for (const Channels& s : samples)
    for (std::size_t c = 0; c < out.size(); ++c) out[c] += (s[c] - mean[c]) * (s[c] - mean[c]) / static_cast<double>(samples.size());
  for (double& d : out) d = std::sqrt(d);
  return out;
}

// By both methods. The steady wheel of an effect that varies along the run is solved at each of its places, times and
// angles, and averaged.
Both by_both(scenario::Scenario s, const effects::EffectType* effect, int pass, const std::map<std::string, double>& parameters = {}) {
  if (effect) s.effects.push_back({std::string(effect->info->id), parameters});
  scenario::OperatingPoint at = s.operating_points().front();
  at.pass = pass;
  Both out;
  out.node_spring = window_of(scenario::make_method("node-spring", s).run(scenario::condition_of(at, s.wheel.radius), {}).run, s.rig.travel);
  const effects::EffectSet set = scenario::effect_set(s);
  const bekker::SteadyWheel wheel(s.wheel_size(), s.bekker_soil(), s.contact_angles(), {nullptr, nullptr, set.modifiers()});
  bekker::Operating o;
  o.slip = at.slip;
  o.normal_load = at.normal_load;
  o.angular_velocity = at.angular_velocity;
  o.pass = pass;
  o.travel_length = s.rig.travel;
  const bool varies = effect && (effect->info->fingerprint.with_position || effect->info->fingerprint.with_time || effect->info->fingerprint.with_angle);
  if (!varies) {
    out.steady = channels(effects::steady_reading(wheel, set, o));
    return out;
  }
  std::vector<Channels> instants;
  for (const auto& [time, position, angle] : out.node_spring.at) {
    o.time = time;
    o.position = position;
    o.wheel_angle = angle;
    const Channels c = channels(effects::reading_at(wheel, set, o));
    instants.push_back(c);
    for (std::size_t k = 0; k < c.size(); ++k) out.steady[k] += c[k] / static_cast<double>(out.node_spring.at.size());
  }
  out.steady_ripple = deviations(instants, out.steady);
  return out;
}

// What an effect changes by each method, and by how much they differ.
void compare(const Both& base, const Both& with, double radius, Agreement& row) {
  Channels steady = with.steady, node = with.node_spring.mean;
  std::vector<Channels> changes;
  for (std::size_t c = 0; c < steady.size(); ++c) {
    steady[c] -= base.steady[c];
    node[c] -= base.node_spring.mean[c];
  }
  for (std::size_t i = 0; i < std::min(with.node_spring.samples.size(), base.node_spring.samples.size()); ++i) {
    changes.emplace_back();
    for (std::size_t c = 0; c < node.size(); ++c) changes.back()[c] = with.node_spring.samples[i][c] - base.node_spring.samples[i][c];
  }
  const Channels ripple = deviations(changes, node);
  row.steady = {steady[0], steady[1], steady[2], steady[3]};
  row.node_spring = {node[0], node[1], node[2], node[3]};
  row.ripple = {ripple[0], ripple[1], ripple[2], ripple[3]};
  const double load = base.steady[3];
  const Channels unit = {load, load * radius, base.steady[2], load};
  double largest = 0.0;
  Channels change{};
  for (std::size_t c = 0; c < 3; ++c) {
    change[c] = std::max(std::abs(steady[c]), ripple[c]) / unit[c];
    largest = std::max(largest, change[c]);
  }
  for (std::size_t c = 0; c < 3 && largest > 0.0; ++c)
    row.gap = std::max(row.gap, std::abs(node[c] - steady[c]) / unit[c] / std::max(change[c], kSmall * largest));
}

// How the reason for which an effect parts is taken away.
struct Remedy {
  const char* id;
  const char* effect;
  std::map<std::string, double> parameters;
  double travel;  // m
  bool ripple;    // what is compared is the largest ripple over the channels, not means
  const char* how;
};

const std::vector<Remedy>& remedies() {
  static const std::vector<Remedy> out = {
      {"multi_pass", "plate_scale", {{"factor", 1.0 + 0.8 * (1.0 - std::exp(-1.0 / 1.5))}}, 0.24, false,
       "k of the second pass on ground without a rut"},
      {"density_gradient", "density_gradient", {}, 1.44, false, "six times as far along, where the same lag is a smaller part of the change"},
      {"run_in", "run_in", {{"length", 1.0}}, 0.24, false, "a length of 1 m, many contacts long"},
      {"periodic_failure", "periodic_failure", {}, 0.24, true, "the deviation of the ripple in place of its mean"},
      {"undulation", "undulation", {{"wavelength", 2.0}}, 0.24, false, "a wave of 2 m, forty contacts long"},
  };
  return out;
}

std::string number(double v, double unit) {
  const double x = v / unit;
  return std::abs(x) < 5e-4 ? "0" : fmt::format("{:+.3g}", x);
}

}  // namespace

std::vector<Agreement> effects_agreement(int threads) {
  const scenario::Scenario scenario = scenario::parse_scenario(kScenario, "effects by two methods");
  const auto& types = effects::all_effects();
  const auto pass_of = [](const effects::EffectType& t) { return t.info->fingerprint.with_pass ? 2 : 1; };
  std::array<Both, 2> plain;  // first and second pass
  std::vector<Agreement> rows(types.size());
  std::vector<Both> changed(types.size());
  parallel_for(types.size() + plain.size(), threads, [&](std::size_t i) {
    if (i < plain.size()) {
      plain[i] = by_both(scenario, nullptr, static_cast<int>(i) + 1);
      return;
    }
    const std::size_t k = i - plain.size();
    rows[k].id = types[k].info->id;
    try {
      changed[k] = by_both(scenario, &types[k], pass_of(types[k]));
    } catch (const std::exception& e) {
      rows[k].error = e.what();
    }
  });
  for (std::size_t k = 0; k < rows.size(); ++k) {
    Agreement& row = rows[k];
    if (!row.error.empty()) continue;
    const Both& base = plain[static_cast<std::size_t>(pass_of(types[k]) - 1)];
    compare(base, changed[k], scenario.wheel.radius, row);
  }
  return rows;
}

std::vector<ReasonAway> effects_without_reason(int threads) {
  const scenario::Scenario scenario = scenario::parse_scenario(kScenario, "effects by two methods");
  std::vector<ReasonAway> out(remedies().size());
  parallel_for(out.size(), threads, [&](std::size_t i) {
    const Remedy& r = remedies()[i];
    out[i].id = r.id;
    out[i].how = r.how;
    try {
      scenario::Scenario s = scenario;
      s.rig.travel = r.travel;
      const Both base = by_both(s, nullptr, 1), with = by_both(s, effects::find_effect(r.effect), 1, r.parameters);
      Agreement row;
      compare(base, with, s.wheel.radius, row);
      out[i].gap = row.gap;
      if (!r.ripple) return;
      const Channels node = {row.ripple.drawbar_pull, row.ripple.driving_torque, row.ripple.sinkage, row.ripple.normal_load};
      const double load = base.steady[3];
      const Channels unit = {load, load * s.wheel.radius, base.steady[2], load};
      double largest = 0.0;
      for (std::size_t c = 0; c < 3; ++c) {
        if (with.steady_ripple[c] / unit[c] <= largest) continue;
        largest = with.steady_ripple[c] / unit[c];
        out[i].gap = std::abs(node[c] / with.steady_ripple[c] - 1.0);
      }
    } catch (const std::exception& e) {
      out[i].error = e.what();
    }
  });
  return out;
}

std::string agreement_markdown(const std::vector<Agreement>& rows, const std::vector<ReasonAway>& without) {
  std::string out = fmt::format(
      "# Effects by two methods\n\n"
      "<!-- Written by `terrode effects --agreement > docs/effects-agreement.md`; a test compares. -->\n\n"
      "What each effect at its typical strength changes in the steady wheel and in the mean of a node-spring run: wheel of 130 mm\n"
      "by 160 mm at slip 0.3 and 0.3 rad/s under 115 N on Mojave Martian Simulant with K = 8 mm; first pass (`multi_pass`: second);\n"
      "240 mm over nodes 10 mm apart, averaged over the middle third; the steady wheel of an effect that varies along the run is\n"
      "solved at each of its places, times and angles there. The gap is the largest difference between the two over the three\n"
      "channels, of the channel's own change: of its mean or of its ripple, whichever is larger; of a fifth of the largest\n"
      "change where a channel hardly changes. Both agree within {:.0f} % of the change but where a reason stands below the table.\n\n"
      "| effect | steady dDP [N] | dT [N m] | dz [mm] | node-spring dDP [N] | dT [N m] | dz [mm] | gap |\n|---|---|---|---|---|---|---|---|\n",
      100 * kAgreement);
  for (const Agreement& r : rows) {
    if (!r.error.empty()) {
      out += fmt::format("| `{}` | | | | | | | {} |\n", r.id, r.error);
      continue;
    }
    out += fmt::format("| `{}` | {} | {} | {} | {} | {} | {} | {:.1f} % |\n", r.id, number(r.steady.drawbar_pull, 1), number(r.steady.driving_torque, 1),
                       number(r.steady.sinkage, 1e-3), number(r.node_spring.drawbar_pull, 1), number(r.node_spring.driving_torque, 1),
                       number(r.node_spring.sinkage, 1e-3), 100 * r.gap);
  }
  out += "\n";
  for (const effects::EffectType& t : effects::all_effects())
    if (!t.info->parts_in_time.empty()) out += fmt::format("* `{}`: {}.\n", t.info->id, t.info->parts_in_time);
  out += fmt::format("\nThe reasons are measured: with a reason taken away the two agree within {:.0f} %.\n\n| effect | in its place | gap |\n|---|---|---|\n",
                     100 * kAgreement);
  for (const ReasonAway& w : without)
    out += fmt::format("| `{}` | {} | {} |\n", w.id, w.how, w.error.empty() ? fmt::format("{:.1f} %", 100 * w.gap) : w.error);
  return out;
}

}  // namespace terrode::cli
