#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "analysis/quality.h"
#include "cli/terminal.h"
#include "scenario/ground.h"
#include "scenario/methods.h"
#include "scenario/particle_tests.h"
#include "scenario/recording_file.h"
#include "scenario/scenario.h"
#include "scenario/vehicle_file.h"

namespace terrode::cli {
namespace {

// What the samples of a recording show: the file can be read, but somebody should look.
std::vector<Problem> sample_warnings(const recording::Recording& recording) {
  std::vector<Problem> out;
  for (const recording::Run& run : recording.runs)
    for (const analysis::QualityFinding& f : analysis::check_quality(run, recording.wheel.radius))
      out.push_back({(std::filesystem::path(recording.folder) / run.file).lexically_normal().string(), f.line, 0,
                     f.channel, "warning: " + f.message, {}});
  return out;
}

void validate(const std::vector<std::string>& files, Common& common) {
  Json checked = Json::array();
  for (const std::string& file : files) {
    Problems problems;
    std::vector<std::string> notes;
    std::vector<Problem> warnings;
    try {
      if (scenario::is_recording(file)) {
        scenario::RecordingCheck check = scenario::check_recording(file, common.threads);
        problems = std::move(check.problems);
        notes = std::move(check.recording.remarks);
        warnings = sample_warnings(check.recording);
      } else if (scenario::is_particle_tests(file)) {
        scenario::load_particle_tests(file);
      } else if (scenario::is_machine(file)) {
        notes = scenario::load_machine(file).notes;
      } else if (scenario::is_drive(file)) {
        const scenario::DriveScenario d = scenario::load_drive(file);
        notes = d.base.notes;
        if (d.ground == "node-spring") {
          d.base.bekker_soil();
          d.base.contact_angles();
        }
        const effects::EffectSet effects = scenario::effect_set(d.base);
        // Particles would be settled first; the machine itself is checked on hard ground then.
        scenario::DriveScenario quick = d;
        if (d.on_particles()) {
          d.require_particles(effects);
          quick.ground = "rigid";
        }
        vehicle::Vehicle(quick.machine, quick.options, quick.make_ground(effects));
      } else {
        const scenario::Scenario s = scenario::load_scenario(file);
        notes = s.notes;
        s.bekker_soil();
        s.contact_angles();
        scenario::soil_field(s);
        scenario::point_law(s);
        s.wheel_shape();
        scenario::effect_set(s);
      }
    } catch (const InputError& e) {
      problems = e.problems();
    }
    if (!problems.empty()) common.status = 2;
    Json entry = {{"file", file}, {"ok", problems.empty()}, {"problems", Json::array()}, {"notes", notes}};
    for (Problem& p : problems) {
      if (p.file.empty()) p.file = file;
      entry["problems"].push_back(problem_json(p));
      if (!common.json) std::printf("%s\n", p.text().c_str());
    }
    entry["warnings"] = Json::array();
    for (const Problem& w : warnings) {
      entry["warnings"].push_back(problem_json(w));
      if (!common.json) std::printf("%s\n", w.text().c_str());
    }
    checked.push_back(std::move(entry));
    if (common.json) continue;
    for (const std::string& n : notes) note(common, n);
    if (problems.empty()) std::printf("%s: ok\n", file.c_str());
  }
  if (common.json) print_json({{"files", checked}});
}

}  // namespace

void add_validate(Command& app, Common& common) {
  Command* command = app.add_subcommand("validate", "check scenarios and recordings; print every problem with its place");
  const auto files = std::make_shared<std::vector<std::string>>();
  command->add_option("FILE", *files, "scenarios, recordings (a folder or its recording.yaml)")->required()->type_name("");
  add_common(*command, common, false);
  command->callback([files, &common] { validate(*files, common); });
}

}  // namespace terrode::cli
