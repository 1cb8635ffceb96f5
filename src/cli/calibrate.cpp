#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "calibration/soil_file.h"
#include "calibration/soil_tests.h"
#include "calibration/wheel_fit.h"
#include "cli/terminal.h"
#include "core/units.h"
#include "report/page.h"
#include "scenario/recording_file.h"
#include "scenario/section.h"

namespace terrode::cli {
namespace {

using calibration::Estimate;
using calibration::Fit;
using calibration::SoilTestFits;
using calibration::TestCurve;
using calibration::Warning;
using calibration::WheelFit;

struct Arguments {
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

Json warning_json(const Warning& w) { return {{"id", w.id}, {"parameter", w.parameter}, {"text", w.text}, {"remedy", w.remedy}}; }

Json matrix_json(const Eigen::MatrixXd& m) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < m.cols(); ++j) row.push_back(number(m(i, j)));
    rows.push_back(row);
  }
  return rows;
}

Json fit_json(const Fit& fit) {
  Json out, parameters = Json::object(), order = Json::array(), warnings = Json::array();
  for (const Estimate& e : fit.estimates) {
    order.push_back(e.name);
    parameters[e.name] = {{"value", number(e.value)}, {"std", number(e.std)}, {"low", number(e.low)}, {"high", number(e.high)}, {"unit", e.unit},
                          {"coordinate", e.coordinate == calibration::Coordinate::log ? "log" : "value"},
                          {"identified", e.identified}, {"at_bound", e.at_bound}};
  }
  for (const Warning& w : fit.warnings) warnings.push_back(warning_json(w));
  out["parameters"] = parameters;
  out["order"] = order;
  out["covariance"] = matrix_json(fit.covariance);
  out["coordinate_covariance"] = matrix_json(fit.coordinate_covariance);
  out["degrees_of_freedom"] = number(fit.degrees_of_freedom);
  out["confidence"] = fit.confidence;
  out["warnings"] = warnings;
  return out;
}

Json curves_json(const std::vector<TestCurve>& curves, const char* condition, const char* level, const char* shape) {
  Json out = Json::array();
  for (const TestCurve& c : curves)
    out.push_back({{"file", c.file}, {condition, number(c.condition)}, {"residual_rms", number(c.residual_rms)}, {"own_rms", number(c.own_rms)},
                   {"correlation", number(c.correlation)}, {"points", c.displacement.size()}, {"effective_points", number(c.effective_points)},
                   {std::string("own_") + level, number(c.own_level)}, {std::string("own_") + shape, number(c.own_shape)}, {"loops_cut", c.loops_cut}});
  return out;
}

Json soil_tests_json(const SoilTestFits& fits) {
  Json out = Json::object();
  if (fits.shear) {
    out["direct_shear"] = fit_json(*fits.shear);
    out["direct_shear"]["tests"] = curves_json(fits.shear->curves, "normal_stress", "residual_stress", "shear_modulus");
    Json wong = {{"shear_modulus", number(fits.shear->wong_shear_modulus)}, {"shear_modulus_between_tests_std", number(fits.shear->wong_shear_modulus_std)}};
    if (fits.shear->wong_cohesion) wong["cohesion"] = number(*fits.shear->wong_cohesion);
    if (fits.shear->wong_friction_angle) wong["friction_angle"] = number(*fits.shear->wong_friction_angle);
    out["direct_shear"]["wong"] = wong;
    out["direct_shear"]["between_tests"] = {{"level", number(fits.shear->between_level)}, {"shape", number(fits.shear->between_shape)}};
  }
  if (fits.sinkage) {
    out["pressure_sinkage"] = fit_json(*fits.sinkage);
    out["pressure_sinkage"]["plate_width"] = fits.sinkage->plate_width;
    out["pressure_sinkage"]["tests"] = curves_json(fits.sinkage->curves, "plate_width", "k", "n");
    out["pressure_sinkage"]["wong"] = {{"k", number(fits.sinkage->wong_k)}, {"n", number(fits.sinkage->wong_n)}};
    out["pressure_sinkage"]["between_tests"] = {{"level", number(fits.sinkage->between_level)}, {"shape", number(fits.sinkage->between_shape)}};
  }
  if (fits.moduli) {
    out["bekker_moduli"] = fit_json(*fits.moduli);
    Json plates = Json::array();
    for (const auto& p : fits.moduli->plates)
      plates.push_back({{"size", p.size}, {"tests", p.tests}, {"modulus", number(p.modulus)}, {"modulus_std", number(p.modulus_std)}, {"n", number(p.n)}});
    out["bekker_moduli"]["plates"] = plates;
    out["bekker_moduli"]["wong"] = {{"kc", number(fits.moduli->wong_kc)}, {"kphi", number(fits.moduli->wong_kphi)}, {"n", number(fits.moduli->wong_n)}};
  }
  if (fits.unloading) {
    out["unloading"] = fit_json(*fits.unloading);
    Json loops = Json::array();
    for (const auto& l : fits.unloading->loops)
      loops.push_back({{"file", l.file}, {"sinkage", l.sinkage}, {"pressure", l.pressure}, {"stiffness", number(l.stiffness)}, {"stiffness_std", number(l.stiffness_std)}});
    out["unloading"]["loops"] = loops;
  }
  Json warnings = Json::array();
  for (const Warning& w : fits.warnings) warnings.push_back(warning_json(w));
  out["warnings"] = warnings;
  return out;
}

