#include "cli/vehicle_run.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <set>

#include "cli/terminal.h"
#include "core/parallel.h"
#include "recording/result_file.h"
#include "report/vehicle_page.h"
#include "scenario/vehicle_file.h"
#include "vehicle/frame_recorder.h"

namespace terrode::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kColumns[] = {"drawbar_pull", "driving_torque", "sinkage", "normal_load", "slip", "power"};

double mean_of_last_half(const std::vector<double>& values) {
  double sum = 0.0;
  const std::size_t from = values.size() / 2;
  for (std::size_t i = from; i < values.size(); ++i) sum += values[i];
  return values.size() > from ? sum / static_cast<double>(values.size() - from) : 0.0;
}

double last(const scenario::DriveResult& r, const std::string& name) {
  const recording::Channel* c = r.run.find(name);
  return c == nullptr || c->values.empty() ? 0.0 : c->values.back();
}

bool ended_early(const scenario::DriveResult& r) {
  return r.end == vehicle::RunEnd::immobilised || r.end == vehicle::RunEnd::overturned;
}

const char* end_name(vehicle::RunEnd end) {
  switch (end) {
    case vehicle::RunEnd::duration: return "duration";
    case vehicle::RunEnd::controller: return "finished";
    case vehicle::RunEnd::immobilised: return "immobilised";
    case vehicle::RunEnd::overturned: return "overturned";
    default: return "interrupted";
  }
}

recording::ResultHeader header_of(const scenario::DriveScenario& d, const Common& common) {
  recording::ResultHeader header = recording::ResultHeader::now("terrode run");
  header.title = d.base.title;
  header.scenario_file = d.file;
  header.scenario_text = d.text;
  header.command = common.command_line;
  header.seed = d.base.seed;
  return header;
}

// What a result holds beside the samples of /run.
void write_beside(recording::Hdf5File& file, const scenario::DriveScenario& d, const scenario::DriveResult& r) {
  file.set_attribute("/run", "vehicle", d.machine.name);
  file.set_attribute("/run", "end", end_name(r.end));
  file.set_attribute("/run", "energy_per_metre", r.energy_per_metre);
  if (!r.events.empty()) file.write_text("/events", r.events);
  for (const recording::Run& body : r.bodies)
    if (!body.time.empty()) recording::write_series(file, "/bodies/" + body.id, body);
  if (r.margins.empty()) return;
  recording::ResultTable table;
  table.columns = {{"time", "s", "since the run began", {}},
                   {"travel", "m", "path covered", {}},
                   {"mobility_margin", "N", "further resisting pull at the hitch that the wheels hold", {}},
                   {"at_least", "", "1: the pull's ramp ended before the machine did", {}}};
  for (const vehicle::MarginSample& m : r.margins) {
    table.columns[0].values.push_back(m.time);
    table.columns[1].values.push_back(m.travel);
    table.columns[2].values.push_back(m.pull);
    table.columns[3].values.push_back(m.at_least ? 1.0 : 0.0);
  }
  recording::write_table(file, "/mobility_margin", table);
}

report::VehicleReport report_of(const scenario::DriveScenario& d, const scenario::DriveResult& r, const Common& common) {
  report::VehicleReport out;
  out.title = d.base.title;
  out.command = common.command_line;
  out.scenario_name = fs::path(d.file).filename().string();
  out.scenario_text = d.text;
  out.machine = d.machine.name;
  for (const auto& w : d.machine.wheels) out.wheels.push_back(w.name);
  out.run = r.run;
  for (const Eigen::Vector2d& p : d.planned_path()) out.planned.emplace_back(p.x(), p.y());
  for (const vehicle::MarginSample& m : r.margins) out.margins.push_back({m.time, m.travel, m.pull, m.at_least});
  out.events = r.events;
  out.notes = d.base.notes;
  out.ended_early = ended_early(r);
  out.energy_per_metre = r.energy_per_metre;
  const vehicle::VehicleEnergy& e = r.energy;
  out.energy = {{"drives", e.drives},   {"gravity", e.gravity},   {"hitch", e.hitch}, {"springs and dampers", e.springs},
                {"ground", -e.ground}, {"rocks", -e.rocks}, {"motion", -e.kinetic}, {"not accounted for", e.residual()}};
  return out;
}

