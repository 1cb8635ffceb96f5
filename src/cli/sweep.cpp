#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "cli/checkpoints.h"
#include "cli/input.h"
#include "cli/sweep_report.h"
#include "cli/sweep_result.h"
#include "cli/terminal.h"
#include "recording/checkpoint.h"
#include "core/parallel.h"
#include "report/svg.h"
#include "scenario/methods.h"

namespace terrode::cli {
namespace {

namespace fs = std::filesystem;
using scenario::OperatingPoint;

constexpr const char* kPending = "not computed yet";

struct SweepArguments {
  std::string scenario, output, csv, slips, figure;
  std::vector<std::string> methods;
  bool overwrite = false;
  std::optional<double> seconds;  // of wall time between two writes of the result file, and of an unfinished point
};

// The result file of a sweep: known points when it was begun before, written anew in one step each time some are added.
class SweepFile {
 public:
  SweepFile(const std::string& path, recording::ResultHeader header, bool overwrite, double seconds, const Common& common)
      : path_(path), header_(std::move(header)), regularly_(seconds) {
    const fs::path folder = fs::absolute(path).parent_path();
    if (!fs::is_directory(folder)) throw InputError({path, 0, 0, {}, fmt::format("the folder {} does not exist", folder.string()), {}});
    if (overwrite || !fs::exists(path)) return;
    const recording::Hdf5File file = recording::Hdf5File::open(path);
    const recording::ResultHeader old = recording::read_header(file);
    if (old.filetype != header_.filetype || old.scenario_resolved != header_.scenario_resolved)
      throw InputError({path, 0, 0, {}, fmt::format("holds results of another scenario or seed ({}, {})", old.scenario_file, old.created),
                        "another name after -o, or --overwrite"});
    if (old.generator != header_.generator) note(common, fmt::format("{} was begun by {}", path, old.generator));
    for (const std::string& method : recording::result_methods(file))
      rows_[method] = from_table(recording::read_table(file, "/sweep/" + method));
    keep_ = true;
  }

  // The row of a point, appended where there is none yet.
  SweepPoint& row(const std::string& method, const OperatingPoint& at, std::size_t* index = nullptr) {
    std::vector<SweepPoint>& rows = rows_[method];
    std::size_t i = 0;
    while (i < rows.size() && !same_point(rows[i].at, at)) ++i;
    if (i == rows.size()) {
      rows.emplace_back();
      rows.back().at = at;
      rows.back().error = kPending;
    }
    if (index) *index = i;
    return rows[i];
  }

  void put(const std::string& method, const SweepPoint& point) {
    std::size_t index = 0;
    SweepPoint& target = row(method, point.at, &index);
    target = point;
    if (point.series) new_series_[{method, index}] = point.series;
    target.series.reset();  // on disk after the next save: memory stays flat
    dirty_ = true;
  }

  // Writes what is new; at most every few seconds unless `now`.
  void save(bool now) {
    if (!now && (!dirty_ || !regularly_.due())) return;
    recording::write_atomically(path_, keep_, [this](recording::Hdf5File& file) {
      recording::write_header(file, header_);
      for (const auto& [method, rows] : rows_) recording::write_table(file, "/sweep/" + method, to_table(rows));
      for (const auto& [where, series] : new_series_) {
        const std::string group = fmt::format("/sweep/{}/runs/{:04}", where.first, where.second);
        if (file.exists(group)) file.remove(group);
        recording::write_series(file, group, *series);
      }
    });
    keep_ = true;
    dirty_ = false;
    new_series_.clear();
    regularly_.done();
  }