Json wheel_json(const WheelFit& fit, const calibration::WheelData& data) {
  Json out = fit_json(fit);
  Json channels = Json::object(), points = Json::array();
  for (const auto& c : fit.channels)
    channels[c.name] = {{"count", c.count}, {"rmse", number(c.rmse)}, {"standard_error", number(c.standard_error)}, {"discrepancy", number(c.discrepancy)},
                        {"residual_correlation", number(c.correlation)}, {"unit", c.unit}};
  for (std::size_t p = 0; p < data.points.size(); ++p) {
    Json point = {{"id", data.points[p].id}, {"slip", number(data.points[p].operating.slip)}, {"normal_load", data.points[p].operating.normal_load}};
    for (std::size_t c = 0; c < 3; ++c) {
      point[calibration::kWheelChannels[c]] = data.points[p].mean[c] ? number(*data.points[p].mean[c]) : Json();
      point[std::string(calibration::kWheelChannels[c]) + "_fitted"] = number(fit.predicted[p][c]);
    }
    points.push_back(point);
  }
  out["channels"] = channels;
  out["points"] = points;
  out["starts"] = {{"used", fit.starts}, {"led_to_the_best", fit.starts_at_best}};
  out["rivals"] = fit.rivals;
  return out;
}

void print_fit(const std::string& title, const Fit& fit) {
  std::printf("%s\n", title.c_str());
  std::vector<std::vector<std::string>> rows = {{"parameter", "value", "std. error", fmt::format("{:.0f} % interval", 100 * fit.confidence), "", "unit", ""}};
  for (const Estimate& e : fit.estimates)
    rows.push_back({e.name, fmt::format("{:.5g}", e.value), fmt::format("{:.2g}", e.std), fmt::format("{:.4g}", e.low), fmt::format("{:.4g}", e.high), e.unit,
                    !e.identified ? "not identified" : e.at_bound ? "at its limit" : ""});
  std::printf("%s\n", aligned(rows).c_str());
}

void print_warnings(const std::vector<Warning>& warnings) {
  for (const Warning& w : warnings)
    std::printf("warning: %s%s%s%s\n", w.parameter.empty() ? "" : (w.parameter + ": ").c_str(), w.text.c_str(), w.remedy.empty() ? "" : "; to mend it: ", w.remedy.c_str());
  if (!warnings.empty()) std::printf("\n");
}

// A parameter that soil tests and wheel runs both set.
struct Comparison {
  std::string name, unit;
  double tests = 0.0, wheel = 0.0, distance = 0.0;  // in standard errors of the difference
};

