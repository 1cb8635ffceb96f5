#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "analysis/steady_state.h"
#include "cli/input.h"
#include "cli/kept_run.h"
#include "cli/particle_tests.h"
#include "cli/sweep_result.h"
#include "cli/terminal.h"
#include "cli/vehicle_run.h"
#include "recording/result_file.h"
#include "scenario/ground.h"
#include "scenario/methods.h"
#include "scenario/particle_tests.h"
#include "scenario/vehicle_file.h"
#include "vehicle/frame_recorder.h"
#include "vehicle/slip_sweep.h"

namespace terrode::cli {
namespace {

struct RunArguments {
  std::string scenario, csv, soil, method;
  std::string slip;
  int frames = 0;
  KeptRunOptions kept;
  std::string state, resume;
  std::optional<double> until;
};

void refuse(const char* option, bool given, const char* what) {
  if (given) throw InputError({{}, 0, 0, option, std::string("is for ") + what, "another option"});
}

void run_rig(const RunArguments& a, Common& common) {
  const char* const vehicles = "vehicle scenarios";
  refuse("--state", !a.state.empty(), vehicles);
  refuse("--resume", !a.resume.empty(), vehicles);
  refuse("--until", a.until.has_value(), vehicles);
  if (scenario::is_particle_tests(a.scenario)) {
    if (!a.method.empty() || !a.slip.empty() || a.frames > 0)
      throw InputError({a.scenario, 0, 0, "--method, --slip, --frames", "do not go with soil tests on particles", "a scenario of a wheel"});
    return run_particle_tests(a.scenario, a.kept.output, a.csv, a.soil, a.kept.overwrite, common);
  }
  if (!a.soil.empty()) throw InputError({a.scenario, 0, 0, "--soil", "is for soil tests on particles", "a file with the key particle_tests"});
  refuse("--report", !common.report.empty(), vehicles);
  scenario::Scenario s = load_input(a.scenario, common);
  if (a.frames > 0 && a.kept.output.empty()) throw InputError({{}, 0, 0, "--frames", "needs a file to be kept in", "-o OUT.h5"});
  std::string method = a.method;
  for (const std::string& m : s.methods)
    if (method.empty() && m != "steady") method = m;
  if (method.empty()) method = "node-spring";
  if (method == "steady")
    throw InputError({{}, 0, 0, "--method", "is 'steady', which has no time", "node-spring, dem or mpi (or the command sweep)"});
  if (!a.slip.empty()) {
    const std::vector<double> slips = scenario::parse_slips(a.slip);
    if (slips.size() != 1) throw InputError({{}, 0, 0, "--slip", fmt::format("is '{}'", a.slip), "one slip (or the command sweep)"});
    s.rig.slip = slips.front();
  }
  scenario::MethodSettings settings;
  settings.threads = common.threads;
  const scenario::OperatingPoint at = s.operating_points({s.rig.slip}).front();
  recording::Condition condition = scenario::condition_of(at, s.wheel.radius);

  recording::ResultHeader header = recording::ResultHeader::now("terrode run");
  header.title = s.title;
  header.scenario_file = s.file;
  header.scenario_text = s.text;
  header.scenario_resolved = scenario::to_yaml(s) + scenario::ground_files(s);
  header.slip_convention = s.rig.slip_convention;
  header.command = common.command_line;
  header.seed = s.seed;
  const std::string work = fmt::format("run --method {} --slip {} --frames {} --seed {}\n{}", method, at.slip, a.frames, s.seed,
                                       header.scenario_resolved);
  KeptRun kept(a.kept, std::move(header), work, common);
  settings.resume = kept.resume();

  const effects::EffectSet effects = scenario::effect_set(s);
  recording::Run until_now;  // the rig's samples, kept here for when it fails
  std::optional<vehicle::FrameRecorder> recorder;
  SweepPoint books;
  kept.extra = [&](recording::Hdf5File& file) {
    if (recorder && recorder->count() > 0) recorder->write(file);
    file.set_attribute("/run", "method", method);
    file.set_attribute("/run", "slip_wong_reece", at.slip);
    file.set_attribute("/run", "normal_load", at.normal_load);
    file.set_attribute("/run", "angular_velocity", at.angular_velocity);
    if (!std::isfinite(books.energy_audit)) return;
    for (const auto& [name, value] : energy_fields(books)) file.set_attribute("/run", name, value);
  };
  std::function<recording::Run()> read_until_now = [] { return recording::Run{}; };
  settings.observe = [&](vehicle::Rig& rig) {
    add_new_samples(rig.so_far(), until_now);
    read_until_now = [&until_now, &effects, &condition, load = rig.spec().normal_load, rim = *rig.shape().rolling()] {
      recording::Run run = until_now;
      vehicle::read_instruments(run, condition, load, effects, rim);
      return run;
    };
    if (a.frames > 0) {
      if (!recorder) {
        recorder.emplace(vehicle::frame_settings(rig, static_cast<std::size_t>(a.frames)));
        if (kept.resume()) recorder->take_up(kept.resume()->byte("frames"), rig.simulation());
      }
      recorder->observe(rig.last().time, rig.simulation());
    }
    kept.sample(read_until_now, [&] {
      recording::Checkpoint c = rig.checkpoint();
      if (recorder) c.bytes["frames"] = recorder->state();
      return c;
    });
  };
  settings.progress = show_progress(common);
  settings.observe_touchdown = [&](vehicle::Rig& rig) {
    kept.sample(read_until_now, [&] { return rig.checkpoint(); });
  };
  const vehicle::SweepMethod ready = scenario::make_method(method, s, settings);

  vehicle::PointResult result;
  {
    Progress progress = show_progress(common);
    progress.stop_requested = [&kept] { return kept.stop(); };
    try {
      result = ready.run(condition, progress);
    } catch (const Interrupted&) {
      kept.interrupted();
    } catch (const InputError&) {
      throw;
    } catch (const std::exception& e) {
      kept.fail(read_until_now(), e.what());
      throw;
    }
  }
  recording::Run& run = result.run;
  run.id = "run";
  if (result.energy) put_energy(*result.energy, books);
  kept.finish(run);
  if (!a.csv.empty()) write_text_atomically(a.csv, recording::series_csv(run));
  for (const std::string& e : result.events) note(common, e);

  analysis::SteadyOptions options;
  options.period = scenario::averaging_period(method, s, at);
  const auto states = analysis::steady_states(run, options);
  Json channels = Json::object();
  std::vector<std::vector<std::string>> rows = {{"channel", "unit", "mean", "+-", "deviation", ""}};
  for (const recording::Channel& c : run.channels) {
    const auto found = states.find(c.name);
    if (found == states.end() || c.name == "position" || c.name == "wheel_angle") continue;
    const analysis::SteadyState& state = found->second;
    channels[c.name] = {{"unit", c.unit}, {"mean", number(state.mean)}, {"std", number(state.std)}, {"sem", number(state.sem)},
                        {"steady", state.reached}};
    rows.push_back({c.name, c.unit, fmt::format("{:.6g}", state.mean), fmt::format("{:.2g}", state.sem), fmt::format("{:.3g}", state.std),
                    state.reached ? "" : "not settled: " + state.reason});
  }
  if (common.json) {
    Json document = {{"scenario", s.file},
                {"method", method},
                {"slip_convention", s.rig.slip_convention},
                {"slip", number(at.slip_given)},
                {"normal_load", at.normal_load},
                {"angular_velocity", at.angular_velocity},
                {"simulated_seconds", result.simulated_seconds},
                {"samples", run.time.size()},
                {"channels", channels},
                {"events", result.events}};
    if (result.energy)
      for (const auto& [name, value] : energy_fields(books)) document["energy"][name] = value;
    print_json(document);
  } else {
    std::fputs(aligned(rows).c_str(), stdout);
    if (result.energy) std::printf("energy: %s\n", energy_text({books}).c_str());
  }
}

void run(const RunArguments& a, Common& common) {
  if (std::filesystem::is_directory(a.scenario) || !scenario::is_drive(a.scenario)) {
    run_rig(a, common);
    return;
  }
  refuse("--method", !a.method.empty(), "rigs (a vehicle's ground stands in its scenario)");
  refuse("--slip", !a.slip.empty(), "rigs");
  VehicleArguments v;
  v.kept = a.kept;
  v.csv = a.csv;
  v.frames = a.frames;
  v.state = a.state;
  v.resume = a.resume;
  v.until = a.until;
  run_vehicle(a.scenario, v, common);
}

}  // namespace

void add_run(Command& app, Common& common) {
  Command* command = app.add_subcommand("run", "simulate a scenario as a time series: one run of the single-wheel rig, a vehicle, or soil tests on particles");
  const auto a = std::make_shared<RunArguments>();
  command->add_option("SCENARIO", a->scenario, "scenario file of a rig or a vehicle, or a recording")->required()->type_name("");
  command->add_option("--method", a->method, "node-spring, dem, mpi (default: the scenario's first that simulates in time)")
      ->check(is_member(scenario::method_names()))
      ->type_name("NAME");
  command->add_option("--slip", a->slip, "slip in place of rig.slip, by the convention of the scenario")->type_name("SLIP");
  add_kept_run(*command, a->kept);
  command->add_option("--frames", a->frames, "keep about N pictures of the run in the result file, for view and export --to vtk")
      ->check(range(1, 100000))
      ->type_name("N");
  command->add_option("--csv", a->csv, "write the time series, or the curves of soil tests, to this file")->type_name("FILE.csv");
  command->add_option("--soil", a->soil, "write the soil fitted to soil tests on particles to this file")->type_name("FILE.yaml");
  command->add_option("--until", a->until, "vehicles: stop at this time [s], before the scenario's end")->check(positive_number())->type_name("T");
  command->add_option("--state", a->state, "vehicles: write the state at the end to this file, for --resume")->type_name("FILE.h5");
  command->add_option("--resume", a->resume, "vehicles: go on from a state, to the bit as if never stopped")->type_name("FILE.h5");
  add_common(*command, common, true);
  common.words["run --method"] = {"node-spring", "dem", "mpi"};
  command->callback([a, &common] { run(*a, common); });
}

}  // namespace terrode::cli
