#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "calibration/soil_file.h"
#include "calibration/soil_tests.h"
#include "calibration/wheel_fit.h"
#include "cli/calibration_output.h"
#include "cli/terminal.h"
#include "core/units.h"
#include "report/page.h"
#include "scenario/recording_file.h"
#include "scenario/section.h"

namespace terrode::cli {
namespace {

using calibration::SoilTestFits;
using calibration::WheelFit;

struct CalibrateArguments {
  std::string recording, to, output, weighting = "absolute", min_depth, max_depth, max_shear, plate_width;
  std::vector<std::string> free;
  double confidence = 0.95;
  int starts = 24;
  bool no_priors = false, no_profiles = false;
};

double length(const std::string& text, const std::string& option) {
  const QuantityText q = parse_quantity(text, "m");
  if (!q.error.empty()) throw InputError(Problem{{}, 0, 0, option, q.error, "a length such as '20 mm'"});
  return q.value;
}

void calibrate(const CalibrateArguments& a, Common& common) {
  const recording::Recording recording = scenario::load_recording(a.recording, common.threads);
  for (const std::string& r : recording.remarks) note(common, r);
  const bool has_tests = !recording.direct_shear.empty() || !recording.pressure_sinkage.empty();
  std::string to = a.to;
  if (to.empty()) to = !has_tests ? "wheel" : recording.runs.empty() ? "soil_tests" : "all";
  if (to == "soil_tests" && !has_tests) throw InputError(Problem{a.recording, 0, 0, "soil_tests", "holds no soil test", "direct_shear or pressure_sinkage tests, or --to wheel"});

  calibration::SoilTestOptions options;
  options.confidence = a.confidence;
  options.weighting = a.weighting == "relative" ? calibration::Weighting::relative : calibration::Weighting::absolute;
  if (!a.min_depth.empty()) options.minimum_sinkage = length(a.min_depth, "--min-depth");
  if (!a.max_depth.empty()) options.maximum_sinkage = length(a.max_depth, "--max-depth");
  if (!a.max_shear.empty()) options.maximum_shear_displacement = length(a.max_shear, "--max-shear");
  if (!a.plate_width.empty()) options.plate_width = length(a.plate_width, "--plate-width");

  SoilTestFits tests;
  if (to != "wheel") tests = calibration::fit_soil_tests(recording, options);
  recording::SoilBelief soil = recording.soil;
  calibration::apply(tests, soil);

  std::optional<calibration::WheelData> data;
  std::optional<WheelFit> wheel, combined;
  if (to != "soil_tests") {
    data = calibration::wheel_data(recording);
    for (const std::string& n : data->notes) note(common, n);
    calibration::WheelFitOptions o;
    if (!a.free.empty()) o.free = a.free;
    o.starts = a.starts;
    o.confidence = a.confidence;
    o.profiles = !a.no_profiles;
    o.threads = common.threads;
    o.seed = common.seed;
    bekker::Soil s;
    s.cohesion = soil.cohesion.value_or(s.cohesion);
    s.friction_angle = soil.friction_angle.value_or(s.friction_angle);
    s.shear_modulus = soil.shear_modulus.value_or(s.shear_modulus);
    s.n = soil.n.value_or(s.n);
    if (soil.k && soil.plate_width) {
      s.k = *soil.k;
      s.plate_width = *soil.plate_width;
    } else if (soil.kc && soil.kphi) {
      s.plate_width = 1.0;
      s.k = bekker::bekker_modulus(*soil.kc, *soil.kphi, recording.wheel.width);
      o.start_from_soil = true;
    }
    s.bulk_density = soil.bulk_density.value_or(s.bulk_density);
    if (s.plate_width > 0.5) {  // k of a contact 1 m wide says little: keep the pressure, name a plate's width
      s.k *= std::pow(0.05, s.n);
      s.plate_width = 0.05;
    }
    o.soil = s;
    o.angles.a0 = soil.a0.value_or(o.angles.a0);
    o.angles.a1 = soil.a1.value_or(o.angles.a1);
    o.angles.theta_r = soil.theta_r.value_or(o.angles.theta_r);
    for (const char* name : calibration::kWheelParameters)
      if (std::find(o.free.begin(), o.free.end(), name) == o.free.end()) {
        const bool known = (std::string(name) == "cohesion" && soil.cohesion) || (std::string(name) == "friction_angle" && soil.friction_angle) ||
                           (std::string(name) == "shear_modulus" && soil.shear_modulus) || (std::string(name) == "n" && soil.n) || (std::string(name) == "k" && (soil.k || soil.kphi)) ||
                           std::string(name) == "a0" || std::string(name) == "a1" || std::string(name) == "theta_r";
        if (!known) throw InputError(Problem{a.recording, 0, 0, std::string("soil.bekker.") + name, "is not known and not among the parameters that are fitted", "a value in the recording, or its name in --free"});
      }
    const Progress progress = show_progress(common);
    wheel = calibration::fit_wheel(*data, o, progress);
    if (to == "all" && has_tests && !a.no_priors) {
      if (tests.shear) o.priors.push_back(*tests.shear);
      if (tests.sinkage) o.priors.push_back(*tests.sinkage);
      combined = calibration::fit_wheel(*data, o, progress);
    }
    const WheelFit& best = combined ? *combined : *wheel;
    soil.cohesion = best.soil.cohesion;
    soil.friction_angle = best.soil.friction_angle;
    soil.shear_modulus = best.soil.shear_modulus;
    soil.k = best.soil.k;
    soil.plate_width = best.soil.plate_width;
    soil.n = best.soil.n;
    soil.kc.reset();
    soil.kphi.reset();
    soil.a0 = best.angles.a0;
    soil.a1 = best.angles.a1;
    soil.theta_r = best.angles.theta_r;
  }
  const std::vector<Comparison> comparison = wheel ? compare(tests, *wheel) : std::vector<Comparison>{};
  const Problems missing = scenario::check_soil(soil);

  Json document = {{"recording", a.recording}, {"title", recording.title}, {"to", to}};
  if (to != "wheel") document["soil_tests"] = soil_tests_json(tests);
  if (wheel) document["wheel"] = wheel_json(*wheel, *data);
  if (combined) document["combined"] = wheel_json(*combined, *data);
  if (!comparison.empty()) document["disagreement"] = comparison_json(comparison);
  const auto value = [](const std::optional<double>& v) { return v ? number(*v) : Json(); };
  document["soil"] = {{"cohesion", value(soil.cohesion)}, {"friction_angle", value(soil.friction_angle)}, {"shear_modulus", value(soil.shear_modulus)},
                      {"k", value(soil.k)}, {"n", value(soil.n)}, {"plate_width", value(soil.plate_width)}, {"a0", value(soil.a0)}, {"a1", value(soil.a1)}, {"theta_r", value(soil.theta_r)}};
  Json absent = Json::array();
  for (const Problem& p : missing) absent.push_back(p.key);
  document["soil_missing"] = absent;

  if (common.json) {
    print_json(document);
  } else {
    if (tests.shear) {
      print_fit("direct shear (Eq. 24)", *tests.shear);
      std::printf("by Wong's way: K = %.4g m%s\n", tests.shear->wong_shear_modulus,
                  tests.shear->wong_cohesion ? fmt::format(", c = {:.4g} Pa, phi = {:.4g} rad", *tests.shear->wong_cohesion, *tests.shear->wong_friction_angle).c_str() : "");
      print_warnings(tests.shear->warnings);
    }
    if (tests.sinkage) {
      print_fit(fmt::format("pressure-sinkage (Eq. 25), plate width {:.4g} m", tests.sinkage->plate_width), *tests.sinkage);
      std::printf("by Wong's weighted least squares: k = %.4g Pa, n = %.4g\n", tests.sinkage->wong_k, tests.sinkage->wong_n);
      print_warnings(tests.sinkage->warnings);
    }
    if (tests.moduli) {
      print_fit("several plates, sigma = (kc/b + kphi) z^n", *tests.moduli);
      std::printf("by Wong's weighted least squares: kc = %.4g, kphi = %.4g, n = %.4g\n", tests.moduli->wong_kc, tests.moduli->wong_kphi, tests.moduli->wong_n);
      print_warnings(tests.moduli->warnings);
    }
    if (tests.unloading) {
      print_fit("unloading, k_u = k0 + A_u z", *tests.unloading);
      print_warnings(tests.unloading->warnings);
    }
    print_warnings(tests.warnings);
    if (wheel) {
      print_fit("wheel runs alone", *wheel);
      for (const auto& c : wheel->channels)
        if (c.count > 0) std::printf("%s: %d values, root mean square residual %.3g %s\n", c.name.c_str(), c.count, c.rmse, c.unit.c_str());
      std::printf("%d of %d starting points led to this minimum\n", wheel->starts_at_best, wheel->starts);
      print_warnings(wheel->warnings);
    }
    if (combined) {
      print_fit("wheel runs with the soil tests as priors", *combined);
      for (const auto& c : combined->channels)
        if (c.count > 0) std::printf("%s: root mean square residual %.3g %s\n", c.name.c_str(), c.rmse, c.unit.c_str());
      print_warnings(combined->warnings);
    }
    print_comparison(comparison);
  }
  for (const Problem& p : missing) note(common, "the soil lacks " + p.key + ": neither the recording nor this calibration sets it");
  if (!a.output.empty()) {
    write_text_atomically(a.output, calibration::soil_yaml(soil, fmt::format("{}\nfrom: {}\nby: {}", recording.title, a.recording, common.command_line)));
    note(common, "wrote " + a.output);
  }
  if (!common.report.empty()) {
    report::Page page("Calibration: " + (recording.title.empty() ? a.recording : recording.title));
    page.subtitle(recording.source).command(common.command_line);
    std::size_t apart = 0;
    for (const Comparison& c : comparison) apart += std::abs(c.distance) > 2.5;
    if (!comparison.empty())
      page.verdict(apart ? report::Mood::warning : report::Mood::good, apart ? fmt::format("Soil tests and wheel runs disagree on {} of {} parameters.", apart, comparison.size())
                                                                             : std::string("Soil tests and wheel runs agree within their errors."));
    soil_tests_on(page, tests);
    if (wheel) wheel_on(page, "Wheel runs alone", *wheel, *data);
    if (combined) wheel_on(page, "Wheel runs with the soil tests as priors", *combined, *data);
    if (!comparison.empty()) page.section("Where soil tests and wheel disagree").table(comparison_table(comparison));
    page.section("Soil file").listing("soil.yaml", calibration::soil_yaml(soil, recording.title), false);
    page.download("calibration.json", json_text(document, 2));
    page.write_html(common.report);
    note(common, "wrote " + common.report);
  }
}

}  // namespace

void add_calibrate(Command& app, Common& common) {
  Command* command = app.add_subcommand("calibrate", "soil parameters from soil tests and wheel runs, with covariances; writes a soil file");
  const auto a = std::make_shared<CalibrateArguments>();
  const std::vector<std::string> targets = {"soil_tests", "wheel", "all"};
  const std::vector<std::string> weightings = {"absolute", "relative"};
  command->add_option("RECORDING", a->recording, "recording: a folder or its recording.yaml")->required()->type_name("");
  command->add_option("--to", a->to, "soil_tests, wheel or all (default: what the recording holds)")->check(is_member(targets))->type_name("WHAT");
  command->add_option("-o,--output", a->output, "soil file (YAML) to write")->type_name("FILE");
  command->add_option("--weighting", a->weighting, "of soil tests: absolute (squares of stress) or relative (each test counts alike)")->check(is_member(weightings))->type_name("HOW");
  command->add_option("--min-depth", a->min_depth, "leave out what a plate did before this sinkage")->type_name("LENGTH");
  command->add_option("--max-depth", a->max_depth, "leave out what a plate did beyond this sinkage")->type_name("LENGTH");
  command->add_option("--max-shear", a->max_shear, "leave out what a shear test did beyond this displacement")->type_name("LENGTH");
  command->add_option("--plate-width", a->plate_width, "width that k refers to (default: the widest plate)")->type_name("LENGTH");
  command->add_option("--free", a->free, "parameters fitted to the wheel: cohesion, friction_angle, shear_modulus, k, n, a0, a1, theta_r")->delimiter(',')->type_name("NAMES");
  command->add_option("--starts", a->starts, "starting points of the wheel fit (default: 24)")->check(range(1, 10000))->type_name("N");
  command->add_option("--confidence", a->confidence, "of intervals (default: 0.95)")->check(range(0.01, 0.9999))->type_name("P");
  command->add_flag("--no-priors", a->no_priors, "with --to all: fit the wheel without the soil tests");
  command->add_flag("--no-profiles", a->no_profiles, "intervals of the wheel fit from standard errors (faster)");
  common.words["calibrate --to"] = targets;
  common.words["calibrate --weighting"] = weightings;
  add_common(*command, common, true);
  command->callback([a, &common] { calibrate(*a, common); });
}

}  // namespace terrode::cli