std::vector<Comparison> compare(const SoilTestFits& tests, const Fit& wheel) {
  std::vector<Comparison> out;
  const auto add = [&](const Fit& fit) {
    for (std::size_t i = 0; i < fit.estimates.size(); ++i) {
      const Estimate& a = fit.estimates[i];
      const Estimate* b = wheel.find(a.name);
      if (!b || !a.identified) continue;
      const auto j = static_cast<Eigen::Index>(b - wheel.estimates.data()), k = static_cast<Eigen::Index>(i);
      const double variance = fit.coordinate_covariance(k, k) + wheel.coordinate_covariance(j, j);
      out.push_back({a.name, a.unit, a.value, b->value, variance > 0 ? (b->in_coordinate() - a.in_coordinate()) / std::sqrt(variance) : 0.0});
    }
  };
  if (tests.shear) add(*tests.shear);
  if (tests.sinkage) add(*tests.sinkage);
  return out;
}

report::Table estimates_table(const Fit& fit) {
  report::Table t;
  t.columns = {{"parameter"}, {"value"}, {"low", "", 4, "interval"}, {"high", "", 4, "interval"}, {"unit"}, {"note"}};
  for (const Estimate& e : fit.estimates)
    t.rows.push_back({e.name, report::PlusMinus{e.value, e.std}, e.low, e.high, e.unit, !e.identified ? "not identified" : e.at_bound ? "at its limit" : ""});
  t.caption = fmt::format("Intervals hold the true value with {:.0f} percent if the model is right.", 100 * fit.confidence);
  return t;
}

void warnings_on(report::Page& page, const std::vector<Warning>& warnings) {
  for (const Warning& w : warnings) page.callout(report::Mood::warning, w.parameter.empty() ? "Note" : w.parameter, w.text + (w.remedy.empty() ? "." : ". To mend it: " + w.remedy + "."));
}

std::vector<report::Figure> curve_figures(const std::vector<TestCurve>& curves, const std::string& x_label, const std::string& y_label, const std::function<std::string(const TestCurve&)>& name) {
  report::Figure fit, residual;
  fit.title = "Measured and fitted";
  residual.title = "Measured less fitted";
  fit.x = residual.x = {x_label, "mm"};
  fit.y = {y_label, "kPa"};
  residual.y = {"Residual", "kPa"};
  int colour = 0;
  for (const TestCurve& c : curves) {
    report::Series measured, fitted, rest;
    for (std::size_t i = 0; i < c.displacement.size(); ++i) {
      measured.x.push_back(1e3 * c.displacement[i]);
      measured.y.push_back(1e-3 * c.measured[i]);
      fitted.y.push_back(1e-3 * c.fitted[i]);
      rest.y.push_back(1e-3 * (c.measured[i] - c.fitted[i]));
    }
    fitted.x = rest.x = measured.x;
    measured.name = rest.name = name(c);
    measured.draw = report::Draw::points;
    measured.colour = fitted.colour = rest.colour = colour;
    fitted.dashed = true;
    fit.series.push_back(measured);
    fit.series.push_back(fitted);
    residual.series.push_back(rest);
    colour = (colour + 1) % 8;
  }
  return {fit, residual};
}

