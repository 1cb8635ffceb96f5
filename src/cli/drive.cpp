#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "cli/kept_run.h"
#include "cli/terminal.h"
#include "recording/result_file.h"
#include "scenario/reader.h"
#include "scenario/vehicle_file.h"

namespace terrode::cli {
namespace {

struct Arguments {
  std::string file;
  KeptRunOptions kept;
};

double mean_of_last_half(const std::vector<double>& values) {
  double sum = 0.0;
  const std::size_t from = values.size() / 2;
  for (std::size_t i = from; i < values.size(); ++i) sum += values[i];
  return values.size() > from ? sum / static_cast<double>(values.size() - from) : 0.0;
}

void drive(const Arguments& a, Common& common) {
  const scenario::DriveScenario d = scenario::load_drive(a.file);
  for (const std::string& n : d.base.notes) note(common, n);
  recording::ResultHeader header = recording::ResultHeader::now("terrode run");
  header.title = d.base.title;
  header.scenario_file = d.file;
  header.scenario_text = d.text;
  header.command = common.command_line;
  const std::string folder = std::filesystem::path(d.file).parent_path().string();
  const std::string work = "drive\n" + d.text + "\n" + scenario::named_files(scenario::parse_yaml(d.text, d.file), folder);
  KeptRun kept(a.kept, std::move(header), work, common);
  recording::Run until_now;
  const scenario::DriveObserver observe = [&](vehicle::Vehicle& machine, const vehicle::Controller& controller) {
    if (!a.kept.output.empty()) add_new_samples(machine.so_far(), until_now);
    kept.sample([&] { return machine.so_far(); }, [&] { return machine.checkpoint(controller); });
  };
  scenario::DriveResult r;
  {
    Progress progress = show_progress(common);
    progress.stop_requested = [&kept] { return kept.stop(); };
    try {
      r = scenario::run_drive(d, progress, observe, kept.resume().get());
    } catch (const Interrupted&) {
      kept.interrupted();
    } catch (const InputError&) {
      throw;
    } catch (const std::exception& e) {
      kept.fail(until_now, e.what());
      throw;
    }
  }
  for (const std::string& e : r.events) note(common, e);
  kept.finish(r.run);
  const auto last = [&](const std::string& name) {
    return r.run.find(name)->values.empty() ? 0.0 : r.run.find(name)->values.back();
  };
  const char* const columns[] = {"drawbar_pull", "driving_torque", "sinkage", "normal_load", "slip", "power"};
  if (common.json) {
    Json out = {{"scenario", d.file},
                {"vehicle", d.machine.name},
                {"simulated_seconds", number(r.simulated_seconds)},
                {"travel", number(last("travel"))},
                {"position", {number(last("position_x")), number(last("position_y"))}},
                {"energy_per_metre", number(r.energy_per_metre)},
                {"events", r.events}};
    for (const auto& w : d.machine.wheels) {
      Json wheel = {{"name", w.name}};
      for (const char* c : columns) wheel[c] = number(mean_of_last_half(r.run.find(w.name + "_" + c)->values));
      out["wheels"].push_back(wheel);
    }
    print_json(out);
    return;
  }
  std::printf("%s: %.3g m in %.3g s, ends at (%.3g, %.3g) m, %.4g J/m\n", d.machine.name.c_str(), last("travel"),
              r.simulated_seconds, last("position_x"), last("position_y"), r.energy_per_metre);
  std::vector<std::vector<std::string>> rows = {{"wheel (means of the second half)", "drawbar pull [N]", "torque [N m]",
                                                 "sinkage [mm]", "load [N]", "slip", "power [W]"}};
  for (const auto& w : d.machine.wheels) {
    rows.push_back({w.name});
    for (const char* c : columns) {
      const double scale = std::string(c) == "sinkage" ? 1e3 : 1.0;
      rows.back().push_back(fmt::format("{:.4g}", scale * mean_of_last_half(r.run.find(w.name + "_" + c)->values)));
    }
  }
  std::fputs(aligned(rows).c_str(), stdout);
}

}  // namespace

void add_drive(CLI::App& app, Common& common) {
  CLI::App* command = app.add_subcommand("drive", "a whole machine over soft ground, from a vehicle scenario");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SCENARIO", a->file, "vehicle scenario (YAML with a key `vehicle`)")->required()->type_name("");
  add_kept_run(*command, a->kept);
  add_common(*command, common, false);
  command->callback([a, &common] { drive(*a, common); });
}

}  // namespace terrode::cli