Json json_of(const scenario::DriveScenario& d, const scenario::DriveResult& r) {
  const vehicle::VehicleEnergy& e = r.energy;
  Json out = {{"scenario", d.file},
              {"vehicle", d.machine.name},
              {"end", end_name(r.end)},
              {"simulated_seconds", number(r.simulated_seconds)},
              {"samples", r.run.time.size()},
              {"travel", number(last(r, "travel"))},
              {"position", {number(last(r, "position_x")), number(last(r, "position_y"))}},
              {"energy_per_metre", number(r.energy_per_metre)},
              {"energy",
               {{"drives", number(e.drives)},
                {"gravity", number(e.gravity)},
                {"hitch", number(e.hitch)},
                {"springs", number(e.springs)},
                {"ground", number(e.ground)},
                {"rocks", number(e.rocks)},
                {"kinetic", number(e.kinetic)},
                {"residual", number(e.residual())}}},
              {"events", r.events},
              {"mobility_margin", Json::array()},
              {"wheels", Json::array()}};
  for (const vehicle::MarginSample& m : r.margins)
    out["mobility_margin"].push_back({{"time", number(m.time)}, {"travel", number(m.travel)}, {"pull", number(m.pull)}, {"at_least", m.at_least}});
  for (const auto& w : d.machine.wheels) {
    Json wheel = {{"name", w.name}};
    for (const char* c : kColumns) wheel[c] = number(mean_of_last_half(r.run.find(w.name + "_" + c)->values));
    out["wheels"].push_back(wheel);
  }
  return out;
}

scenario::DriveScenario load(const std::string& path, const Common& common) {
  scenario::DriveScenario d = scenario::load_drive(path);
  if (common.seed_given()) {
    d.base.seed = static_cast<int>(common.seed);
    d.options.seed = static_cast<std::uint64_t>(common.seed);
  }
  return d;
}

// "file: taken: ..." is for validate; a run says what was left out.
void say_notes(const scenario::DriveScenario& d, const Common& common) {
  for (const std::string& n : d.base.notes)
    if (n.find(": taken: ") == std::string::npos) note(common, n);
}

}  // namespace

void run_vehicle(const std::string& path, const VehicleArguments& a, Common& common) {
  const scenario::DriveScenario d = load(path, common);
  if (a.frames > 0 && a.kept.output.empty()) throw InputError({{}, 0, 0, "--frames", "needs a file to be kept in", "-o OUT.h5"});
  const double until = std::min(a.until.value_or(d.duration), d.duration);
  std::string work = fmt::format("vehicle --until {} --frames {} --seed {}\n{}\n{}", until, a.frames, d.base.seed, d.text, d.named_files());
  if (!a.resume.empty()) work += fmt::format("--resume {} {}\n", a.resume, fs::exists(a.resume) ? fs::file_size(a.resume) : 0);
  KeptRun kept(a.kept, header_of(d, common), work, common);
  say_notes(d, common);
  std::optional<scenario::DriveRun> made;
  {
    const Progress progress = show_progress(common);
    made.emplace(d, common.threads, progress);
  }
  scenario::DriveRun& run = *made;
  if (kept.resume())
    run.take_up(*kept.resume());
  else if (!a.resume.empty())
    run.resume(recording::Hdf5File::open(a.resume));
  std::optional<vehicle::FrameRecorder> frames;
  if (a.frames > 0) {
    frames.emplace(vehicle::frame_settings(run.vehicle(), d.planned_path(), until, static_cast<std::size_t>(a.frames)));
    if (kept.resume()) frames->take_up(kept.resume()->byte("frames"), run.vehicle().simulation());
  }
  kept.extra = [&](recording::Hdf5File& file) {
    if (frames && frames->count() > 0) frames->write(file);
    write_beside(file, d, run.result());
  };
  run.vehicle().set_observer([&](vehicle::Vehicle& v) {
    if (frames) frames->observe(v.time(), v.simulation());
    kept.sample([&] { return v.so_far(); },
                [&] {
                  recording::Checkpoint c = v.checkpoint(run.controller());
                  if (frames) c.bytes["frames"] = frames->state();
                  return c;
                });
  });
  {
    Progress progress = show_progress(common);
    progress.stop_requested = [&kept] { return kept.stop(); };
    try {
      run.run(until, progress);
    } catch (const Interrupted&) {
      kept.interrupted();
    } catch (const InputError&) {
      throw;
    } catch (const std::exception& e) {
      kept.fail(run.result().run, e.what());
      throw;
    }
  }
  const scenario::DriveResult r = run.result();
  kept.finish(r.run);
  if (!a.state.empty())
    recording::write_atomically(a.state, false, [&](recording::Hdf5File& file) {
      recording::write_header(file, header_of(d, common));
      run.save(file);
    });
  if (!a.csv.empty()) write_text_atomically(a.csv, recording::series_csv(r.run));
  if (!common.report.empty()) report::vehicle_page(report_of(d, r, common)).write_html(common.report);
  for (const std::string& e : r.events) note(common, e);
  if (common.json) {
    print_json(json_of(d, r));
    return;
  }
  std::printf("%s: %.3g m in %.3g s, ends at (%.3g, %.3g) m, %.4g J/m\n", d.machine.name.c_str(), last(r, "travel"),
              r.simulated_seconds, last(r, "position_x"), last(r, "position_y"), r.energy_per_metre);
  for (const vehicle::MarginSample& m : r.margins)
    std::printf("mobility margin after %.3g s and %.3g m: %s%.4g N\n", m.time, m.travel, m.at_least ? "at least " : "", m.pull);
  std::vector<std::vector<std::string>> rows = {{"wheel (means of the second half)", "drawbar pull [N]", "torque [N m]",
                                                 "sinkage [mm]", "load [N]", "slip", "power [W]"}};
  for (const auto& w : d.machine.wheels) {
    rows.push_back({w.name});
    for (const char* c : kColumns) {
      const double scale = std::string(c) == "sinkage" ? 1e3 : 1.0;
      rows.back().push_back(fmt::format("{:.4g}", scale * mean_of_last_half(r.run.find(w.name + "_" + c)->values)));
    }
  }
  std::fputs(aligned(rows).c_str(), stdout);
}