void soil_tests_on(report::Page& page, const SoilTestFits& fits) {
  if (fits.shear) {
    page.section("Direct shear: c, phi, K").table(estimates_table(*fits.shear));
    page.text(fmt::format("Wong's way of measuring gives K = {:.3g} mm.", 1e3 * fits.shear->wong_shear_modulus));
    page.figures(curve_figures(fits.shear->curves, "Shear displacement", "Shear stress", [](const TestCurve& c) { return fmt::format("{} ({:.4g} kPa)", c.file, 1e-3 * c.condition); }));
    warnings_on(page, fits.shear->warnings);
  }
  if (fits.sinkage) {
    page.section("Pressure-sinkage: k, n").table(estimates_table(*fits.sinkage));
    page.text(fmt::format("k refers to a width of {:.4g} mm. Wong's weighted least squares: k = {:.4g} Pa, n = {:.4g}.", 1e3 * fits.sinkage->plate_width, fits.sinkage->wong_k, fits.sinkage->wong_n));
    page.figures(curve_figures(fits.sinkage->curves, "Sinkage", "Pressure", [](const TestCurve& c) { return fmt::format("{} ({:.4g} mm)", c.file, 1e3 * c.condition); }));
    warnings_on(page, fits.sinkage->warnings);
  }
  if (fits.moduli) {
    page.section("Several plates: kc, kphi").table(estimates_table(*fits.moduli));
    report::Figure f;
    f.title = "Modulus against plate size";
    f.x = {"1/b", "1/m"};
    f.y = {"kc/b + kphi", "N/m^(n+2)"};
    report::Series plates, line;
    plates.name = "plates by themselves";
    plates.draw = report::Draw::points;
    line.name = "fit";
    double largest = 0;
    for (const auto& p : fits.moduli->plates) {
      plates.x.push_back(1 / p.size);
      plates.y.push_back(p.modulus);
      plates.low.push_back(p.modulus - p.modulus_std);
      plates.high.push_back(p.modulus + p.modulus_std);
      largest = std::max(largest, 1 / p.size);
    }
    for (const double x : {0.0, 1.1 * largest}) {
      line.x.push_back(x);
      line.y.push_back(fits.moduli->value("kc") * x + fits.moduli->value("kphi"));
    }
    f.series = {plates, line};
    page.figure(f);
    warnings_on(page, fits.moduli->warnings);
  }
  if (fits.unloading) {
    page.section("Unloading: k0, A_u").table(estimates_table(*fits.unloading));
    warnings_on(page, fits.unloading->warnings);
  }
  warnings_on(page, fits.warnings);
}

void wheel_on(report::Page& page, const std::string& heading, const WheelFit& fit, const calibration::WheelData& data) {
  page.section(heading).table(estimates_table(fit));
  constexpr double kScale[3] = {1.0, 1.0, 1e3};
  const char* labels[3] = {"Drawbar pull", "Driving torque", "Sinkage"};
  const char* units[3] = {"N", "N m", "mm"};
  std::vector<double> loads;
  for (const auto& p : data.points) {
    bool known = false;
    for (const double l : loads) known = known || std::abs(l - p.operating.normal_load) < 0.02 * l;
    if (!known) loads.push_back(p.operating.normal_load);
  }
  std::vector<report::Figure> figures;
  for (std::size_t c = 0; c < 3; ++c) {
    if (fit.channels[c].count == 0) continue;
    report::Figure f;
    f.title = labels[c];
    f.x = {"Slip", ""};
    f.y = {labels[c], units[c]};
    int colour = 0;
    for (const double load : loads) {
      std::vector<std::pair<double, std::size_t>> order;
      for (std::size_t p = 0; p < data.points.size(); ++p)
        if (std::abs(load - data.points[p].operating.normal_load) < 0.02 * load && std::isfinite(data.points[p].operating.slip)) order.emplace_back(data.points[p].operating.slip, p);
      std::sort(order.begin(), order.end());
      report::Series measured, fitted;
      measured.name = fmt::format("measured, {:.4g} N", load);
      fitted.name = fmt::format("fitted, {:.4g} N", load);
      measured.draw = report::Draw::points;
      measured.colour = fitted.colour = colour;
      for (const auto& [slip, p] : order) {
        fitted.x.push_back(slip);
        fitted.y.push_back(kScale[c] * fit.predicted[p][c]);
        if (!data.points[p].mean[c]) continue;
        measured.x.push_back(slip);
        measured.y.push_back(kScale[c] * *data.points[p].mean[c]);
        measured.low.push_back(measured.y.back() - kScale[c] * data.points[p].standard_error[c]);
        measured.high.push_back(measured.y.back() + kScale[c] * data.points[p].standard_error[c]);
      }
      f.series.push_back(measured);
      f.series.push_back(fitted);
      colour = (colour + 1) % 8;
    }
    f.caption = fmt::format("Root mean square residual {:.3g} {}.", kScale[c] * fit.channels[c].rmse, units[c]);
    figures.push_back(f);
  }
  page.figures(figures);
  warnings_on(page, fit.warnings);
}

