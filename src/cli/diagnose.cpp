#include "diagnosis/diagnose.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>

#include "cli/replay.h"
#include "cli/terminal.h"
#include "report/page.h"
#include "scenario/recording_file.h"
#include "scenario/scenario.h"

namespace terrode::cli {
namespace {

namespace fs = std::filesystem;
using diagnosis::Diagnosis;
using diagnosis::kChannels;

struct DiagnoseArguments {
  std::string recording, reference, scenario, folder;
  std::vector<std::string> without;
  bool no_replay = false;
};

Json pair_json(const std::pair<double, double>& p) { return Json::array({number(p.first), number(p.second)}); }

Json diagnosis_json(const Diagnosis& d) {
  Json out;
  out["format"] = "diagnosis/1";
  out["recording"] = d.title;
  out["verdict"] = d.verdict;
  out["statement"] = d.statement;
  out["located"] = Json::array();
  for (const auto& l : d.located) {
    Json where = Json::object();
    for (const auto& [key, range] : l.where) where[key] = pair_json(range);
    out["located"].push_back({{"channel", l.channel}, {"where", where}, {"size", number(l.size)}, {"unit", l.unit}, {"significance", number(l.significance)}});
  }
  out["effects"] = Json::array();
  for (const auto& f : d.effects) {
    Json parameters = Json::object();
    for (const auto& [name, e] : f.parameters) parameters[name] = {{"value", number(e.value)}, {"std", number(e.deviation)}, {"unit", e.unit}};
    Json share = Json::object();
    for (const auto& [id, p] : f.share) share[id] = number(p);
    Json change = Json::object();
    for (int c = 0; c < kChannels; ++c) change[diagnosis::channel_name(c)] = {{"rms", number(f.change[static_cast<std::size_t>(c)])}, {"unit", diagnosis::channel_unit(c)}};
    out["effects"].push_back({{"ids", f.ids}, {"probability", number(f.probability)}, {"class", f.cls}, {"parameters", parameters},
                              {"equation", f.equation}, {"source", f.source}, {"statement", f.statement}, {"share", share}, {"change", change}});
  }
  out["parameters"] = Json::object();
  for (const auto& p : d.parameters)
    out["parameters"][p.name] = {{"believed", number(p.believed)}, {"fitted", number(p.fitted)}, {"std", number(p.deviation)}, {"unit", p.unit}, {"refitted_plain", number(p.refitted)}};
  out["unexplained"] = {{"significant", d.unexplained}, {"fraction", number(d.unexplained_fraction)}, {"form", d.unexplained_form.empty() ? Json(nullptr) : Json(d.unexplained_form)}};
  out["fit"] = Json::object();
  for (int c = 0; c < kChannels; ++c) {
    const auto& f = d.fit[static_cast<std::size_t>(c)];
    if (!f.present) continue;
    out["fit"][diagnosis::channel_name(c)] = {{"rmse_before", number(f.rmse_before)}, {"rmse_after", number(f.rmse_after)}, {"heldout_rmse_before", number(f.heldout_before)},
                                              {"heldout_rmse_after", number(f.heldout_after)}, {"noise_floor", number(f.noise_floor)}, {"unit", diagnosis::channel_unit(c)}};
  }
  out["next_experiments"] = Json::array();
  for (const auto& e : d.next_experiments) out["next_experiments"].push_back({{"design", e.design}, {"separates", e.separates}});
  // Beyond the contract.
  out["prediction"] = {{"text", d.prediction}, {"held", d.prediction_held}};
  out["detectable"] = Json::object();
  for (const auto& [key, e] : d.detectable) out["detectable"][key] = {{"value", number(e.value)}, {"unit", e.unit}};
  out["candidates"] = Json::array();
  for (const auto& c : d.candidates) {
    Json misfit = Json::array();
    for (const double m : c.misfit) misfit.push_back(number(m));
    out["candidates"].push_back({{"label", c.label}, {"log_evidence", number(c.log_evidence)}, {"chi2_gain", number(c.chi2_gain)}, {"misfit", misfit},
                                 {"priors", number(c.penalty)}, {"occam", number(c.occam)}});
  }
  out["growth"] = Json::array();
  for (const auto& g : d.growth) {
    Json lack = Json::object();
    for (int c = 0; c < kChannels; ++c)
      lack[diagnosis::channel_name(c)] = {{"before", number(g.before[static_cast<std::size_t>(c)])}, {"after", number(g.after[static_cast<std::size_t>(c)])}};
    out["growth"].push_back({{"label", g.label}, {"support", number(g.support)}, {"misfit_over_scatter", lack}});
  }
  out["blocks"] = Json::array();
  for (const auto& b : d.blocks) {
    Json rmse = Json::object();
    for (int c = 0; c < kChannels; ++c) rmse[diagnosis::channel_name(c)] = {{"before", number(b.before[static_cast<std::size_t>(c)])}, {"after", number(b.after[static_cast<std::size_t>(c)])}};
    out["blocks"].push_back({{"held_out", b.name}, {"runs", b.runs}, {"rmse", rmse}});
  }
  out["ripples"] = Json::array();
  for (const auto& r : d.ripples)
    out["ripples"].push_back({{"locked_to", diagnosis::lock_name(r.lock)}, {"order", number(r.order)}, {"wavelength", number(r.wavelength)}, {"frequency", number(r.frequency)},
                              {"drawbar_amplitude", number(r.amplitude[0])}, {"relative", number(r.relative)}, {"significance", number(r.deviations)}});
  out["noise"] = {{"ln_k", number(d.noise.ln_k)}, {"friction_angle", number(d.noise.phi)}, {"sinkage_datum", number(d.noise.datum)}, {"from_replicates", d.noise.from_replicates}};
  out["gate"] = {{"false_alarm_rate", number(d.false_alarm_rate)}, {"threshold", number(d.gate)}, {"statistic", number(d.gate_statistic)}};
  out["remarks"] = d.remarks;
  return out;
}

// The scenario with the found physics switched on, complete in itself.
std::string corrected_yaml(const recording::Recording& recording, const Diagnosis& d) {
  scenario::Scenario s = corrected_scenario(recording, d.soil, d.angles, {});
  s.title = d.title + ", corrected";
  std::string out = scenario::to_yaml(s);
  if (!out.empty() && out.back() != '\n') out += '\n';
  if (!d.corrected_effects.empty()) {
    out += "effects:\n";
    for (const auto& [id, values] : d.corrected_effects) {
      out += "  " + id + ":\n";
      for (const auto& [name, v] : values) out += fmt::format("    {}: {:.9g}\n", name, v);
    }
  }
  return out;
}

std::string where_text(const diagnosis::Located& l) {
  std::string out;
  for (const auto& [key, r] : l.where) out += fmt::format("{}{} {:.4g}{}", out.empty() ? "" : ", ", key, r.first, r.second != r.first ? fmt::format(" to {:.4g}", r.second) : "");
  return out;
}

// Runs kept out of both fits, as the wheel on ODE drives them.
Json replay_json(const Diagnosis& d, const ReplayResult& r) {
  Json out = {{"held_out", d.replay.held_out}, {"method", "node-spring"}, {"conditions", r.points.size()}, {"failed", r.failed}};
  out["rmse"] = Json::object();
  for (std::size_t c = 0; c < kChannels; ++c)
    if (d.fit[c].present)
      out["rmse"][diagnosis::channel_name(static_cast<int>(c))] = {{"before", number(r.rmse_before[c])}, {"after", number(r.rmse_after[c])}, {"unit", diagnosis::channel_unit(static_cast<int>(c))}};
  return out;
}

void add_replay(report::Page& page, const Diagnosis& d, const ReplayResult& r) {
  if (r.points.empty()) return;
  page.section("The correction at work: " + d.replay.held_out);
  page.text("The single-wheel rig on ODE over the node-spring ground at conditions that took no part in either fit, by the plain model with its parameters refitted and by the corrected one.");
  report::Table t;
  t.columns = {{"slip", "", 3}, {"load", "N", 4}, {"speed", "rad/s", 3}, {"pass", "", 2}};
  for (std::size_t c = 0; c < kChannels; ++c) {
    if (!d.fit[c].present) continue;
    const std::string unit = c == 2 ? "mm" : diagnosis::channel_unit(static_cast<int>(c)), name = diagnosis::channel_name(static_cast<int>(c));
    for (const char* which : {"recording", "plain", "corrected"}) t.columns.push_back({which, unit, 4, name});
  }
  for (const ReplayPoint& p : r.points) {
    std::vector<report::Cell> row = {p.condition.slip, p.condition.normal_load, p.condition.angular_velocity, static_cast<double>(p.condition.pass)};
    for (std::size_t c = 0; c < kChannels; ++c) {
      if (!d.fit[c].present) continue;
      const double scale = c == 2 ? 1e3 : 1.0;
      for (const double v : {p.measured[c], p.before[c], p.after[c]}) row.emplace_back(p.has[c] ? scale * v : std::nan(""));
    }
    t.rows.push_back(std::move(row));
  }
  std::string errors;
  for (std::size_t c = 0; c < kChannels; ++c)
    if (d.fit[c].present)
      errors += fmt::format("{}{} {:.3g} to {:.3g} {}", errors.empty() ? "" : ", ", diagnosis::channel_name(static_cast<int>(c)), (c == 2 ? 1e3 : 1.0) * r.rmse_before[c],
                            (c == 2 ? 1e3 : 1.0) * r.rmse_after[c], c == 2 ? "mm" : diagnosis::channel_unit(static_cast<int>(c)));
  t.caption = "Root mean square error, plain to corrected: " + errors + ".";
  page.table(std::move(t));
}

report::Page page_of(const Diagnosis& d, const ReplayResult& replayed, const std::string& command) {
  report::Page page("Diagnosis: " + d.title);
  page.command(command);
  const report::Mood mood = d.verdict == "no_mismatch" ? report::Mood::good : d.verdict == "unknown" || d.verdict == "undecided" ? report::Mood::warning : report::Mood::neutral;
  page.verdict(mood, d.verdict + ": " + d.statement);
  std::vector<std::pair<std::string, std::string>> facts = {{"runs", fmt::format("{}", d.runs.size())}, {"conditions", fmt::format("{}", d.conditions.size())}};
  for (int c = 0; c < kChannels; ++c) {
    const auto& f = d.fit[static_cast<std::size_t>(c)];
    if (f.present) facts.emplace_back(std::string(diagnosis::channel_name(c)) + ", held-out error", fmt::format("{:.3g} to {:.3g} {}", c == 2 ? 1e3 * f.heldout_before : f.heldout_before, c == 2 ? 1e3 * f.heldout_after : f.heldout_after, c == 2 ? "mm" : diagnosis::channel_unit(c)));
  }
  page.facts(facts);

  page.section("Causes");
  if (d.effects.empty()) page.text("No cause is named.");
  if (!d.effects.empty()) {
    report::Table t;
    t.columns = {{"cause"}, {"probability", "", 2}, {"class"}, {"strength"}, {"law"}, {"source"}};
    for (const auto& f : d.effects) {
      std::string ids, strength;
      for (const auto& id : f.ids) ids += (ids.empty() ? "" : " or ") + id;
      for (const auto& [name, e] : f.parameters) strength += fmt::format("{}{} = {:.3g} ± {:.2g} {}", strength.empty() ? "" : ", ", name, e.value, e.deviation, e.unit == "-" ? "" : e.unit);
      t.rows.push_back({ids, f.probability, f.cls, strength, f.equation, f.source});
    }
    page.table(std::move(t));
  }
  if (d.unexplained) page.callout(report::Mood::warning, "Not explained by any listed effect", d.unexplained_form);
  if (!d.prediction.empty()) page.callout(d.prediction_held ? report::Mood::good : report::Mood::warning, d.prediction_held ? "A prediction that held" : "A prediction that failed", d.prediction);
  for (const auto& e : d.next_experiments) page.callout(report::Mood::neutral, "Next experiment", e.design);

  // Curves over slip at the commonest load, speed and first pass.
  std::map<std::pair<double, double>, int> groups;
  for (const auto& r : d.runs)
    if (r.condition.pass == 1) ++groups[{r.condition.normal_load, r.condition.angular_velocity}];
  page.section("Recording and simulation");
  if (!groups.empty()) {
    const auto main = std::max_element(groups.begin(), groups.end(), [](const auto& a, const auto& b) { return a.second < b.second; })->first;
    std::vector<report::Figure> figures;
    for (int c = 0; c < kChannels; ++c) {
      const auto k = static_cast<std::size_t>(c);
      if (!d.fit[k].present) continue;
      const double scale = c == 2 ? 1e3 : 1.0;
      std::map<double, std::vector<const diagnosis::RunComparison*>> by_slip;
      for (const auto& r : d.runs)
        if (r.has[k] && r.condition.pass == 1 && r.condition.normal_load == main.first && r.condition.angular_velocity == main.second && std::isfinite(r.condition.slip)) by_slip[r.condition.slip].push_back(&r);
      report::Series measured{"recording"}, before{"plain model, refitted"}, after{d.effects.empty() ? "model" : "with the cause"};
      measured.draw = report::Draw::points;
      measured.colour = report::kInk;
      before.dashed = true;
      for (const auto& [slip, runs] : by_slip) {
        double o = 0, b = 0, a = 0, v = 0;
        for (const auto* r : runs) {
          o += r->observed[k];
          b += r->before[k];
          a += r->after[k];
          v += r->deviation[k];
        }
        const double n = static_cast<double>(runs.size());
        measured.x.push_back(slip);
        measured.y.push_back(scale * o / n);
        measured.low.push_back(scale * (o / n - v / n / std::sqrt(n)));
        measured.high.push_back(scale * (o / n + v / n / std::sqrt(n)));
        before.x.push_back(slip);
        before.y.push_back(scale * b / n);
        after.x.push_back(slip);
        after.y.push_back(scale * a / n);
      }
      report::Figure f;
      std::string name = diagnosis::channel_name(c);
      std::replace(name.begin(), name.end(), '_', ' ');
      f.title = fmt::format("{} at {:.4g} N", name, main.first);
      f.x = {"slip ratio", ""};
      f.y = {name, c == 2 ? "mm" : diagnosis::channel_unit(c)};
      f.series = {measured, before, after};
      f.caption = "Bars: expected scatter of the mean of the repeats.";
      figures.push_back(std::move(f));
    }
    page.figures(std::move(figures));
  }
  // Residual maps: conditions across, channels down.
  std::vector<std::string> names;
  std::vector<std::vector<double>> before_rows(kChannels), after_rows(kChannels);
  for (const auto& q : d.conditions) {
    names.push_back(fmt::format("s {:.2g}, {:.4g} N, {:.3g} rad/s, pass {}", q.slip, q.normal_load, q.angular_velocity, q.pass));
    for (std::size_t k = 0; k < kChannels; ++k) {
      double b = 0, a = 0, n = 0;
      for (const auto& r : d.runs)
        if (r.condition == q && r.has[k]) {
          b += (r.observed[k] - r.before[k]) / r.deviation[k];
          a += (r.observed[k] - r.after[k]) / r.deviation[k];
          ++n;
        }
      before_rows[k].push_back(n > 0 ? b / n : std::nan(""));
      after_rows[k].push_back(n > 0 ? a / n : std::nan(""));
    }
  }
  if (names.size() > 1) {
    page.section("Where they part");
    for (const bool late : {false, true}) {
      report::HeatMap map;
      map.title = late ? "Residuals after" : "Residuals before, plain model refitted";
      map.x_names = names;
      for (int c = 0; c < kChannels; ++c) {
        if (!d.fit[static_cast<std::size_t>(c)].present) continue;
        map.y_names.emplace_back(diagnosis::channel_name(c));
        const auto& row = late ? after_rows[static_cast<std::size_t>(c)] : before_rows[static_cast<std::size_t>(c)];
        map.values.insert(map.values.end(), row.begin(), row.end());
      }
      map.value_label = "recording less model";
      map.value_unit = "deviations";
      map.diverging = true;
      map.width = 1100;
      map.height = 420;
      page.heat_map(std::move(map));
    }
  }
  if (!d.located.empty()) {
    report::Table t;
    t.columns = {{"channel"}, {"where"}, {"size", "", 3}, {"unit"}, {"significance", "deviations", 3}};
    for (const auto& l : d.located) t.rows.push_back({l.channel, where_text(l), l.size, l.unit, l.significance});
    t.caption = "Against the plain model after its parameters were refitted.";
    page.table(std::move(t));
  }
  page.section("What was tried");
  {
    report::Table t;
    t.columns = {{"explanation"}, {"log evidence over the plain model", "nats", 3}, {"chi-square gained", "", 4}};
    for (std::size_t i = 0; i < std::min<std::size_t>(12, d.candidates.size()); ++i) t.rows.push_back({d.candidates[i].label, d.candidates[i].log_evidence, d.candidates[i].chi2_gain});
    t.caption = fmt::format("Something is said to be off from a gain of {:.3g}: at most {:.0f} % false alarms over all effects together.", d.gate, 100 * d.false_alarm_rate);
    page.table(std::move(t));
  }
  if (!d.blocks.empty()) {
    report::Table t;
    t.columns = {{"held out"}, {"runs", "", 3}};
    for (int c = 0; c < kChannels; ++c) {
      const std::string unit = c == 2 ? "mm" : diagnosis::channel_unit(c);
      t.columns.push_back({"before", unit, 3, diagnosis::channel_name(c)});
      t.columns.push_back({"after", unit, 3, diagnosis::channel_name(c)});
    }
    for (const auto& b : d.blocks) {
      std::vector<report::Cell> row = {b.name, static_cast<double>(b.runs)};
      for (std::size_t k = 0; k < kChannels; ++k) {
        row.emplace_back((k == 2 ? 1e3 : 1.0) * b.before[k]);
        row.emplace_back((k == 2 ? 1e3 : 1.0) * b.after[k]);
      }
      t.rows.push_back(std::move(row));
    }
    t.caption = "Root mean square error of runs that took no part in the fit.";
    page.table(std::move(t));
  }
  add_replay(page, d, replayed);
  page.section("Soil parameters");
  {
    report::Table t;
    t.columns = {{"parameter"}, {"unit"}, {"believed", "", 4}, {"refitted, plain model", "", 4}, {"fitted", "", 4}, {"deviation", "", 2}};
    for (const auto& p : d.parameters) t.rows.push_back({p.name, p.unit, p.believed, p.refitted, p.fitted, p.deviation});
    page.table(std::move(t));
  }
  if (d.effects.empty() && !d.detectable.empty()) {
    page.section("What would have been seen");
    report::Table t;
    t.columns = {{"effect"}, {"smallest strength", "", 3}, {"unit"}};
    for (const auto& [key, e] : d.detectable) t.rows.push_back({key, e.value, e.unit});
    page.table(std::move(t));
  }
  if (!d.remarks.empty()) {
    page.section("Remarks");
    page.list(d.remarks);
  }
  return page;
}

// A recording, or a scenario with measured points as one; wheel and believed soil from `other` where a name is given.
recording::Recording load(const std::string& file, const std::string& other, int threads) {
  recording::Recording r;
  if (scenario::is_recording(file)) {
    r = scenario::load_recording(file, threads);
  } else {
    const scenario::Scenario s = scenario::load_scenario(file, threads);
    if (!s.measured) throw InputError(Problem{file, 0, 0, "measured", "is missing: there is nothing to diagnose", "a recording, or a scenario with measured points"});
    r = *s.measured;
    r.wheel.radius = s.wheel.radius;
    r.wheel.width = s.wheel.width;
    r.soil = s.soil;
    for (recording::Run& run : r.runs) {
      if (!run.condition.normal_load) run.condition.normal_load = s.rig.normal_load;
      if (!run.condition.angular_velocity) run.condition.angular_velocity = s.rig.angular_velocity;
    }
    if (r.title.empty()) r.title = s.title;
  }
  if (!other.empty()) {
    const scenario::Scenario s = scenario::load_scenario(other, threads);
    r.wheel.radius = s.wheel.radius;
    r.wheel.width = s.wheel.width;
    r.soil = s.soil;
  }
  return r;
}

void diagnose_command(const DiagnoseArguments& a, Common& common) {
  const recording::Recording recording = load(a.recording, a.scenario, common.threads);
  std::optional<recording::Recording> reference;
  if (!a.reference.empty()) reference = load(a.reference, a.scenario, common.threads);
  std::error_code error;
  fs::create_directories(a.folder, error);
  if (error || !fs::is_directory(a.folder)) throw RunError(fmt::format("{}: cannot make this folder: {}", a.folder, error.message()));
  for (const std::string& id : a.without)
    if (!effects::find_effect(id)) throw InputError(Problem{{}, 0, 0, "--without", fmt::format("names '{}', which is no effect", id), "an id of `terrode effects`"});
  diagnosis::Options options;
  options.seed = common.seed;
  options.threads = common.threads;
  options.without = a.without;
  if (reference) options.reference = &*reference;
  Diagnosis d;
  {
    options.progress = show_progress(common);
    d = diagnosis::diagnose(recording, options);
  }
  const ReplayResult replayed = d.effects.empty() || a.no_replay ? ReplayResult{} : replay(recording, d, common);
  Json json = diagnosis_json(d);
  if (!replayed.points.empty()) json["simulated_in_time"] = replay_json(d, replayed);
  const fs::path folder(a.folder);
  write_text_atomically((folder / "diagnosis.json").string(), json_text(json, 2) + "\n");
  write_text_atomically((folder / "corrected.yaml").string(), corrected_yaml(recording, d));
  report::Page page = page_of(d, replayed, common.command_line);
  page.download("diagnosis.json", json_text(json, 2));
  page.write_html(folder / "report.html");
  if (!common.report.empty()) page.write_html(common.report);
  if (common.json) {
    print_json(json);
    return;
  }
  fmt::print("{}: {}\n", d.verdict, d.statement);
  for (const auto& f : d.effects) fmt::print("  {:.2f}  {}\n", f.probability, f.statement);
  for (int c = 0; c < kChannels; ++c) {
    const auto& f = d.fit[static_cast<std::size_t>(c)];
    if (f.present && !d.blocks.empty())
      fmt::print("  {:<15} held-out error {:.4g} -> {:.4g} {} (noise floor {:.3g})\n", diagnosis::channel_name(c), f.heldout_before, f.heldout_after, diagnosis::channel_unit(c), f.noise_floor);
  }
  for (const auto& e : d.next_experiments) fmt::print("  next experiment: {}\n", e.design);
  for (const std::string& r : d.remarks) note(common, r);
  fmt::print("{}\n", (folder / "report.html").string());
}

}  // namespace

void add_diagnose(Command& app, Common& common) {
  auto a = std::make_shared<DiagnoseArguments>();
  Command* command = app.add_subcommand("diagnose", "where simulation and recording part, what physics was left out, and what modelling it gains");
  command->add_option("RECORDING", a->recording, "a recording (folder or recording.yaml), or a scenario with measured points")->required();
  command->add_option("--scenario", a->scenario, "wheel and believed soil from this scenario instead");
  command->add_option("--reference", a->reference, "a recording of the same soil and conditions whose bed, wheel and rig are known: what differs from it is looked for");
  command->add_option("-o,--output", a->folder, "folder for diagnosis.json, report.html and corrected.yaml")->required();
  command->add_option("--without", a->without, "effects that are not to be considered")->delimiter(',');
  command->add_flag("--no-replay", a->no_replay, "leave out the simulation in time of the block that was held out (half of the time)");
  add_common(*command, common, true);
  command->callback([a, &common] { diagnose_command(*a, common); });
}

}  // namespace terrode::cli