void run_vehicles(const std::vector<std::string>& files, const VehicleArguments& a, Common& common) {
  for (const auto& [option, given] : {std::pair{"--csv", !a.csv.empty()}, {"--state", !a.state.empty()}, {"--resume", !a.resume.empty()},
                                      {"--report", !common.report.empty()}, {"--frames", a.frames > 0}})
    if (given) throw InputError({{}, 0, 0, option, "is for one scenario", "a single scenario, or none of it"});
  std::vector<scenario::DriveScenario> drives;
  Problems problems;
  std::set<std::string> names;
  for (const std::string& f : files) {
    try {
      drives.push_back(load(f, common));
    } catch (const InputError& e) {
      problems.insert(problems.end(), e.problems().begin(), e.problems().end());
    }
    if (!names.insert(fs::path(f).stem().string()).second && !a.kept.output.empty())
      problems.push_back({f, 0, 0, "name", "is that of another scenario of this call", "files of different names: results are called after them"});
  }
  throw_if_any(problems);
  for (const scenario::DriveScenario& d : drives) say_notes(d, common);
  if (!a.kept.output.empty()) fs::create_directories(a.kept.output);
  std::vector<scenario::DriveResult> results(drives.size());
  std::vector<std::string> failures(drives.size());
  const Progress progress = show_progress(common);
  std::vector<double> shares(drives.size(), 0.0);
  std::mutex mutex;
  parallel_for(drives.size(), common.threads, [&](std::size_t i) {
    Progress own = progress;
    own.report = [&, i](double share, const std::string& what) {
      const std::lock_guard<std::mutex> lock(mutex);
      shares[i] = share;
      double sum = 0.0;
      for (const double s : shares) sum += s;
      progress.report(sum / static_cast<double>(shares.size()), what);
    };
    scenario::DriveRun run(drives[i], 1, own);
    try {
      run.run(std::min(a.until.value_or(drives[i].duration), drives[i].duration), own);
    } catch (const RunError& e) {
      failures[i] = e.what();
    }
    results[i] = run.result();
    if (!a.kept.output.empty())
      recording::write_atomically((fs::path(a.kept.output) / (fs::path(files[i]).stem().string() + ".h5")).string(), false,
                                  [&](recording::Hdf5File& file) {
                                    recording::write_header(file, header_of(drives[i], common));
                                    recording::write_series(file, "/run", results[i].run);
                                    write_beside(file, drives[i], results[i]);
                                  });
  });
  Json all = Json::array();
  std::vector<std::vector<std::string>> rows = {{"scenario", "path [m]", "time [s]", "J/m", "end"}};
  for (std::size_t i = 0; i < drives.size(); ++i) {
    Json one = json_of(drives[i], results[i]);
    if (!failures[i].empty()) {
      one["error"] = failures[i];
      common.status = 1;
    }
    all.push_back(one);
    rows.push_back({files[i], fmt::format("{:.4g}", last(results[i], "travel")), fmt::format("{:.4g}", results[i].simulated_seconds),
                    fmt::format("{:.4g}", results[i].energy_per_metre), failures[i].empty() ? end_name(results[i].end) : failures[i]});
    for (const std::string& e : results[i].events) note(common, files[i] + ": " + e);
  }
  if (common.json)
    print_json({{"results", all}});
  else
    std::fputs(aligned(rows).c_str(), stdout);
}

}  // namespace terrode::cli