void calibrate(const Arguments& a, Common& common) {
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
  if (!comparison.empty()) {
    Json list = Json::array();
    for (const Comparison& c : comparison) list.push_back({{"parameter", c.name}, {"soil_tests", number(c.tests)}, {"wheel", number(c.wheel)}, {"unit", c.unit}, {"standard_errors_apart", number(c.distance)}});
    document["disagreement"] = list;
  }
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
    if (!comparison.empty()) {
      std::vector<std::vector<std::string>> rows = {{"parameter", "soil tests", "wheel", "unit", "standard errors apart"}};
      for (const Comparison& c : comparison) rows.push_back({c.name, fmt::format("{:.4g}", c.tests), fmt::format("{:.4g}", c.wheel), c.unit, fmt::format("{:.1f}", c.distance)});
      std::printf("%s\n", aligned(rows).c_str());
    }
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
    if (!comparison.empty()) {
      report::Table t;
      t.columns = {{"parameter"}, {"soil tests"}, {"wheel"}, {"unit"}, {"standard errors apart", "", 2}};
      for (const Comparison& c : comparison) t.rows.push_back({c.name, c.tests, c.wheel, c.unit, c.distance});
      page.section("Where soil tests and wheel disagree").table(t);
    }
    page.section("Soil file").listing("soil.yaml", calibration::soil_yaml(soil, recording.title), false);
    page.download("calibration.json", document.dump(2));
    page.write_html(common.report);
    note(common, "wrote " + common.report);
  }
}

}  // namespace

void add_calibrate(CLI::App& app, Common& common) {
  CLI::App* command = app.add_subcommand("calibrate", "soil parameters from soil tests and wheel runs, with covariances; writes a soil file");
  const auto a = std::make_shared<Arguments>();
  const std::vector<std::string> targets = {"soil_tests", "wheel", "all"};
  const std::vector<std::string> weightings = {"absolute", "relative"};
  command->add_option("RECORDING", a->recording, "recording: a folder or its recording.yaml")->required()->type_name("");
  command->add_option("--to", a->to, "soil_tests, wheel or all (default: what the recording holds)")->check(CLI::IsMember(targets))->type_name("WHAT");
  command->add_option("-o,--output", a->output, "soil file (YAML) to write")->type_name("FILE");
  command->add_option("--weighting", a->weighting, "of soil tests: absolute (squares of stress) or relative (each test counts alike)")->check(CLI::IsMember(weightings))->type_name("HOW");
  command->add_option("--min-depth", a->min_depth, "leave out what a plate did before this sinkage")->type_name("LENGTH");
  command->add_option("--max-depth", a->max_depth, "leave out what a plate did beyond this sinkage")->type_name("LENGTH");
  command->add_option("--max-shear", a->max_shear, "leave out what a shear test did beyond this displacement")->type_name("LENGTH");
  command->add_option("--plate-width", a->plate_width, "width that k refers to (default: the widest plate)")->type_name("LENGTH");
  command->add_option("--free", a->free, "parameters fitted to the wheel: cohesion, friction_angle, shear_modulus, k, n, a0, a1, theta_r")->delimiter(',')->type_name("NAMES");
  command->add_option("--starts", a->starts, "starting points of the wheel fit (default: 24)")->check(CLI::Range(1, 10000))->type_name("N");
  command->add_option("--confidence", a->confidence, "of intervals (default: 0.95)")->check(CLI::Range(0.01, 0.9999))->type_name("P");
  command->add_flag("--no-priors", a->no_priors, "with --to all: fit the wheel without the soil tests");
  command->add_flag("--no-profiles", a->no_profiles, "intervals of the wheel fit from standard errors (faster)");
  common.words["calibrate --to"] = targets;
  common.words["calibrate --weighting"] = weightings;
  add_common(*command, common, true);
  command->callback([a, &common] { calibrate(*a, common); });
}

}  // namespace terrode::cli
