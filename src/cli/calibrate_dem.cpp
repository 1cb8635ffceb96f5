#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <tuple>

#include "calibration/grain_search.h"
#include "cli/calibration_output.h"
#include "cli/processes.h"
#include "cli/terminal.h"
#include "core/parallel.h"
#include "core/units.h"
#include "report/page.h"
#include "report/svg.h"
#include "scenario/recording_file.h"

namespace terrode::cli {
namespace {

namespace fs = std::filesystem;
using calibration::DemTestSettings;
using calibration::Evaluation;
using calibration::GrainSearch;
using calibration::GrainValues;
using calibration::SearchMethod;
using calibration::SearchOptions;
using calibration::SearchResult;
using calibration::TestTarget;

struct CalibrateDemArguments {
  std::string recording, output, search = "surrogate", box, max_depth, max_shear, shear_rate, plate_rate, bulk_density, evaluate;
  std::vector<std::string> free, ranges, fixed;
  std::vector<int> evaluations;
  std::vector<double> grains = {5.0};
  int beds = 1, batch = 4, confirmations = -1;
  double shear_weight = 0.5, confidence = 0.95;
  bool overwrite = false;
};

double quantity(const std::string& text, const std::string& unit, const std::string& option) {
  const QuantityText q = parse_quantity(text, unit);
  if (!q.error.empty()) throw InputError(Problem{{}, 0, 0, option, "'" + text + "' " + q.error, unit == "-" ? "a number" : "a value in " + unit});
  return q.value;
}

// "NAME=TEXT".
std::pair<std::string, std::string> assignment(const std::string& text, const std::string& option) {
  const std::size_t at = text.find('=');
  if (at == std::string::npos || at == 0 || at + 1 == text.size()) throw InputError(Problem{{}, 0, 0, option, "is '" + text + "'", "NAME=VALUE"});
  return {text.substr(0, at), text.substr(at + 1)};
}

// What decides whether evaluations belong to one search, and all that one of them needs.
struct Plan {
  std::vector<TestTarget> targets;
  std::vector<DemTestSettings> beds;  // cheap to dear
  GrainValues fixed;
  SearchOptions options;
};

Json plan_json(const Plan& p) {
  Json targets = Json::array(), beds = Json::array(), free = Json::array(), fixed = Json::object();
  for (const TestTarget& t : p.targets)
    targets.push_back({{"test", t.test}, {"normal_stress", t.normal_stress}, {"plate_width", t.plate_width}, {"plate_length", t.plate_length}, {"at", t.at},
                       {"measured", t.measured}, {"repeats", t.repeats}, {"scale", t.scale}, {"level_deviation", t.level_deviation}, {"tilt_deviation", t.tilt_deviation}});
  for (const DemTestSettings& b : p.beds)
    beds.push_back({{"grains_across", b.grains_across}, {"box", b.box}, {"bulk_density", b.bulk_density}, {"rolling", b.rolling}, {"shear_rate", b.shear_rate},
                    {"plate_rate", b.plate_rate}, {"gravity", b.gravity}, {"seating", b.seating}, {"beds", b.beds}});
  for (const auto& f : p.options.free) free.push_back({{"name", f.name}, {"low", f.low}, {"high", f.high}});
  for (const auto& [name, value] : p.fixed) fixed[name] = value;
  return {{"format", "grain_search/1"}, {"targets", targets}, {"beds", beds}, {"free", free}, {"fixed", fixed}, {"seed", p.options.seed},
          {"search", p.options.method == SearchMethod::surrogate ? "surrogate" : p.options.method == SearchMethod::random ? "random" : "simplex"},
          {"shear_weight", p.options.shear_weight}, {"batch", p.options.batch}};
}

std::string file_text(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw InputError(Problem{path.string(), 0, 0, {}, "cannot be read", {}});
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

Json parsed(const fs::path& path) {
  try {
    return Json::parse(file_text(path));
  } catch (const nlohmann::json::exception& e) {
    throw InputError(Problem{path.string(), 0, 0, {}, std::string("is no JSON: ") + e.what(), {}});
  }
}

Plan plan_of(const Json& j) {
  Plan p;
  for (const Json& t : j.at("targets")) {
    TestTarget out;
    out.test = t.at("test");
    out.normal_stress = t.at("normal_stress");
    out.plate_width = t.at("plate_width");
    out.plate_length = t.at("plate_length");
    out.at = t.at("at").get<std::vector<double>>();
    out.measured = t.at("measured").get<std::vector<double>>();
    out.scale = t.at("scale");
    p.targets.push_back(out);
  }
  for (const Json& b : j.at("beds")) {
    DemTestSettings out;
    out.grains_across = b.at("grains_across");
    out.box = b.at("box");
    out.bulk_density = b.at("bulk_density");
    out.rolling = b.at("rolling");
    out.shear_rate = b.at("shear_rate");
    out.plate_rate = b.at("plate_rate");
    out.gravity = b.at("gravity");
    out.seating = b.at("seating");
    out.beds = b.at("beds");
    p.beds.push_back(out);
  }
  for (const auto& [name, value] : j.at("fixed").items()) p.fixed[name] = value;
  return p;
}

fs::path evaluation_file(const fs::path& folder, int index) { return folder / "evaluations" / fmt::format("{:04}.json", index); }

Json evaluation_json(const Evaluation& e, const GrainValues& values) {
  Json v = Json::object();
  for (const auto& [name, value] : values) v[name] = value;
  Json out = {{"index", e.index}, {"bed", e.level}, {"purpose", e.purpose}, {"seed", e.seed}, {"parameters", v}, {"unit", std::vector<double>(e.unit.begin(), e.unit.end())}};
  if (!e.curves.empty()) out["curves"] = e.curves;
  if (!e.error.empty()) out["error"] = e.error;
  if (e.done()) out["cpu_seconds"] = e.seconds;
  return out;
}

Evaluation evaluation_of(const Json& j) {
  Evaluation e;
  e.index = j.at("index");
  e.level = j.at("bed");
  e.purpose = j.at("purpose");
  e.seed = j.at("seed");
  const auto unit = j.at("unit").get<std::vector<double>>();
  e.unit = Eigen::Map<const Eigen::VectorXd>(unit.data(), static_cast<Eigen::Index>(unit.size()));
  if (j.contains("curves")) e.curves = j.at("curves").get<std::vector<std::vector<double>>>();
  e.error = j.value("error", std::string());
  e.seconds = j.value("cpu_seconds", 0.0);
  return e;
}

// One evaluation, in a process of its own: reads what is asked for from the file and writes it back with the curves.
void evaluate(const std::string& file, Common& common) {
  const fs::path folder = fs::path(file).parent_path().parent_path();
  const Plan plan = plan_of(parsed(folder / "search.json"));
  Json j = parsed(file);
  const int level = j.at("bed");
  DemTestSettings s = plan.beds.at(static_cast<std::size_t>(level));
  s.threads = std::max(1, common.threads);
  // The beds of one evaluation serve all its tests and no other one.
  s.cache = fs::path(file).replace_extension(".beds").string();
  GrainValues values = plan.fixed;
  for (const auto& [name, value] : j.at("parameters").items()) values[name] = value;
  Progress progress;
  progress.stop_requested = [] { return interrupted(); };
  const auto curves = [&] {
    try {
      return calibration::simulate_tests(plan.targets, s, values, j.at("seed"), progress);
    } catch (...) {
      fs::remove_all(s.cache);
      throw;
    }
  }();
  fs::remove_all(s.cache);
  for (const auto& c : curves)
    for (const double v : c)
      if (!std::isfinite(v)) throw RunError("a simulated stress is not finite");
  j["curves"] = curves;
  j["cpu_seconds"] = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
  write_text_atomically(file, json_text(j) + "\n");
}

std::string last_line(const fs::path& path) {
  std::ifstream in(path);
  std::string last;
  for (std::string line; std::getline(in, line);)
    if (!line.empty()) last = line;
  const std::string program = "terrode: ";
  return last.starts_with(program) ? last.substr(program.size()) : last;
}

double percent(double mean_square) { return 100.0 * std::sqrt(mean_square); }

report::Figure best_so_far_figure(const GrainSearch& search, const std::vector<Evaluation>& done, const SearchResult& r) {
  report::Figure f;
  f.title = "Best so far";
  f.x = {"Evaluation", ""};
  f.y = {"Misfit of the curves", "%"};
  report::Series each, best;
  each.name = "each evaluation";
  each.draw = report::Draw::points;
  best.name = "best so far";
  best.draw = report::Draw::steps;
  for (std::size_t i = 0; i < done.size(); ++i) {
    const double x = static_cast<double>(i + 1);
    if (done[i].error.empty()) each.x.push_back(x), each.y.push_back(percent(search.observed(done[i]).total));
    best.x.push_back(x);
    best.y.push_back(percent(r.best_so_far[i]));
  }
  f.series = {each, best};
  f.caption = "Root mean square difference to the measured curves, relative to them, both tests together. One bed's luck is part of each point.";
  return f;
}

// Misfit of one test against that of the other.
report::Figure front_figure(const GrainSearch& search, const std::vector<Evaluation>& done, const SearchResult& r) {
  report::Figure f;
  f.title = "Trade-off between the tests";
  f.x = {"Misfit of direct shear", "%"};
  f.y = {"Misfit of the plates", "%"};
  report::Series each, front, place;
  each.name = "evaluations";
  each.draw = front.draw = place.draw = report::Draw::points;
  for (const Evaluation& e : done)
    if (e.error.empty()) {
      const auto m = search.observed(e);
      each.x.push_back(percent(m.shear));
      each.y.push_back(percent(m.plates));
    }
  front.name = "front of the mean curves (surrogate)";
  front.draw = report::Draw::line_and_points;
  for (const auto& p : r.front) {
    front.x.push_back(percent(p.misfit.shear));
    front.y.push_back(percent(p.misfit.plates));
  }
  place.name = "place found, expected";
  place.x = {percent(r.expected.shear)};
  place.y = {percent(r.expected.plates)};
  f.series = {each};
  if (!r.front.empty()) f.series.push_back(front), f.series.push_back(place);
  f.caption = "On the front neither test can be matched better without matching the other one worse. Where it is a point, the tests do not conflict.";
  return f;
}

report::Figure curve_figure(const TestTarget& t, const std::vector<double>& fitted, const std::vector<double>& deviation, const std::string& name) {
  report::Figure f;
  f.title = t.name();
  f.x = {t.test == "direct_shear" ? "Shear displacement" : "Sinkage", "mm"};
  f.y = {t.test == "direct_shear" ? "Shear stress" : "Pressure", "kPa"};
  report::Series measured, simulated;
  measured.name = fmt::format("measured ({} test{})", t.repeats, t.repeats == 1 ? "" : "s");
  measured.colour = report::kInk;
  measured.draw = report::Draw::points;
  simulated.name = name;
  simulated.draw = report::Draw::line_and_points;
  for (std::size_t i = 0; i < t.at.size(); ++i) {
    const double m = t.measured[i], tilt = m * (2.0 * t.at[i] / t.at.back() - 1.0);
    const double error = std::hypot(t.level_deviation * m, t.tilt_deviation * tilt);
    measured.x.push_back(1e3 * t.at[i]);
    measured.y.push_back(1e-3 * m);
    measured.low.push_back(1e-3 * (m - error));
    measured.high.push_back(1e-3 * (m + error));
    simulated.y.push_back(1e-3 * fitted[i]);
    if (!deviation.empty()) {
      simulated.low.push_back(1e-3 * (fitted[i] - deviation[i]));
      simulated.high.push_back(1e-3 * (fitted[i] + deviation[i]));
    }
  }
  simulated.x = measured.x;
  f.series = {measured, simulated};
  return f;
}

report::Figure distribution_figure(const calibration::GrainParameter& p, const SearchResult& r, Eigen::Index which) {
  report::Figure f;
  f.title = p.name;
  f.x = {p.text, p.unit == "-" ? "" : p.unit};
  f.x.log = p.log;
  f.y = {"Share of the range's likelihood", ""};
  constexpr int kBins = 24;
  std::vector<double> count(kBins, 0.0);
  for (const auto& u : r.sample) count[static_cast<std::size_t>(std::clamp(static_cast<int>(u[which] * kBins), 0, kBins - 1))] += 1.0;
  report::Series s;
  s.name = "given the tests";
  for (int b = 0; b < kBins; ++b) {
    s.x.push_back(p.from_unit((b + 0.5) / kBins));
    s.y.push_back(count[static_cast<std::size_t>(b)] * kBins / std::max<double>(1.0, static_cast<double>(r.sample.size())));
  }
  f.series = {s};
  f.annotations = {{r.estimates[static_cast<std::size_t>(which)].value, std::numeric_limits<double>::quiet_NaN(), "found"}};
  f.caption = "1 everywhere would mean that the tests say nothing.";
  return f;
}

Json misfit_json(const calibration::Misfit& m, bool shear, bool plates) {
  Json out = {{"total", number(std::sqrt(m.total))}};
  if (shear) out["direct_shear"] = number(std::sqrt(m.shear));
  if (plates) out["pressure_sinkage"] = number(std::sqrt(m.plates));
  return out;
}

void calibrate_dem(const CalibrateDemArguments& a, Common& common) {
  if (!a.evaluate.empty()) return evaluate(a.evaluate, common);
  if (a.recording.empty()) throw InputError(Problem{{}, 0, 0, "RECORDING", "is missing", "a recording's folder or its recording.yaml"});
  if (a.output.empty()) throw InputError(Problem{{}, 0, 0, "--output", "is missing", "a folder that keeps the evaluations"});
  const recording::Recording recording = scenario::load_recording(a.recording, common.threads);
  for (const std::string& r : recording.remarks) note(common, r);

  Plan plan;
  calibration::TargetOptions target_options;
  if (!a.max_depth.empty()) target_options.deepest = quantity(a.max_depth, "m", "--max-depth");
  if (!a.max_shear.empty()) target_options.longest_shear = quantity(a.max_shear, "m", "--max-shear");
  std::vector<std::string> notes;
  plan.targets = calibration::test_targets(recording, target_options, notes);
  for (const std::string& n : notes) note(common, n);
  DemTestSettings bed;
  bed.beds = a.beds;
  if (!a.box.empty()) bed.box = quantity(a.box, "m", "--box");
  if (!a.shear_rate.empty()) bed.shear_rate = quantity(a.shear_rate, "m/s", "--shear-rate");
  if (!a.plate_rate.empty()) bed.plate_rate = quantity(a.plate_rate, "m/s", "--plate-rate");
  bed.bulk_density = !a.bulk_density.empty() ? quantity(a.bulk_density, "kg/m^3", "--bulk-density") : recording.soil.bulk_density.value_or(bed.bulk_density);
  for (const double g : a.grains) {
    bed.grains_across = g;
    throw_if_any(bed.validate());
    plan.beds.push_back(bed);
  }
  SearchOptions& o = plan.options;
  o.method = a.search == "random" ? SearchMethod::random : a.search == "simplex" ? SearchMethod::simplex : SearchMethod::surrogate;
  if (!a.free.empty()) {
    o.free.clear();
    for (const std::string& name : a.free) o.free.push_back({name});
  }
  for (const std::string& text : a.ranges) {
    const auto [name, range] = assignment(text, "--range");
    const std::size_t colon = range.find(':');
    if (colon == std::string::npos) throw InputError(Problem{{}, 0, 0, "--range", "is '" + text + "'", "NAME=LOW:HIGH"});
    const auto it = std::find_if(o.free.begin(), o.free.end(), [&, n = name](const auto& f) { return f.name == n; });
    if (it == o.free.end()) throw InputError(Problem{{}, 0, 0, "--range", "names " + name + ", which is not free", "a parameter of --free"});
    const std::string& unit = calibration::grain_parameter(name).unit;
    it->low = quantity(range.substr(0, colon), unit, "--range " + name);
    it->high = quantity(range.substr(colon + 1), unit, "--range " + name);
    if (it->low == it->high) throw InputError(Problem{{}, 0, 0, "--range", "of " + name + " is empty", "LOW below HIGH"});
  }
  for (const std::string& text : a.fixed) {
    const auto [name, value] = assignment(text, "--set");
    const calibration::GrainParameter& p = calibration::grain_parameter(name);
    for (const auto& f : o.free)
      if (f.name == name) throw InputError(Problem{{}, 0, 0, "--set", "names " + name + ", which is free", "a parameter that is not in --free"});
    plan.fixed[name] = quantity(value, p.unit, "--set " + name);
    Problems problems;
    require(problems, "--set " + name, plan.fixed[name], p.unit.c_str(), plan.fixed[name] >= p.least && plan.fixed[name] <= p.most, fmt::format("from {:g} to {:g}", p.least, p.most));
    throw_if_any(problems);
  }
  o.evaluations = a.evaluations;
  if (o.evaluations.empty())
    for (std::size_t i = 0; i < plan.beds.size(); ++i) o.evaluations.push_back(i == 0 ? 40 : 12);
  if (o.evaluations.size() != plan.beds.size())
    throw InputError(Problem{{}, 0, 0, "--evaluations", fmt::format("are {} numbers", o.evaluations.size()), fmt::format("one for each bed of --grains ({})", plan.beds.size())});
  o.confirmations = a.confirmations >= 0 ? a.confirmations : std::min(4, o.evaluations.back() / 5);
  o.batch = a.batch;
  o.shear_weight = a.shear_weight;
  o.confidence = a.confidence;
  o.seed = common.seed;
  const GrainSearch search(plan.targets, o);

  // The folder: what is searched, and a file for each evaluation.
  const fs::path folder = a.output;
  const Json wanted = plan_json(plan);
  std::error_code problem;
  if (a.overwrite) fs::remove_all(folder / "evaluations", problem);
  fs::create_directories(folder / "evaluations", problem);
  if (problem) throw InputError(Problem{a.output, 0, 0, {}, "cannot be made: " + problem.message(), "a folder"});
  if (fs::exists(folder / "search.json") && !a.overwrite) {
    // Numbers read back are those written: to compare texts is to compare searches.
    if (parsed(folder / "search.json").dump() != Json::parse(json_text(wanted)).dump())
      throw InputError(Problem{a.output, 0, 0, {}, "holds a search of other tests or settings", "another folder after -o, or --overwrite"});
  }
  write_text_atomically((folder / "search.json").string(), json_text(wanted, 1) + "\n");
  std::vector<Evaluation> done, waiting;
  for (int i = 0; fs::exists(evaluation_file(folder, i)) && i < search.total(); ++i) {
    const Json j = parsed(evaluation_file(folder, i));
    try {
      const Evaluation e = evaluation_of(j);
      (e.done() ? done : waiting).push_back(e);
    } catch (const nlohmann::json::exception& e) {
      throw InputError(Problem{evaluation_file(folder, i).string(), 0, 0, {}, std::string("is no evaluation: ") + e.what(), "--overwrite"});
    }
  }
  if (!done.empty()) note(common, fmt::format("{} evaluations were in {} already", done.size(), a.output));

  Progress progress = show_progress(common);
  const int together = thread_count(common.threads);
  double best = std::numeric_limits<double>::infinity();
  for (const Evaluation& e : done)
    if (e.error.empty()) best = std::min(best, search.observed(e).total);
  for (;;) {
    if (waiting.empty()) {
      waiting = search.next(done);
      if (waiting.empty()) break;
      for (const Evaluation& e : waiting) write_text_atomically(evaluation_file(folder, e.index).string(), json_text(evaluation_json(e, search.values(e.unit))) + "\n");
    }
    std::vector<Piece> pieces;
    const int threads = std::max(1, together / static_cast<int>(waiting.size()));
    for (const Evaluation& e : waiting)
      pieces.push_back({{"calibrate-dem", "--evaluate", evaluation_file(folder, e.index).string(), "-j", std::to_string(threads)},
                        evaluation_file(folder, e.index).replace_extension(".log").string()});
    const std::size_t before = done.size();
    std::string refused;
    const bool finished = run_processes(pieces, together, [&](std::size_t i, int status) {
      Evaluation& e = waiting[i];
      const fs::path file = evaluation_file(folder, e.index);
      if (status == 0) e = evaluation_of(parsed(file));
      if (!e.done()) {
        e.error = status < 0 ? fmt::format("ended by signal {}", -status) : last_line(pieces[i].log);
        if (e.error.empty()) e.error = fmt::format("ended with status {}", status);
        if (status == 2) refused = e.error;
        write_text_atomically(file.string(), json_text(evaluation_json(e, search.values(e.unit))) + "\n");
        fs::remove_all(fs::path(file).replace_extension(".beds"));
      } else {
        fs::remove(pieces[i].log);
        best = std::min(best, search.observed(e).total);
      }
      done.push_back(e);
      progress.report(static_cast<double>(done.size()) / search.total(),
                      fmt::format("{} of {} evaluations, smallest misfit {:.1f} %", done.size(), search.total(), percent(best)));
    }, progress.stop_requested);
    if (!refused.empty()) throw InputError(refused);
    if (!finished) {
      progress = {};
      throw Interrupted(fmt::format("{} evaluations are in {}; the same command goes on from there.", done.size(), a.output));
    }
    std::sort(done.begin(), done.end(), [](const Evaluation& x, const Evaluation& y) { return x.index < y.index; });
    waiting.clear();
    if (done.size() > before && std::isfinite(best)) {
      SearchResult so_far;
      double least = std::numeric_limits<double>::quiet_NaN();
      int level = 0;
      for (const Evaluation& e : done) {
        if (e.level != level) least = std::numeric_limits<double>::quiet_NaN(), level = e.level;
        if (e.error.empty()) least = std::fmin(least, search.observed(e).total);
        so_far.best_so_far.push_back(least);
      }
      report::write_svg(best_so_far_figure(search, done, so_far), folder / "progress.svg");
    }
  }
  progress = {};
  const SearchResult r = search.result(done);
  double seconds = 0.0;
  for (const Evaluation& e : done) seconds += e.seconds;
  bool has_shear = false, has_plates = false;
  for (const TestTarget& t : plan.targets) (t.test == "direct_shear" ? has_shear : has_plates) = true;

  Json document = {{"recording", a.recording}, {"title", recording.title}, {"search", wanted["search"]}};
  Json fit = fit_json(r);
  fit.erase("degrees_of_freedom");
  for (const auto& [key, value] : fit.items()) document[key] = value;
  Json fixed = Json::object();
  for (const auto& [name, value] : plan.fixed) fixed[name] = value;
  document["fixed"] = fixed;
  document["evaluations"] = {{"count", done.size()}, {"failed", r.failed}, {"cpu_seconds", number(seconds)}};
  document["misfit"] = {{"confirmed", misfit_json(r.observed, has_shear, has_plates)}, {"confirmations", r.confirmations}};
  if (!r.sample.empty()) document["misfit"]["expected"] = misfit_json(r.expected, has_shear, has_plates);
  Json tests = Json::array();
  for (std::size_t t = 0; t < plan.targets.size(); ++t) {
    const TestTarget& target = plan.targets[t];
    Json test = {{"test", target.test}};
    if (target.test == "direct_shear") test["normal_stress"] = target.normal_stress;
    else test["plate_width"] = target.plate_width, test["plate_length"] = target.plate_length;
    test["repeats"] = target.repeats;
    test["displacement"] = target.at;
    test["measured"] = target.measured;
    if (r.confirmations > 0) {
      test["simulated"] = r.confirmed[t];
      test["simulated_std"] = r.confirmed_deviation[t];
      test["standardised_difference"] = number(r.standardised[t]);
    }
    tests.push_back(test);
  }
  document["tests"] = tests;
  Json so_far = Json::array(), front = Json::array();
  for (const double v : r.best_so_far) so_far.push_back(number(std::sqrt(v)));
  document["best_so_far"] = so_far;
  for (const auto& p : r.front) {
    Json values = Json::object();
    for (const auto& [name, value] : search.values(p.unit)) values[name] = value;
    front.push_back({{"direct_shear", number(std::sqrt(p.misfit.shear))}, {"pressure_sinkage", number(std::sqrt(p.misfit.plates))}, {"parameters", values}});
  }
  document["front"] = front;
  if (!r.sample.empty()) {
    document["bed_scatter"] = {{"direct_shear", number(r.shear_bed_scatter)}, {"pressure_sinkage", number(r.plate_bed_scatter)}};
    document["surrogate"] = {{"leave_one_out", number(r.leave_one_out)}, {"scatter_factor", number(r.scatter_factor)}};
  }
  write_text_atomically((folder / "result.json").string(), json_text(document, 1) + "\n");

  if (common.json) {
    print_json(document);
  } else {
    std::vector<std::vector<std::string>> rows = {{"parameter", "value", r.sample.empty() ? "range searched" : fmt::format("{:.0f} % interval", 100 * o.confidence), "", "unit", ""}};
    for (const auto& e : r.estimates)
      rows.push_back({e.name, fmt::format("{:.4g}", e.value), fmt::format("{:.3g}", e.low), fmt::format("{:.3g}", e.high), e.unit, r.sample.empty() || e.identified ? "" : "not identified"});
    std::printf("%s\n", aligned(rows).c_str());
    std::printf("%zu evaluations (%d failed), %.0f s of processor time\n", done.size(), r.failed, seconds);
    std::string parts, scatter;
    for (const auto& [name, there, misfit, beds] : {std::tuple{"direct shear", has_shear, r.observed.shear, r.shear_bed_scatter}, std::tuple{"plates", has_plates, r.observed.plates, r.plate_bed_scatter}}) {
      if (!there) continue;
      parts += fmt::format("{}{} {:.1f} %", parts.empty() ? "" : ", ", name, percent(misfit));
      scatter += fmt::format("{}{:.0f} % ({})", scatter.empty() ? "" : " and ", 100 * beds, name);
    }
    std::printf("misfit %s: %.1f %% (%s)\n", r.confirmations > 0 ? fmt::format("of the mean of {} new evaluations at this place", r.confirmations).c_str() : "of the best evaluation",
                percent(r.observed.total), parts.c_str());
    for (std::size_t t = 0; t < r.standardised.size(); ++t) std::printf("%s: %.1f standard errors from the measured curve\n", plan.targets[t].name().c_str(), r.standardised[t]);
    if (!r.sample.empty()) std::printf("evaluations of one place scatter by %s\n", scatter.c_str());
    if (r.front.size() > 1)
      std::printf("front: from %.1f %% in shear with %.1f %% for the plates to %.1f %% with %.1f %%\n", percent(r.front.front().misfit.shear), percent(r.front.front().misfit.plates),
                  percent(r.front.back().misfit.shear), percent(r.front.back().misfit.plates));
    print_warnings(r.warnings);
  }
  if (!common.report.empty()) {
    report::Page page("Grain parameters: " + (recording.title.empty() ? a.recording : recording.title));
    page.subtitle(recording.source).command(common.command_line);
    double worst = 0.0;
    for (const double z : r.standardised) worst = std::max(worst, z);
    if (r.confirmations > 0)
      page.verdict(worst < 2.0 ? report::Mood::good : report::Mood::warning,
                   worst < 2.0 ? "The simulated curves agree with the measured ones within their scatter." : fmt::format("Simulated and measured curves differ by up to {:.1f} standard errors.", worst));
    std::vector<std::pair<std::string, std::string>> facts = {{"evaluations", std::to_string(done.size())}, {"misfit", fmt::format("{:.1f} %", percent(r.observed.total))},
                                                              {"processor time", fmt::format("{:.0f} s", seconds)}};
    for (const auto& e : r.estimates)
      if (facts.size() < 6) facts.emplace_back(e.name, fmt::format("{:.3g} {}", e.value, e.unit == "-" ? "" : e.unit));
    page.facts(facts);
    report::Table table;
    table.columns = {{"parameter"}, {"value"}, {"low", "", 3, r.sample.empty() ? "range searched" : "interval"}, {"high", "", 3, r.sample.empty() ? "range searched" : "interval"}, {"unit"}, {"note"}};
    for (const auto& e : r.estimates) table.rows.push_back({e.name, e.value, e.low, e.high, e.unit, r.sample.empty() || e.identified ? "" : "not identified"});
    if (!r.sample.empty()) table.caption = fmt::format("Intervals hold {:.0f} percent of what the tests leave possible within the ranges searched.", 100 * o.confidence);
    page.section("Parameters").table(table);
    warnings_on(page, r.warnings);
    page.section("Search");
    if (has_shear && has_plates) page.figures({best_so_far_figure(search, done, r), front_figure(search, done, r)});
    else page.figure(best_so_far_figure(search, done, r));
    std::vector<report::Figure> curves, distributions;
    for (std::size_t t = 0; t < plan.targets.size() && r.confirmations > 0; ++t)
      curves.push_back(curve_figure(plan.targets[t], r.confirmed[t], r.confirmed_deviation[t], fmt::format("simulated (mean of {} beds and their deviation)", r.confirmations)));
    if (!curves.empty()) page.section("Curves").figures(curves);
    if (!r.sample.empty()) {
      for (std::size_t i = 0; i < search.parameters().size(); ++i) distributions.push_back(distribution_figure(search.parameters()[i], r, static_cast<Eigen::Index>(i)));
      page.section("What the tests say of each parameter").figures(distributions);
    }
    page.download("result.json", json_text(document, 1));
    page.write_html(common.report);
    note(common, "wrote " + common.report);
  }
}

}  // namespace

void add_calibrate_dem(Command& app, Common& common) {
  Command* command = app.add_subcommand("calibrate-dem", "grain parameters whose simulated soil tests match the measured ones; resumable");
  const auto a = std::make_shared<CalibrateDemArguments>();
  static const std::vector<std::string> searches = {"surrogate", "random", "simplex"};
  command->add_option("RECORDING", a->recording, "recording with direct shear and pressure-sinkage tests")->type_name("");
  command->add_option("-o,--output", a->output, "folder that keeps the evaluations; what is in it already is not computed again")->type_name("DIR");
  command->add_option("--free", a->free, "parameters to find: young_modulus, friction, rolling_friction, restitution, grain_size, grain_spread (default: the first three)")->delimiter(',')->type_name("NAMES");
  command->add_option("--range", a->ranges, "range of a free parameter, such as friction=0.2:1.0")->type_name("NAME=LOW:HIGH");
  command->add_option("--set", a->fixed, "value of a parameter that is not free")->type_name("NAME=VALUE");
  command->add_option("--evaluations", a->evaluations, "how many for each bed (default: 40, and 12 for each dearer bed)")->delimiter(',')->type_name("LIST");
  command->add_option("--grains", a->grains, "grain diameters across the narrowest plate, one number for each bed, cheap to dear (default: 5)")->delimiter(',')->type_name("LIST");
  command->add_option("--beds", a->beds, "beds of different seeds that one evaluation averages (default: 1)")->check(range(1, 1000))->type_name("N");
  command->add_option("--batch", a->batch, "evaluations asked for at a time (default: 4)")->check(range(1, 256))->type_name("N");
  command->add_option("--confirm", a->confirmations, "of the evaluations, those that repeat the place found with new beds (default: a fifth, at most 4)")->check(range(0, 1000))->type_name("N");
  command->add_option("--search", a->search, "surrogate, or for comparison random or simplex")->check(is_member(searches))->type_name("HOW");
  command->add_option("--shear-weight", a->shear_weight, "of direct shear in the misfit, from 0 to 1 (default: 0.5)")->check(range(0.0, 1.0))->type_name("W");
  command->add_option("--box", a->box, "side of the simulated shear box (default: 1.2 widths of the narrowest plate, else 60 mm)")->type_name("LENGTH");
  command->add_option("--max-depth", a->max_depth, "leave out what a plate did beyond this sinkage")->type_name("LENGTH");
  command->add_option("--max-shear", a->max_shear, "leave out what a shear test did beyond this displacement")->type_name("LENGTH");
  command->add_option("--shear-rate", a->shear_rate, "of the simulated shear test")->type_name("SPEED");
  command->add_option("--plate-rate", a->plate_rate, "of the simulated plate")->type_name("SPEED");
  command->add_option("--bulk-density", a->bulk_density, "of the bed (default: the recording's, else 1600 kg/m^3)")->type_name("DENSITY");
  command->add_option("--confidence", a->confidence, "of intervals (default: 0.95)")->check(range(0.01, 0.9999))->type_name("P");
  command->add_flag("--overwrite", a->overwrite, "begin anew in a folder that holds another search");
  command->add_option("--evaluate", a->evaluate, "")->hidden();
  common.words["calibrate-dem --search"] = searches;
  add_common(*command, common, true);
  command->callback([a, &common] { calibrate_dem(*a, common); });
}

}  // namespace terrode::cli
