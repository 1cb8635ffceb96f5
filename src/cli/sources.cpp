#include "cli/sources.h"

#include <filesystem>

#include "analysis/lines.h"
#include "bekker/steady_wheel.h"
#include "core/problem.h"
#include "recording/result_file.h"
#include "scenario/reader.h"
#include "scenario/recording_file.h"
#include "scenario/scenario.h"

namespace terrode::cli {

namespace fs = std::filesystem;

namespace {

bool has_extension(const std::string& path, std::initializer_list<const char*> extensions) {
  const std::string e = fs::path(path).extension().string();
  for (const char* x : extensions)
    if (e == x) return true;
  return false;
}

bool is_result(const std::string& path) {
  if (!has_extension(path, {".h5", ".hdf5"})) return false;
  return recording::Hdf5File::open(path).text_attribute("/", "filetype").value_or("").starts_with("terrode");
}

// The wheel of the scenario that a result file carries.
void wheel_of_result(const std::string& path, recording::Recording& r) {
  const recording::ResultHeader header = recording::read_header(recording::Hdf5File::open(path));
  for (const std::string& text : {header.scenario_resolved, header.scenario_text}) {
    if (text.empty() || r.wheel.radius > 0.0) continue;
    try {
      scenario::Source ignored;
      const scenario::Node root = scenario::parse_yaml(text, path);
      if (const scenario::Node* n = root.at("wheel.radius"))
        r.wheel.radius = scenario::read_number(*n, "wheel.radius", "m", scenario::above(0), ignored).value_or(0.0);
      if (const scenario::Node* n = root.at("wheel.grousers.count"))
        if (const auto count = scenario::read_integer(*n, "count", 0, 10000, ignored)) r.wheel.grouser_count = static_cast<int>(*count);
    } catch (const InputError&) {
      // A result without a readable scenario is still a result; what needs the radius says so.
    }
  }
}

}  // namespace

std::optional<ContactRinging> contact_ringing(const std::string& path, const recording::Run& run) {
  if (!is_result(path)) return std::nullopt;
  try {
    const recording::ResultHeader header = recording::read_header(recording::Hdf5File::open(path));
    const scenario::Scenario s = scenario::parse_scenario(header.scenario_resolved.empty() ? header.scenario_text : header.scenario_resolved, path);
    const bekker::SteadyWheel wheel(s.wheel_size(), s.bekker_soil(), s.contact_angles());
    bekker::Operating at;
    at.slip = run.condition.slip;
    const double load = run.condition.normal_load ? *run.condition.normal_load : s.rig.normal_load.value_or(0.0);
    if (run.condition.angular_velocity) at.angular_velocity = *run.condition.angular_velocity;
    constexpr double step = 0.02;  // of the load: the stiffness hardly changes over it
    at.normal_load = (1.0 + step) * load;
    const double above = wheel.solve(at).sinkage;
    at.normal_load = (1.0 - step) * load;
    const double below = wheel.solve(at).sinkage;
    if (!(above > below)) return std::nullopt;
    ContactRinging out;
    out.stiffness = 2.0 * step * load / (above - below);
    out.mass = s.rig.lifted_mass.value_or(load / s.rig.gravity);
    out.eigenfrequency = analysis::contact_eigenfrequency(out.stiffness, out.mass);
    return out;
  } catch (const std::exception&) {
    return std::nullopt;  // a name for a line is a help, not a must
  }
}

std::vector<std::string> methods_of(const std::string& path) {
  if (!is_result(path)) return {""};
  return recording::result_methods(recording::Hdf5File::open(path));
}

recording::Recording load_runs(const std::string& path, const std::string& method, const TableHelp& help, int threads) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError(Problem{path, 0, 0, {}, "no such file", "a recording, a table or a result file"});
  if (scenario::is_recording(path)) return scenario::load_recording(path, threads);
  if (fs::is_directory(path, error)) throw InputError(Problem{path, 0, 0, {}, "is a folder without recording.yaml", {}});
  if (is_result(path)) {
    recording::Recording r = recording::read_result(path, method);
    wheel_of_result(path, r);
    if (help.radius) r.wheel.radius = *help.radius;
    return r;
  }
  if (has_extension(path, {".yaml", ".yml"}))
    throw InputError(Problem{path, 0, 0, "format", "is not that of a recording", "format: recording/1, a table or a result file"});

  const fs::path beside = fs::path(path).parent_path() / "recording.yaml";
  if (help.columns.empty() && fs::exists(beside, error)) {
    recording::Recording all = scenario::load_recording(beside.string(), threads);
    for (recording::Run& run : all.runs) {
      if (run.file.empty() || !fs::equivalent(fs::path(all.folder) / run.file, path, error)) continue;
      recording::Run chosen = std::move(run);
      all.runs.clear();
      all.runs.push_back(std::move(chosen));
      return all;
    }
  }
  recording::Recording r;
  r.runs.push_back(scenario::load_table(path, help.columns, r.remarks));
  r.title = path;
  recording::Run& run = r.runs.front();
  r.wheel.radius = help.radius.value_or(0.0);
  r.wheel.grouser_count = help.grousers;
  recording::Condition& c = run.condition;
  c.angular_velocity = help.angular_velocity;
  c.forward_velocity = help.forward_velocity;
  c.slip = help.slip.value_or(0.0);
  if (help.slip && help.radius && c.angular_velocity && !c.forward_velocity)
    c.forward_velocity = *c.angular_velocity * *help.radius * (1.0 - *help.slip);
  return r;
}

}  // namespace terrode::cli
