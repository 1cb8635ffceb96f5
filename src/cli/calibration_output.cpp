#include "cli/calibration_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>

namespace terrode::cli {

using calibration::Estimate;
using calibration::Fit;
using calibration::SoilTestFits;
using calibration::TestCurve;
using calibration::Warning;
using calibration::WheelFit;

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

namespace {

Json curves_json(const std::vector<TestCurve>& curves, const char* condition, const char* level, const char* shape) {
  Json out = Json::array();
  for (const TestCurve& c : curves)
    out.push_back({{"file", c.file}, {condition, number(c.condition)}, {"residual_rms", number(c.residual_rms)}, {"own_rms", number(c.own_rms)},
                   {"correlation", number(c.correlation)}, {"points", c.displacement.size()}, {"effective_points", number(c.effective_points)},
                   {std::string("own_") + level, number(c.own_level)}, {std::string("own_") + shape, number(c.own_shape)}, {"loops_cut", c.loops_cut}});
  return out;
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

}  // namespace

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

Json comparison_json(const std::vector<Comparison>& list) {
  Json out = Json::array();
  for (const Comparison& c : list) out.push_back({{"parameter", c.name}, {"soil_tests", number(c.tests)}, {"wheel", number(c.wheel)}, {"unit", c.unit}, {"standard_errors_apart", number(c.distance)}});
  return out;
}

report::Table comparison_table(const std::vector<Comparison>& list) {
  report::Table t;
  t.columns = {{"parameter"}, {"soil tests"}, {"wheel"}, {"unit"}, {"standard errors apart", "", 2}};
  for (const Comparison& c : list) t.rows.push_back({c.name, c.tests, c.wheel, c.unit, c.distance});
  return t;
}

void print_comparison(const std::vector<Comparison>& list) {
  if (list.empty()) return;
  std::vector<std::vector<std::string>> rows = {{"parameter", "soil tests", "wheel", "unit", "standard errors apart"}};
  for (const Comparison& c : list) rows.push_back({c.name, fmt::format("{:.4g}", c.tests), fmt::format("{:.4g}", c.wheel), c.unit, fmt::format("{:.1f}", c.distance)});
  std::printf("%s\n", aligned(rows).c_str());
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
    report::Figure f, rest;
    rest.title = std::string(labels[c]) + ": measured less fitted";
    rest.x = {"Slip", ""};
    rest.y = {"Residual", units[c]};
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
      report::Series residual = measured;
      for (std::size_t i = 0, k = 0; i < order.size(); ++i) {
        const auto& point = data.points[order[i].second];
        if (!point.mean[c]) continue;
        const double less = kScale[c] * fit.predicted[order[i].second][c];
        residual.y[k] -= less, residual.low[k] -= less, residual.high[k] -= less;
        ++k;
      }
      rest.series.push_back(residual);
      f.series.push_back(measured);
      f.series.push_back(fitted);
      colour = (colour + 1) % 8;
    }
    rest.annotations = {{std::numeric_limits<double>::quiet_NaN(), 0.0, ""}};
    rest.caption = fmt::format("Bars: standard error of the means. The model misses {:.3g} {} beside it (deviation).", kScale[c] * fit.channels[c].discrepancy, units[c]);
    f.caption = fmt::format("Root mean square residual {:.3g} {}.", kScale[c] * fit.channels[c].rmse, units[c]);
    figures.push_back(f);
    figures.push_back(rest);
  }
  page.figures(figures);
  warnings_on(page, fit.warnings);
}

}  // namespace terrode::cli