 private:
  std::string path_;
  recording::ResultHeader header_;
  std::map<std::string, std::vector<SweepPoint>> rows_;
  std::map<std::pair<std::string, std::size_t>, std::shared_ptr<const recording::Run>> new_series_;
  bool keep_ = false, dirty_ = true;
  recording::Regularly regularly_;
};

// Where nothing could be computed because the soil does not carry the load, the load is what is wrong.
void judge_failures(const scenario::Scenario& s, const std::vector<MethodResult>& results, Common& common) {
  std::size_t failed = 0, all = 0;
  const SweepPoint* example = nullptr;
  bool load_is_wrong = true;
  std::set<std::string> said;
  for (const auto& r : results) {
    for (const SweepPoint& p : r.points) {
      ++all;
      if (!p.failed()) continue;
      ++failed;
      if (!example) example = &p;
      load_is_wrong = load_is_wrong && (p.error.find("does not carry") != std::string::npos || p.error.find("buried") != std::string::npos);
    }
  }
  if (failed == 0) return;
  if (failed == all && load_is_wrong) {
    Problems problems{{{}, 0, 0, "normal_load", fmt::format("is {} N: {}", example->at.normal_load, example->error), {}}};
    try {
      scenario::locate(problems, scenario::parse_yaml(s.text, s.file), s.file, "rig");
    } catch (const InputError&) {
    }
    std::fprintf(stderr, "%s\n", problems.front().text().c_str());
    common.status = 2;
    return;
  }
  for (const auto& r : results)
    for (const SweepPoint& p : r.points)
      if (p.failed())
        std::fprintf(stderr, "terrode: %s at slip %g failed: %s\n", r.method.c_str(), p.at.slip_given, p.error.c_str());
  common.status = 1;
}

// NAME.svg holds the drawbar pull; torque and sinkage go to NAME_torque.svg and NAME_sinkage.svg.
void write_figure(const std::vector<report::Figure>& figures, const std::string& path) {
  const fs::path p(path);
  const char* suffixes[] = {"", "_torque", "_sinkage"};
  for (std::size_t i = 0; i < figures.size() && i < 3; ++i)
    report::write_svg(figures[i], p.parent_path() / (p.stem().string() + suffixes[i] + ".svg"));
}

bool any_good(const std::vector<MethodResult>& results) {
  for (const MethodResult& r : results)
    for (const SweepPoint& p : r.points)
      if (!p.failed()) return true;
  return false;
}

std::vector<std::string> unique(const std::vector<std::string>& names) {
  std::vector<std::string> out;
  for (const std::string& n : names)
    if (std::find(out.begin(), out.end(), n) == out.end()) out.push_back(n);
  return out;
}

void sweep(const SweepArguments& arguments, Common& common) {
  const scenario::Scenario s = load_input(arguments.scenario, common);
  const std::vector<std::string> names = !arguments.methods.empty() ? unique(arguments.methods)
                                         : !s.methods.empty()       ? unique(s.methods)
                                                                    : std::vector<std::string>{"steady"};
  const std::vector<OperatingPoint> points =
      arguments.slips.empty() ? s.operating_points() : s.operating_points(scenario::parse_slips(arguments.slips));
  scenario::MethodSettings settings;
  // Threads that the points leave over serve the grains of each.
  settings.threads = std::max(1, thread_count(common.threads) / static_cast<int>(points.size() * names.size()));
  settings.progress = show_progress(common);
  std::vector<vehicle::SweepMethod> methods;
  std::vector<Checkpoints> kept;
  for (const std::string& name : names) {
    if (!arguments.output.empty()) {
      kept.emplace_back(arguments.output, name, physics_of(s), arguments.seconds.value_or(30.0));
      settings.memory = kept.back().memory();
    }
    methods.push_back(scenario::make_method(name, s, settings));
  }

  std::unique_ptr<SweepFile> file;
  if (!arguments.output.empty()) {
    recording::ResultHeader header = recording::ResultHeader::now("terrode sweep");
    header.title = s.title;
    header.scenario_file = s.file;
    header.scenario_text = s.text;
    header.scenario_resolved = physics_of(s);
    header.slip_convention = s.rig.slip_convention;
    header.command = common.command_line;
    header.seed = s.seed;
    file = std::make_unique<SweepFile>(arguments.output, std::move(header), arguments.overwrite, arguments.seconds.value_or(3.0), common);
    for (const std::string& m : names)
      for (const OperatingPoint& p : points) file->row(m, p);
    // A file that cannot be written is known before the work, not after it.
    file->save(true);
  }

  // Results in the order asked for; a condition knows its point by its place in the list.
  std::vector<MethodResult> results;
  std::vector<recording::Condition> conditions;
  for (std::size_t i = 0; i < points.size(); ++i) {
    conditions.push_back(scenario::condition_of(points[i], s.wheel.radius));
    conditions.back().extra["point"] = std::to_string(i);
  }
  std::set<std::pair<std::string, std::string>> there;
  for (const std::string& name : names) {
    results.push_back({name, {}});
    for (std::size_t i = 0; i < points.size(); ++i) {
      SweepPoint point;
      if (file) point = file->row(name, points[i]);
      point.at = points[i];
      if (file && !point.failed()) there.insert({name, std::to_string(i)});
      results.back().points.push_back(std::move(point));
    }
  }
  const auto place = [](const recording::Condition& c) { return c.extra.at("point"); };

  vehicle::SweepOptions options;
  // LIGGGHTS carries one ground at a time.
  const bool one_by_one = std::all_of(names.begin(), names.end(), [](const std::string& name) { return name == "mpi"; });
  options.threads = one_by_one ? 1 : common.threads;
  options.keep_series = false;
  options.skip = [&](const std::string& method, const recording::Condition& c) { return there.contains({method, place(c)}); };
  options.on_point = [&](const vehicle::SweepPoint& done) {
    const std::size_t i = std::stoul(place(done.condition));
    for (MethodResult& r : results) {
      if (r.method != done.method) continue;
      r.points[i] = summarise(done, points[i], scenario::averaging_period(done.method, s, points[i]));
      if (file) {
        file->put(done.method, r.points[i]);
        file->save(false);
      }
      r.points[i].series.reset();
    }
  };
  Progress progress = show_progress(common);
  try {
    vehicle::sweep(methods, conditions, options, progress);
  } catch (const Interrupted&) {
    progress = {};
    if (!file) throw Interrupted("Nothing was kept: name a file with -o to go on later.");
    file->save(true);
    throw Interrupted(fmt::format("What was computed is in {0} (unfinished runs: {0}.unfinished); the same command goes on from there.", arguments.output));
  }
  progress = {};
  if (file) file->save(true);
  int resumed = 0;
  for (const Checkpoints& k : kept) resumed += k.resumed();
  if (resumed > 0) note(common, fmt::format("{} unfinished runs were gone on with", resumed));
  if (!there.empty()) note(common, fmt::format("{} points were in {} already", there.size(), arguments.output));
  if (!arguments.csv.empty()) write_text_atomically(arguments.csv, sweep_csv(results));
  const std::vector<SweepPoint> measured = measured_points(s);
  if (!common.report.empty() || !arguments.figure.empty()) {
    const report::SweepReport page = sweep_report(s, results, measured, common.command_line);
    if (!common.report.empty()) report::sweep_page(page).write_html(common.report);
    if (!arguments.figure.empty()) write_figure(report::sweep_figures(page), arguments.figure);
  }
  if (common.json)
    print_json(sweep_json(s.file, s.rig.slip_convention, results, measured));
  else if (any_good(results))
    std::fputs(sweep_text(results).c_str(), stdout);
  for (const MethodResult& r : results)
    if (const std::string books = energy_text(r.points); !books.empty()) note(common, r.method + ": " + books);
  judge_failures(s, results, common);
}

}  // namespace

void add_sweep(Command& app, Common& common) {
  Command* command = app.add_subcommand("sweep", "slip sweep of a rig by one or several methods, side by side; resumable");
  const auto a = std::make_shared<SweepArguments>();
  command->add_option("SCENARIO", a->scenario, "scenario file, or a recording")->required()->type_name("");
  command->add_option("--method", a->methods, "steady, node-spring, dem, mpi; several joined by commas")
      ->delimiter(',')
      ->check(is_member(scenario::method_names()))
      ->type_name("LIST");
  command->add_option("--slip", a->slips, "slips, by the convention of the scenario: 0,0.1,0.3 or FROM:TO:STEP")->type_name("LIST");
  command->add_option("-o,--output", a->output, "result file (HDF5); points that are in it already are not computed again")
      ->type_name("OUT.h5");
  command->add_option("--csv", a->csv, "write the table to this file")->type_name("FILE.csv");
  command->add_option("--figure", a->figure, "draw drawbar pull to this file, torque and sinkage beside it")->type_name("FILE.svg");
  command->add_option("--checkpoint", a->seconds, "write the result file (default: every 3 s) and unfinished points (30 s) anew every so many seconds")
      ->check(range(0.0, 1e9))
      ->type_name("SECONDS");
  command->add_flag("--overwrite", a->overwrite, "replace a result file of another scenario");
  add_common(*command, common, true);
  common.words["sweep --method"] = scenario::method_names();
  command->callback([a, &common] { sweep(*a, common); });
}

}  // namespace terrode::cli
