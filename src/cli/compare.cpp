#include "analysis/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "cli/sources.h"
#include "cli/terminal.h"
#include "report/page.h"

namespace terrode::cli {
namespace {

struct Request {
  std::string result, recording, method, columns;
  analysis::CompareOptions options;
};

struct Compared {
  std::string method;
  recording::Recording result;
  analysis::Comparison comparison;
};

Json channel_json(const analysis::ChannelComparison& c) {
  Json out = {{"unit", c.unit},
              {"recorded", {{"mean", number(c.recorded_mean)}, {"std", number(c.recorded_std)}, {"drift", number(c.recorded_drift)}}},
              {"computed", {{"mean", number(c.computed_mean)}, {"std", number(c.computed_std)}, {"drift", number(c.computed_drift)}}},
              {"error", number(c.error)},
              {"error_sem", c.error_sem > 0.0 ? number(c.error_sem) : Json(nullptr)},
              {"area", number(c.area)},
              {"own_area", number(c.own_area)}};
  if (c.recorded_line) out["recorded"]["line"] = number(*c.recorded_line);
  if (c.computed_line) out["computed"]["line"] = number(*c.computed_line);
  if (c.spectral_distance) out["spectral_distance"] = number(*c.spectral_distance);
  if (c.rating)
    out["rating"] = {{"corridor", number(c.rating->corridor)}, {"phase", number(c.rating->phase)}, {"magnitude", number(c.rating->magnitude)},
                     {"slope", number(c.rating->slope)}, {"total", number(c.rating->total)}, {"shift", number(c.rating->shift)}};
  return out;
}

Json slip_json(double slip) { return std::isinf(slip) ? Json("locked") : number(slip); }

Json comparison_json(const Compared& m) {
  Json runs = Json::array();
  for (const analysis::RunComparison& r : m.comparison.runs) {
    Json channels = Json::object();
    for (const auto& [name, c] : r.channels) channels[name] = channel_json(c);
    runs.push_back({{"recorded_run", r.recorded_run}, {"computed_run", r.computed_run}, {"slip", slip_json(r.condition.slip)}, {"interpolated", r.interpolated}, {"channels", std::move(channels)}});
  }
  Json summary = Json::object();
  for (const auto& [name, s] : m.comparison.summary)
    summary[name] = {{"unit", s.unit}, {"pairs", s.pairs}, {"bias", number(s.bias)}, {"rmse", number(s.rmse)}, {"relative_rmse", number(s.relative_rmse)},
                     {"largest_error", number(s.largest_error)}, {"largest_at_slip", slip_json(s.largest_at_slip)}, {"replicate_scatter", number(s.scatter)},
                     {"area", number(s.area)}, {"rating", s.rating > 0.0 ? number(s.rating) : Json(nullptr)}};
  return {{"method", m.method}, {"summary", std::move(summary)}, {"runs", std::move(runs)}, {"unmatched", m.comparison.unmatched}};
}

std::string slip_text(double slip) { return std::isinf(slip) ? "locked" : fmt::format("{:.3g}", slip); }

// Text beside text where the unit makes small numbers: millimetres for lengths.
struct Shown {
  double factor;
  std::string unit;
};
Shown shown_unit(const std::string& channel, const std::string& unit) {
  if (channel == recording::channel::sinkage) return {1e3, "mm"};
  return {1.0, unit};
}

void print_text(const std::vector<Compared>& all) {
  for (const Compared& m : all) {
    if (!m.method.empty()) std::printf("Method %s\n", m.method.c_str());
    std::vector<std::vector<std::string>> rows = {{"run", "slip", "channel", "unit", "recorded", "computed", "error", "+-", "std rec.", "std comp.", "rating"}};
    for (const analysis::RunComparison& r : m.comparison.runs)
      for (const auto& [name, c] : r.channels) {
        const Shown u = shown_unit(name, c.unit);
        const auto value = [&](double x) { return fmt::format("{:.4g}", u.factor * x); };
        rows.push_back({r.recorded_run, slip_text(r.condition.slip) + (r.interpolated ? "*" : ""), name, u.unit, value(c.recorded_mean), value(c.computed_mean), value(c.error),
                        c.error_sem > 0.0 ? value(c.error_sem) : "-", value(c.recorded_std), value(c.computed_std), c.rating ? fmt::format("{:.2f}", c.rating->total) : "-"});
      }
    std::printf("%s", aligned(rows).c_str());
    std::vector<std::vector<std::string>> sums = {{"channel", "unit", "pairs", "bias", "rmse", "of size", "largest", "at slip", "replicates' std", "area", "rating"}};
    for (const auto& [name, s] : m.comparison.summary) {
      const Shown u = shown_unit(name, s.unit);
      const auto value = [&](double x) { return fmt::format("{:.4g}", u.factor * x); };
      sums.push_back({name, u.unit, fmt::format("{}", s.pairs), value(s.bias), value(s.rmse), fmt::format("{:.1f} %", 100.0 * s.relative_rmse), value(s.largest_error), slip_text(s.largest_at_slip),
                      s.scatter > 0.0 ? value(s.scatter) : "-", value(s.area), s.rating > 0.0 ? fmt::format("{:.2f}", s.rating) : "-"});
    }
    std::printf("\n%s", aligned(sums).c_str());
    if (std::any_of(m.comparison.runs.begin(), m.comparison.runs.end(), [](const auto& r) { return r.interpolated; }))
      std::printf("* interpolated in slip between two computed points\n");
    if (!m.comparison.unmatched.empty()) std::printf("%zu runs of the recording have no counterpart in the result\n", m.comparison.unmatched.size());
    std::printf("\n");
  }
}

void write_report(const std::string& path, const std::vector<Compared>& all, const recording::Recording& reference, const Request& request, const Common& common) {
  report::Page page("Result and recording");
  page.subtitle(request.result + " against " + (reference.title.empty() ? request.recording : reference.title)).command(common.command_line);
  std::string sentence;
  for (const Compared& m : all)
    for (const auto& [name, s] : m.comparison.summary)
      sentence += fmt::format("{}{}{}: {:.0f} % of its size", sentence.empty() ? "" : "; ", m.method.empty() ? "" : m.method + ", ", name, 100.0 * s.relative_rmse);
  page.verdict(report::Mood::neutral, sentence.empty() ? "No channel could be compared." : "Root mean square error of the means: " + sentence + ".");
  std::vector<std::string> channels;
  for (const Compared& m : all)
    for (const auto& [name, s] : m.comparison.summary)
      if (std::find(channels.begin(), channels.end(), name) == channels.end()) channels.push_back(name);
  page.section("Means by slip");
  std::vector<report::Figure> figures;
  for (const std::string& name : channels) {
    const Shown u = shown_unit(name, recording::channel::unit_of(name).value_or(""));
    report::Figure f, e;
    f.title = name;
    f.x = {"Slip", ""};
    f.y = {name, u.unit};
    e.title = name + ": where they part";
    e.x = f.x;
    e.y = {"computed less recorded", u.unit};
    bool first = true;
    for (const Compared& m : all) {
      report::Series rec, com, err;
      rec.name = "recorded";
      rec.draw = report::Draw::points;
      rec.colour = report::kInk;
      com.name = m.method.empty() ? "computed" : m.method;
      err.name = com.name;
      err.draw = report::Draw::points;
      std::vector<std::array<double, 5>> points;
      for (const analysis::RunComparison& r : m.comparison.runs) {
        const auto found = r.channels.find(name);
        if (found == r.channels.end() || !std::isfinite(r.condition.slip)) continue;
        const auto& c = found->second;
        points.push_back({r.condition.slip, u.factor * c.recorded_mean, u.factor * c.computed_mean, u.factor * c.error, u.factor * c.error_sem});
      }
      std::sort(points.begin(), points.end());
      for (const auto& p : points) {
        rec.x.push_back(p[0]);
        rec.y.push_back(p[1]);
        rec.low.push_back(p[1] - p[4]);
        rec.high.push_back(p[1] + p[4]);
        com.x.push_back(p[0]);
        com.y.push_back(p[2]);
        err.x.push_back(p[0]);
        err.y.push_back(p[3]);
        err.low.push_back(p[3] - 2.0 * p[4]);
        err.high.push_back(p[3] + 2.0 * p[4]);
      }
      com.draw = report::Draw::line_and_points;
      if (first && !rec.x.empty()) f.series.push_back(rec);
      first = first && rec.x.empty();
      if (!com.x.empty()) f.series.push_back(com);
      if (!err.x.empty()) e.series.push_back(err);
    }
    f.width = e.width = 480;
    f.height = e.height = 320;
    report::Annotation zero;
    zero.y = 0.0;
    e.annotations.push_back(zero);
    if (!f.series.empty()) figures.push_back(f);
    if (!e.series.empty()) figures.push_back(e);
  }
  if (!figures.empty()) page.figures(figures);

  // The time series that are rated worst: a picture of where they part.
  for (const Compared& m : all)
    for (const std::string& name : channels) {
      const analysis::RunComparison* worst = nullptr;
      for (const analysis::RunComparison& r : m.comparison.runs) {
        const auto found = r.channels.find(name);
        if (found == r.channels.end() || !found->second.rating) continue;
        if (!worst || found->second.rating->total < worst->channels.at(name).rating->total) worst = &r;
      }
      if (!worst) continue;
      const Shown u = shown_unit(name, recording::channel::unit_of(name).value_or(""));
      report::Figure f;
      f.title = fmt::format("{}, run {} (slip {}): the pair rated worst, {:.2f}", name, worst->recorded_run, slip_text(worst->condition.slip), worst->channels.at(name).rating->total);
      f.x = {"Time", "s"};
      f.y = {name, u.unit};
      const auto add = [&](const recording::Recording& from, const std::string& id, const char* label, int colour) {
        for (const recording::Run& run : from.runs) {
          if (run.id != id || run.time.empty() || !run.find(name)) continue;
          report::Series s;
          s.name = label;
          s.colour = colour;
          const std::size_t thin = std::max<std::size_t>(run.time.size() / 2000, 1);
          for (std::size_t i = 0; i < run.time.size(); i += thin) {
            s.x.push_back(run.time[i] - run.time.front());
            s.y.push_back(u.factor * run.find(name)->values[i]);
          }
          f.series.push_back(std::move(s));
          return;
        }
      };
      add(reference, worst->recorded_run, "recorded", report::kInk);
      add(m.result, worst->computed_run, m.method.empty() ? "computed" : m.method.c_str(), report::kNextColour);
      page.figure(f);
    }
  page.section("Numbers");
  for (const Compared& m : all) {
    report::Table t;
    t.columns = {{"run"}, {"slip"}, {"channel"}, {"unit"}, {"recorded"}, {"computed"}, {"error"}, {"std recorded"}, {"std computed"}, {"area"}, {"own area"}, {"rating"}};
    for (const analysis::RunComparison& r : m.comparison.runs)
      for (const auto& [name, c] : r.channels) {
        const Shown u = shown_unit(name, c.unit);
        report::Cell error = c.error_sem > 0.0 ? report::Cell(report::PlusMinus{u.factor * c.error, u.factor * c.error_sem}) : report::Cell(u.factor * c.error);
        t.rows.push_back({r.recorded_run, slip_text(r.condition.slip), name, u.unit, u.factor * c.recorded_mean, u.factor * c.computed_mean, error, u.factor * c.recorded_std,
                          u.factor * c.computed_std, u.factor * c.area, u.factor * c.own_area, c.rating ? report::Cell(c.rating->total) : report::Cell(std::monostate{})});
      }
    t.caption = m.method;
    page.table(t);
  }
  page.write_html(path);
}

void run_compare(const Request& request, Common& common) {
  TableHelp help;
  help.columns = request.columns;
  const recording::Recording reference = load_runs(request.recording, "", help, common.threads);
  for (const std::string& remark : reference.remarks) note(common, remark);
  std::vector<std::string> methods = {request.method};
  if (request.method.empty()) methods = methods_of(request.result);
  std::vector<Compared> all;
  for (const std::string& method : methods) {
    Compared m;
    m.method = method;
    m.result = load_runs(request.result, method, help, common.threads);
    m.comparison = analysis::compare(m.result, reference, request.options);
    all.push_back(std::move(m));
  }
  if (std::all_of(all.begin(), all.end(), [](const Compared& m) { return m.comparison.summary.empty(); }))
    throw InputError(Problem{request.result, 0, 0, {}, "has no condition and channel in common with " + request.recording, "runs of the same slip, load, wheel rate and pass"});
  if (!common.report.empty()) write_report(common.report, all, reference, request, common);
  if (common.json) {
    Json out = Json::array();
    for (const Compared& m : all) out.push_back(comparison_json(m));
    print_json({{"result", request.result}, {"recording", request.recording}, {"slip_convention", "s = 1 - v/(omega r)"}, {"methods", std::move(out)}});
    return;
  }
  print_text(all);
}

}  // namespace

void add_compare(Command& app, Common& common) {
  Command* command = app.add_subcommand("compare", "a result and a recording side by side, channel by channel, with an objective rating");
  const auto r = std::make_shared<Request>();
  command->add_option("RESULT", r->result, "result file of sweep or run (or another recording)")->required()->type_name("");
  command->add_option("RECORDING", r->recording, "recording: folder, recording.yaml or one of its tables")->required()->type_name("");
  command->add_option("--method", r->method, "which method of the result file (default: all)")->type_name("NAME");
  command->add_option("--channel", r->options.channels, "only these channels")->type_name("NAME");
  command->add_option("--columns", r->columns, "YAML file that says what the columns of a bare table mean")->type_name("FILE");
  command->add_option("--slip-tolerance", r->options.slip_tolerance, "slips this near are the same (default: 0.005)")->check(range(0.0, 1.0))->type_name("S");
  add_common(*command, common, true);
  command->callback([r, &common] { run_compare(*r, common); });
}

}  // namespace terrode::cli
