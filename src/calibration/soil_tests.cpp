#include "calibration/soil_tests.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>

#include "bekker/steady_wheel.h"
#include "calibration/least_squares.h"
#include "core/linear_algebra.h"

namespace terrode::calibration {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using recording::DirectShearTest;
using recording::PressureSinkageTest;

// A test averaged over even steps of displacement.
struct Curve {
  std::string file;
  std::size_t test = 0;
  double condition = 0.0;
  VectorXd x, y;
  double root_weight = 1.0;   // of each residual
  bool loops_cut = false;
};

Curve averaged(const std::string& file, std::size_t test, std::span<const double> x, std::span<const double> y,
               const SoilTestOptions& o, bool absolute_x) {
  const auto bad = [&](const std::string& what, const std::string& expected) {
    throw InputError(Problem{file, 0, 0, {}, what, expected});
  };
  if (x.size() != y.size()) bad(fmt::format("has {} displacements and {} stresses", x.size(), y.size()), "as many of each");
  std::vector<double> px, py;
  double top = 0.0, largest = 0.0, drop = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;  // gaps
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) bad("holds a value that is not finite", "finite values");
    const double at = absolute_x ? std::abs(x[i]) : x[i];
    top = std::max(top, at);
    drop = std::max(drop, top - at);
    px.push_back(at);
    py.push_back(absolute_x ? std::abs(y[i]) : y[i]);
    largest = std::max(largest, at);
  }
  Curve out;
  out.file = file;
  out.test = test;
  // Loops and the way back: only what goes deeper than ever before is the virgin curve.
  constexpr double kBack = 0.01;
  if (drop > kBack * largest) {
    out.loops_cut = true;
    std::vector<double> kx, ky;
    double deepest = -1.0;
    for (std::size_t i = 0; i < px.size(); ++i)
      if (px[i] > deepest) {
        deepest = px[i];
        kx.push_back(px[i]);
        ky.push_back(py[i]);
      }
    px.swap(kx);
    py.swap(ky);
  }
  const double lo = absolute_x ? 0.0 : o.minimum_sinkage;
  const double hi = std::min(largest, absolute_x ? o.maximum_shear_displacement : o.maximum_sinkage);
  const auto bins = static_cast<std::size_t>(o.points);
  std::vector<double> sum_x(bins), sum_y(bins), count(bins);
  for (std::size_t i = 0; i < px.size(); ++i) {
    if (!(px[i] > 0) || px[i] < lo || px[i] > hi) continue;
    const auto b = std::min(bins - 1, static_cast<std::size_t>((px[i] - lo) / (hi - lo) * static_cast<double>(bins)));
    sum_x[b] += px[i];
    sum_y[b] += py[i];
    count[b] += 1;
  }
  std::vector<double> mx, my;
  for (std::size_t b = 0; b < bins; ++b)
    if (count[b] > 0) {
      mx.push_back(sum_x[b] / count[b]);
      my.push_back(sum_y[b] / count[b]);
    }
  if (mx.size() < 4) bad(fmt::format("has {} usable points", mx.size()), "at least 4 at different displacements above 0");
  out.x = Eigen::Map<VectorXd>(mx.data(), static_cast<Eigen::Index>(mx.size()));
  out.y = Eigen::Map<VectorXd>(my.data(), static_cast<Eigen::Index>(my.size()));
  if (!(out.y.maxCoeff() > 0)) bad("has no positive stress", "stresses above 0");
  return out;
}

double rms(const VectorXd& v) { return std::sqrt(v.squaredNorm() / static_cast<double>(v.size())); }

// A family of curves with common parameters theta, in which one test by itself is described by two coordinates
// (logarithms of its level and of its shape).
struct Family {
  std::vector<Curve> curves;
  std::function<double(const VectorXd& theta, const Curve&, double x)> model;
  std::function<double(const Vector2d& own, const Curve&, double x)> own_model;
  std::function<Vector2d(const VectorXd& theta, const Curve&)> own_of;  // NaN where theta has none
  std::vector<Vector2d> own_start;
  int level_parameters = 1;   // common parameters that set the levels
};

struct OwnFit {
  Vector2d own;
  Eigen::Matrix2d covariance;
  double rms = 0.0, correlation = 0.0, effective = 0.0;
};

// s^2 R of a curve's residuals.
MatrixXd noise_matrix(const OwnFit& own, Eigen::Index n) {
  MatrixXd r(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      r(i, j) = own.rms * own.rms * std::pow(own.correlation, static_cast<double>(std::abs(i - j)));
  return r;
}

OwnFit fit_own(const Family& family, std::size_t c) {
  const Curve& curve = family.curves[c];
  const Eigen::Index n = curve.x.size();
  const double scale = std::max(rms(curve.y), 1e-300);
  const ResidualFunction f = [&](const VectorXd& x, VectorXd& r) {
    if (x.cwiseAbs().maxCoeff() > 60) return false;
    const Vector2d own = x;
    for (Eigen::Index i = 0; i < n; ++i) r[i] = (family.own_model(own, curve, curve.x[i]) - curve.y[i]) / scale;
    return true;
  };
  const LeastSquaresResult fit = least_squares(f, n, family.own_start[c]);
  OwnFit out;
  out.own = fit.x;
  const double free = std::max(1.0, static_cast<double>(n - 2));
  out.rms = scale * std::sqrt(fit.sum_of_squares / free);
  double lag = 0.0;
  for (Eigen::Index i = 1; i < n; ++i) lag += fit.residuals[i] * fit.residuals[i - 1];
  const double raw = fit.sum_of_squares > 0 ? lag / fit.sum_of_squares : 0.0;
  // Kendall's (1954) bias of the lag-one correlation, here after two fitted parameters.
  const double count = static_cast<double>(n);
  out.correlation = std::clamp(raw + (1.0 + 4.0 * raw) / count, 0.0, 1.0 - 2.0 / count);
  out.effective = std::max(1.0, count * (1 - out.correlation) / (1 + out.correlation));
  // With few independent residuals the two parameters have taken more of the scatter than 2/n.
  out.rms *= std::sqrt(1.0 + 2.0 / out.effective);
  const MatrixXd jacobian = scale * fit.jacobian;
  const MatrixXd bread = inverse_of_symmetric(jacobian.transpose() * jacobian);
  out.covariance = bread * (jacobian.transpose() * noise_matrix(out, n) * jacobian) * bread;
  return out;
}

struct FamilyFit {
  VectorXd theta;
  MatrixXd covariance;   // of theta
  MatrixXd naive;        // B^-1
  LeastSquaresResult minimum;
  std::vector<OwnFit> own;
  Eigen::Matrix2d between = Eigen::Matrix2d::Zero();
  double degrees_of_freedom = 1.0;
  bool converged = true;
};

ResidualFunction family_residuals(const Family& family) {
  return [&family](const VectorXd& theta, VectorXd& r) {
    Eigen::Index at = 0;
    for (const Curve& c : family.curves)
      for (Eigen::Index i = 0; i < c.x.size(); ++i) {
        r[at++] = c.root_weight * (family.model(theta, c, c.x[i]) - c.y[i]);
        if (!std::isfinite(r[at - 1])) return false;
      }
    return true;
  };
}

Eigen::Index family_size(const Family& family) {
  Eigen::Index n = 0;
  for (const Curve& c : family.curves) n += c.x.size();
  return n;
}

Eigen::Matrix2d positive_part(const Eigen::Matrix2d& m) {
  const SymmetricEigen eigen = symmetric_eigen(0.5 * (m + m.transpose()));
  const Vector2d values = eigen.values.cwiseMax(0.0);
  return eigen.vectors * values.asDiagonal() * eigen.vectors.transpose();
}

// Minimises over all tests and finds the covariance described at the top of the header.
FamilyFit fit_family(Family& family, const VectorXd& start, const SoilTestOptions& o) {
  FamilyFit out;
  double total = 0.0;
  for (Curve& c : family.curves) {
    c.root_weight = 1.0 / std::sqrt(static_cast<double>(c.x.size()));
    if (o.weighting == Weighting::relative) c.root_weight /= rms(c.y);
    total += c.root_weight * c.root_weight * c.y.squaredNorm();
  }
  for (Curve& c : family.curves) c.root_weight /= std::sqrt(total);
  const ResidualFunction f = family_residuals(family);
  const LeastSquaresResult fit = least_squares(f, family_size(family), start);
  out.theta = fit.x;
  out.minimum = fit;
  out.converged = fit.converged;
  out.naive = inverse_of_symmetric(fit.jacobian.transpose() * fit.jacobian);

  const double tests = static_cast<double>(family.curves.size());
  Eigen::Matrix2d seen = Eigen::Matrix2d::Zero();
  for (std::size_t c = 0; c < family.curves.size(); ++c) {
    out.own.push_back(fit_own(family, c));
    const Vector2d expected = family.own_of(out.theta, family.curves[c]);
    if (!expected.allFinite()) continue;
    const Vector2d d = out.own[c].own - expected;
    seen += d * d.transpose() - out.own[c].covariance;
  }
  seen = positive_part(seen);
  // Fitted common parameters have taken their share of the scatter: level_parameters of the level, one of the shape.
  const double level_free = std::max(0.0, tests - family.level_parameters), shape_free = std::max(0.0, tests - 1.0);
  const double w = o.repeatability_weight;
  const Vector2d scale(std::sqrt(1.0 / std::max(1e-9, level_free + w)), std::sqrt(1.0 / std::max(1e-9, shape_free + w)));
  Eigen::Matrix2d assumed = Eigen::Matrix2d::Zero();
  assumed(0, 0) = w * o.level_repeatability * o.level_repeatability;
  assumed(1, 1) = w * o.shape_repeatability * o.shape_repeatability;
  if (level_free == 0) seen.row(0).setZero(), seen.col(0).setZero();
  if (shape_free == 0) seen.row(1).setZero(), seen.col(1).setZero();
  out.between = scale.asDiagonal() * (seen + assumed) * scale.asDiagonal();
  out.degrees_of_freedom = std::max(1.0, level_free + w);

  MatrixXd meat = MatrixXd::Zero(out.theta.size(), out.theta.size());
  Eigen::Index at = 0;
  for (std::size_t c = 0; c < family.curves.size(); ++c) {
    const Curve& curve = family.curves[c];
    const Eigen::Index n = curve.x.size();
    const MatrixXd j = fit.jacobian.middleRows(at, n);
    at += n;
    Vector2d own = family.own_of(out.theta, curve);
    if (!own.allFinite()) own = out.own[c].own;
    Eigen::MatrixX2d effect(n, 2);
    constexpr double kStep = 1e-5;
    for (int k = 0; k < 2; ++k) {
      Vector2d up = own, down = own;
      up[k] += kStep;
      down[k] -= kStep;
      for (Eigen::Index i = 0; i < n; ++i)
        effect(i, k) = (family.own_model(up, curve, curve.x[i]) - family.own_model(down, curve, curve.x[i])) / (2 * kStep);
    }
    const double weight = curve.root_weight * curve.root_weight;
    const MatrixXd g = j.transpose() * effect;
    meat += weight * (j.transpose() * noise_matrix(out.own[c], n) * j + g * out.between * g.transpose());
  }
  out.covariance = out.naive * meat * out.naive;
  return out;
}

void fill_curves(const Family& family, const FamilyFit& fit, std::vector<TestCurve>& out) {
  for (std::size_t c = 0; c < family.curves.size(); ++c) {
    const Curve& curve = family.curves[c];
    TestCurve t;
    t.file = curve.file;
    t.condition = curve.condition;
    t.loops_cut = curve.loops_cut;
    double sum = 0.0;
    for (Eigen::Index i = 0; i < curve.x.size(); ++i) {
      t.displacement.push_back(curve.x[i]);
      t.measured.push_back(curve.y[i]);
      t.fitted.push_back(family.model(fit.theta, curve, curve.x[i]));
      sum += std::pow(t.fitted.back() - t.measured.back(), 2);
    }
    t.residual_rms = std::sqrt(sum / static_cast<double>(curve.x.size()));
    t.own_rms = fit.own[c].rms;
    t.correlation = fit.own[c].correlation;
    t.effective_points = fit.own[c].effective;
    t.own_level = std::exp(fit.own[c].own[0]);
    t.own_shape = std::exp(fit.own[c].own[1]);
    t.own_level_std = t.own_level * std::sqrt(fit.own[c].covariance(0, 0));
    t.own_shape_std = t.own_shape * std::sqrt(fit.own[c].covariance(1, 1));
    out.push_back(std::move(t));
  }
}

void finish(Fit& fit, const Family& family, const FamilyFit& f, const std::vector<Eigen::Index>& free, double confidence) {
  fit.confidence = confidence;
  fit.degrees_of_freedom = f.degrees_of_freedom;
  const double t = t_quantile(confidence, f.degrees_of_freedom);
  const auto p = static_cast<Eigen::Index>(fit.estimates.size());
  MatrixXd covariance = MatrixXd::Zero(p, p);
  for (Eigen::Index a = 0; a < static_cast<Eigen::Index>(free.size()); ++a)
    for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(free.size()); ++b)
      covariance(free[static_cast<std::size_t>(a)], free[static_cast<std::size_t>(b)]) = f.covariance(a, b);
  for (std::size_t a = 0; a < free.size(); ++a) {
    Estimate& e = fit.estimates[static_cast<std::size_t>(free[a])];
    const auto index = static_cast<Eigen::Index>(a);
    const auto [low, high] = profile_interval(family_residuals(family), f.minimum, index, std::sqrt(f.covariance(index, index)), t,
                                              f.naive(index, index) / f.covariance(index, index));
    const bool log = e.coordinate == Coordinate::log;
    e.value = log ? std::exp(f.theta[static_cast<Eigen::Index>(a)]) : f.theta[static_cast<Eigen::Index>(a)];
    e.low = log ? std::exp(low) : low;
    e.high = log ? std::exp(high) : high;
  }
  set_covariance(fit, covariance);
  if (!f.converged)
    fit.warnings.push_back({"not_converged", "", "the search for the smallest sum of squares did not come to rest", ""});
}

void warn_unusual(Fit& fit, const std::string& name, double low, double high, const std::string& range, const std::string& remedy) {
  const Estimate* e = fit.find(name);
  if (!e || !e->identified) return;
  if (e->value < low || e->value > high)
    fit.warnings.push_back({"unusual_value", name, fmt::format("{} = {:.4g} {} lies outside what soils usually have ({})", name, e->value,
                                                               e->unit == "-" ? "" : e->unit, range),
                            remedy});
}

// Distinct values of a condition, those within 2 percent of each other counting as one.
std::vector<double> distinct(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::vector<double> out;
  for (const double v : values)
    if (out.empty() || v > 1.02 * out.back()) out.push_back(v);
  return out;
}

double bekker_size(const PressureSinkageTest& t) { return t.circular ? 0.5 * t.plate_width : t.plate_width; }

}  // namespace
Problems SoilTestOptions::validate() const {
  Problems out;
  require(out, "confidence", confidence, "-", confidence > 0 && confidence < 1, "between 0 and 1");
  if (points < 10 || points > 2000) out.push_back({{}, 0, 0, "points", fmt::format("is {}", points), "from 10 to 2000"});
  require(out, "level_repeatability", level_repeatability, "-", level_repeatability >= 0 && level_repeatability < 2, "from 0 to 2");
  require(out, "shape_repeatability", shape_repeatability, "-", shape_repeatability >= 0 && shape_repeatability < 2, "from 0 to 2");
  require(out, "repeatability_weight", repeatability_weight, "-", repeatability_weight > 0 && repeatability_weight <= 100,
          "above 0, at most 100");
  require(out, "minimum_sinkage", minimum_sinkage, "m", minimum_sinkage >= 0, "at least 0 m");
  require(out, "maximum_sinkage", maximum_sinkage, "m", maximum_sinkage > minimum_sinkage,
          "above minimum_sinkage");
  require(out, "maximum_shear_displacement", maximum_shear_displacement, "m", maximum_shear_displacement > 0, "above 0 m");
  if (plate_width) require(out, "plate_width", *plate_width, "m", *plate_width > 0, "above 0 m");
  return out;
}

WongShear wong_shear(std::span<const double> displacement, std::span<const double> stress) {
  if (displacement.size() != stress.size()) throw InputError("as many displacements as stresses are needed");
  WongShear out;
  std::size_t peak = 0;
  for (std::size_t i = 0; i < stress.size(); ++i)
    if (stress[i] > out.tau_max) {
      out.tau_max = stress[i];
      peak = i;
    }
  if (!(out.tau_max > 0)) throw InputError("Wong's shear modulus: the curve has no positive stress");
  double top = 0.0, bottom = 0.0;
  for (std::size_t i = 0; i < peak; ++i) {
    const double left = 1.0 - stress[i] / out.tau_max, j = displacement[i];
    if (!(left > 0) || !(j > 0)) continue;
    top += left * left * j * j;
    bottom += left * left * j * std::log(left);
  }
  if (!(bottom < 0)) throw InputError("Wong's shear modulus: the curve has no points on its way to the largest stress");
  out.shear_modulus = -top / bottom;
  return out;
}

PowerLaw wong_power_law(std::span<const double> sinkage, std::span<const double> pressure) {
  if (sinkage.size() != pressure.size()) throw InputError("as many sinkages as pressures are needed");
  double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0;
  int used = 0;
  for (std::size_t i = 0; i < sinkage.size(); ++i) {
    if (!(sinkage[i] > 0) || !(pressure[i] > 0)) continue;
    const double weight = pressure[i] * pressure[i], x = std::log(sinkage[i]), y = std::log(pressure[i]);
    w += weight;
    wx += weight * x;
    wy += weight * y;
    wxx += weight * x * x;
    wxy += weight * x * y;
    ++used;
  }
  const double determinant = w * wxx - wx * wx;
  if (used < 2 || !(determinant > 1e-14 * w * wxx))
    throw InputError("Wong's weighted least squares: fewer than two different points with positive sinkage and pressure");
  PowerLaw out;
  out.n = (w * wxy - wx * wy) / determinant;
  out.modulus = std::exp((wy - out.n * wx) / w);
  return out;
}

ShearFit fit_direct_shear(std::span<const DirectShearTest> tests, const SoilTestOptions& o) {
  throw_if_any(o.validate());
  if (tests.empty()) throw InputError("there is no direct shear test to fit");
  ShearFit out;
  Family family;
  std::vector<double> stresses, levels;
  std::vector<double> log_k;
  bool softening = false, short_travel = false, coarse = false;
  for (std::size_t i = 0; i < tests.size(); ++i) {
    const DirectShearTest& t = tests[i];
    if (!(t.normal_stress >= 0) || !std::isfinite(t.normal_stress))
      throw InputError(Problem{t.file, 0, 0, "normal_stress", fmt::format("is {} Pa", t.normal_stress), "at least 0 Pa"});
    Curve c = averaged(t.file, i, t.shear_displacement, t.shear_stress, o, true);
    c.condition = t.normal_stress;
    const double top = c.y.maxCoeff();
    Eigen::Index at = 0;
    while (c.y[at] < 0.632 * top) ++at;
    family.own_start.emplace_back(std::log(top), std::log(std::max(c.x[at], 1e-9)));
    stresses.push_back(t.normal_stress);
    levels.push_back(top);
    log_k.push_back(family.own_start.back()[1]);
    out.wong.push_back(wong_shear({c.x.data(), static_cast<std::size_t>(c.x.size())}, {c.y.data(), static_cast<std::size_t>(c.y.size())}));
    const Eigen::Index tail = std::max<Eigen::Index>(1, c.x.size() / 10);
    if (top > 1.2 * c.y.tail(tail).mean()) softening = true;
    family.curves.push_back(std::move(c));
  }
  family.own_model = [](const Vector2d& own, const Curve&, double x) { return std::exp(own[0]) * -std::expm1(-x / std::exp(own[1])); };
  const std::size_t loads = distinct(stresses).size();
  const bool several = loads > 1;

  // A line through the levels starts the search; least squares over all tests with positive c and phi.
  const auto line = [&](const std::vector<double>& level) {
    double n = 0, s = 0, l = 0, ss = 0, sl = 0;
    for (std::size_t i = 0; i < level.size(); ++i) {
      n += 1;
      s += stresses[i];
      l += level[i];
      ss += stresses[i] * stresses[i];
      sl += stresses[i] * level[i];
    }
    const double d = n * ss - s * s;
    const double slope = several ? (n * sl - s * l) / d : (s > 0 ? l / s : 0.0);
    return std::pair{several ? (l - slope * s) / n : 0.0, slope};
  };
  const auto [c0, slope0] = line(levels);
  double mean_log_k = 0;
  for (const double v : log_k) mean_log_k += v / static_cast<double>(log_k.size());
  const double phi0 = std::clamp(std::atan(slope0), 0.02, 1.4);
  const double c_scale = std::max(1e-300, *std::max_element(levels.begin(), levels.end()));

  // theta: c/c_scale, phi, ln K, or without the first.
  const auto set_model = [&](bool with_cohesion) {
    const Eigen::Index first = with_cohesion ? 1 : 0;
    const auto level = [=](const VectorXd& theta, const Curve& c) {
      const double phi = theta[first];
      if (!(std::abs(phi) < 1.55)) return std::numeric_limits<double>::quiet_NaN();
      return (with_cohesion ? theta[0] * c_scale : 0.0) + c.condition * std::tan(phi);
    };
    family.model = [=](const VectorXd& theta, const Curve& c, double x) {
      if (!(std::abs(theta[first + 1]) < 60)) return std::numeric_limits<double>::quiet_NaN();
      return level(theta, c) * -std::expm1(-x / std::exp(theta[first + 1]));
    };
    family.own_of = [=](const VectorXd& theta, const Curve& c) { return Vector2d(std::log(level(theta, c)), theta[first + 1]); };
    family.level_parameters = with_cohesion ? 2 : 1;
  };
  out.estimates = {{"cohesion", "Pa"}, {"friction_angle", "rad"}, {"shear_modulus", "m"}};
  out.estimates[2].coordinate = Coordinate::log;
  FamilyFit fit;
  bool negative = false;
  double free_std = 0.0, free_value = 0.0;
  if (several) {
    set_model(true);
    fit = fit_family(family, Eigen::Vector3d(c0 / c_scale, phi0, mean_log_k), o);
    free_value = fit.theta[0] * c_scale;
    free_std = std::sqrt(fit.covariance(0, 0)) * c_scale;
    negative = fit.theta[0] < 0;
  }
  std::vector<Eigen::Index> free = {0, 1, 2};
  if (!several || negative) {
    set_model(false);
    fit = fit_family(family, Eigen::Vector2d(phi0, mean_log_k), o);
    free = {1, 2};
  }
  finish(out, family, fit, free, o.confidence);
  if (free.size() == 3) {
    // Undo the scale of c.
    out.estimates[0].value *= c_scale;
    out.estimates[0].low *= c_scale;
    out.estimates[0].high *= c_scale;
    Eigen::Vector3d unit(c_scale, 1.0, 1.0);
    set_covariance(out, unit.asDiagonal() * out.coordinate_covariance * unit.asDiagonal());
  }
  fill_curves(family, fit, out.curves);
  out.between_level = std::sqrt(fit.between(0, 0));
  out.between_shape = std::sqrt(fit.between(1, 1));
  Estimate& cohesion = out.estimates[0];
  const double t = t_quantile(o.confidence, out.degrees_of_freedom);
  if (!several) {
    cohesion.identified = false;
    cohesion.low = 0.0;
    cohesion.high = levels.front();
    cohesion.std = 0.0;
    out.warnings.push_back({"not_identified", "cohesion",
                            fmt::format("all direct shear tests have the same normal stress ({:.4g} Pa), which gives one value of c + sigma "
                                        "tan(phi); c is taken as 0, phi is then an upper limit",
                                        stresses.front()),
                            "add direct shear tests at two further normal stresses, one of them a quarter or less of this one"});
  } else if (negative) {
    cohesion.at_bound = true;
    cohesion.value = 0.0;
    cohesion.low = 0.0;
    cohesion.high = std::max(0.0, free_value + t * free_std);
    cohesion.std = free_std;
    out.covariance(0, 0) = out.coordinate_covariance(0, 0) = free_std * free_std;
    out.warnings.push_back({"negative", "cohesion",
                            fmt::format("the line through the tests meets the stress axis at {:.4g} Pa (standard error {:.3g} Pa); cohesion is held at 0",
                                        free_value, free_std),
                            "tests at lower normal stress show whether the failure envelope is curved there"});
  } else {
    if (cohesion.low < 0) cohesion.low = 0.0;
    if (cohesion.std > 0.5 * cohesion.value)
      out.warnings.push_back({"weakly_identified", "cohesion",
                              fmt::format("the cohesion, {:.4g} Pa, has a standard error of {:.3g} Pa", cohesion.value, cohesion.std),
                              fmt::format("repeat the tests at the lowest normal stress ({:.4g} Pa) and add one below it",
                                          *std::min_element(stresses.begin(), stresses.end()))});
  }
  // Wong's way.
  std::vector<double> tau_max;
  double sum = 0, square = 0;
  for (const WongShear& w : out.wong) {
    tau_max.push_back(w.tau_max);
    sum += w.shear_modulus;
    square += w.shear_modulus * w.shear_modulus;
  }
  const double count = static_cast<double>(out.wong.size());
  out.wong_shear_modulus = sum / count;
  if (count > 1) out.wong_shear_modulus_std = std::sqrt(std::max(0.0, (square - sum * sum / count) / (count - 1)));
  if (several) {
    const auto [c, slope] = line(tau_max);
    out.wong_cohesion = c;
    out.wong_friction_angle = std::atan(slope);
  }
  const double k_value = out.estimates[2].value;
  for (const Curve& c : family.curves) {
    if (c.x.tail(1)[0] < 3 * k_value) short_travel = true;
    if (k_value < 2 * c.x[0]) coarse = true;
  }
  if (short_travel)
    out.warnings.push_back({"no_plateau", "shear_modulus",
                            fmt::format("a test ends before 3 K = {:.3g} m of shear displacement: K and the residual stress are known only together", 3 * k_value),
                            "shear further, to at least five times K"});
  if (coarse)
    out.warnings.push_back({"weakly_identified", "shear_modulus",
                            fmt::format("K = {:.3g} m is less than twice the first measured displacement", k_value),
                            "record the first millimetre of shear with at least ten samples per K"});
  if (softening)
    out.warnings.push_back({"softening", "shear_modulus", "the shear stress falls by more than a sixth after its peak, which Eq. 24 cannot follow",
                            "use a law with a peak (effect peak_shear), or limit the displacement that is fitted"});
  if (out.wong_shear_modulus > 1.5 * k_value || out.wong_shear_modulus < k_value / 1.5)
    out.warnings.push_back({"model_misfit", "shear_modulus",
                            fmt::format("Wong's way of measuring gives K = {:.3g} m, least squares {:.3g} m: the curves do not rise as an exponential",
                                        out.wong_shear_modulus, k_value),
                            "decide by wheel runs at low slip, which are sensitive to K"});
  double worst = 0;
  for (const TestCurve& c : out.curves) worst = std::max(worst, c.residual_rms / c.own_level);
  if (worst > 0.1)
    out.warnings.push_back({"model_misfit", "", fmt::format("a test lies {:.0f} percent of its residual stress (root mean square) off the common curve", 100 * worst),
                            "look at the residuals: tests that differ in preparation should not be fitted together"});
  if (tests.size() < 3 || fit.degrees_of_freedom <= o.repeatability_weight)
    out.warnings.push_back({"few_tests", "", "there are too few tests to show how well they repeat; the intervals rest on the repeatability assumed",
                            "repeat one of the tests at least twice"});
  warn_unusual(out, "cohesion", 0.0, 1e5, "0 to 100 kPa", "check the unit of the stresses");
  warn_unusual(out, "friction_angle", 0.17, 0.87, "10 to 50 degrees", several ? "check the units of normal and shear stress" : "see cohesion");
  warn_unusual(out, "shear_modulus", 1e-3, 0.06, "1 to 60 mm",
               "small shear boxes give a K far below that of a wheel; a wheel or a shear ring over several centimetres shows the soil's");
  return out;
}

namespace {

struct PlateTests {
  Family family;
  std::vector<PowerLaw> wong;
  double reference = 1.0;  // depth at which levels are compared, m
};

PlateTests plate_tests(std::span<const PressureSinkageTest> tests, const SoilTestOptions& o) {
  throw_if_any(o.validate());
  if (tests.empty()) throw InputError("there is no pressure-sinkage test to fit");
  PlateTests out;
  double log_depth = 0;
  for (std::size_t i = 0; i < tests.size(); ++i) {
    const PressureSinkageTest& t = tests[i];
    if (!(t.plate_width > 0) || !std::isfinite(t.plate_width))
      throw InputError(Problem{t.file, 0, 0, "plate_width", fmt::format("is {} m", t.plate_width), "above 0 m"});
    Curve c = averaged(t.file, i, t.sinkage, t.pressure, o, false);
    c.condition = t.plate_width;
    out.wong.push_back(wong_power_law({c.x.data(), static_cast<std::size_t>(c.x.size())}, {c.y.data(), static_cast<std::size_t>(c.y.size())}));
    log_depth += std::log(0.6 * c.x.tail(1)[0]) / static_cast<double>(tests.size());
    out.family.curves.push_back(std::move(c));
  }
  out.reference = std::exp(log_depth);
  const double reference = out.reference;
  out.family.own_model = [reference](const Vector2d& own, const Curve&, double x) {
    return std::exp(own[0] + std::exp(own[1]) * std::log(x / reference));
  };
  for (const PowerLaw& w : out.wong) {
    const double n = std::clamp(w.n, 0.05, 4.0);
    out.family.own_start.emplace_back(std::log(w.modulus) + w.n * std::log(reference), std::log(n));
  }
  return out;
}

// Own levels are at the reference depth: turn them into k of each plate's own width (or z^n with width 1).
void own_levels_to_k(std::vector<TestCurve>& curves, const FamilyFit& fit, double reference, bool by_width) {
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const double n = curves[c].own_shape, x = (by_width ? curves[c].condition : 1.0) / reference;
    const OwnFit& own = fit.own[c];
    const Vector2d slope(1.0, n * std::log(x));
    curves[c].own_level *= std::pow(x, n);
    curves[c].own_level_std = curves[c].own_level * std::sqrt(std::max(0.0, slope.dot(own.covariance * slope)));
  }
}

void warn_sinkage(Fit& fit, const std::vector<TestCurve>& curves, const FamilyFit& f, const SoilTestOptions& o) {
  double worst = 0;
  double narrow = std::numeric_limits<double>::infinity();
  for (const TestCurve& c : curves) {
    worst = std::max(worst, c.own_rms / *std::max_element(c.measured.begin(), c.measured.end()));
    narrow = std::min(narrow, c.displacement.back() / c.displacement.front());
  }
  if (worst > 0.05)
    fit.warnings.push_back({"model_misfit", "n", fmt::format("a power law leaves {:.0f} percent of the largest pressure (root mean square) of a test", 100 * worst),
                            "fit the range of depth that the wheel uses (--min-depth, --max-depth); a crust, a hard layer or a plate that "
                            "punches through shows in the residuals"});
  if (narrow < 4)
    fit.warnings.push_back({"weakly_identified", "n", fmt::format("a test spans a factor of {:.2g} of depth only: k and n are known only together", narrow),
                            "record from first contact on"});
  if (f.degrees_of_freedom <= o.repeatability_weight)
    fit.warnings.push_back({"few_tests", "", "there are too few tests to show how well they repeat; the intervals rest on the repeatability assumed",
                            "repeat the test at least twice"});
  warn_unusual(fit, "n", 0.1, 2.0, "0.1 to 2", "a too large n comes from a sinkage whose zero lies above the soil, a too small one from a zero below it");
}

}  // namespace

SinkageFit fit_pressure_sinkage(std::span<const PressureSinkageTest> tests, const SoilTestOptions& o) {
  PlateTests plates = plate_tests(tests, o);
  Family& family = plates.family;
  SinkageFit out;
  std::vector<double> widths;
  for (const PressureSinkageTest& t : tests) widths.push_back(t.plate_width);
  out.plate_width = o.plate_width ? *o.plate_width : *std::max_element(widths.begin(), widths.end());
  const double reference = plates.reference;
  // theta: ln of the pressure at the mean z/b and ln n, which are nearly uncorrelated; k follows.
  double log_ratio = 0;
  for (const Curve& c : family.curves) log_ratio += std::log(reference / c.condition) / static_cast<double>(tests.size());
  family.model = [=](const VectorXd& theta, const Curve& c, double x) {
    if (!(std::abs(theta[0]) < 80 && std::abs(theta[1]) < 4)) return std::numeric_limits<double>::quiet_NaN();
    return std::exp(theta[0] + std::exp(theta[1]) * (std::log(x / c.condition) - log_ratio));
  };
  family.own_of = [=](const VectorXd& theta, const Curve& c) {
    return Vector2d(theta[0] + std::exp(theta[1]) * (std::log(reference / c.condition) - log_ratio), theta[1]);
  };
  Vector2d start = Vector2d::Zero();
  for (const Vector2d& own : family.own_start) start += own / static_cast<double>(tests.size());
  const FamilyFit centred = fit_family(family, start, o);
  // The same with theta = (ln k, ln n), whose profiles are wanted.
  family.model = [](const VectorXd& theta, const Curve& c, double x) {
    if (!(std::abs(theta[0]) < 80 && std::abs(theta[1]) < 4)) return std::numeric_limits<double>::quiet_NaN();
    return std::exp(theta[0] + std::exp(theta[1]) * std::log(x / c.condition));
  };
  family.own_of = [=](const VectorXd& theta, const Curve& c) {
    return Vector2d(theta[0] + std::exp(theta[1]) * std::log(reference / c.condition), theta[1]);
  };
  const double n = std::exp(centred.theta[1]);
  const FamilyFit fit = fit_family(family, Vector2d(centred.theta[0] - n * log_ratio, centred.theta[1]), o);
  out.estimates = {{"k", "Pa"}, {"n", "-"}};
  for (Estimate& e : out.estimates) e.coordinate = Coordinate::log;
  finish(out, family, fit, {0, 1}, o.confidence);
  fill_curves(family, fit, out.curves);
  own_levels_to_k(out.curves, fit, reference, true);
  out.between_level = std::sqrt(fit.between(0, 0));
  out.between_shape = std::sqrt(fit.between(1, 1));
  for (std::size_t i = 0; i < tests.size(); ++i) {
    out.wong_n += plates.wong[i].n / static_cast<double>(tests.size());
    out.wong_k += std::log(plates.wong[i].modulus * std::pow(tests[i].plate_width, plates.wong[i].n)) / static_cast<double>(tests.size());
  }
  out.wong_k = std::exp(out.wong_k);
  warn_sinkage(out, out.curves, fit, o);
  const std::vector<double> sizes = distinct(widths);
  if (sizes.size() > 1) {
    // Trend of ln(level) about the common curve against ln(width).
    double sx = 0, sy = 0, sxx = 0, sxy = 0, count = 0;
    for (std::size_t i = 0; i < tests.size(); ++i) {
      const double x = std::log(tests[i].plate_width), y = fit.own[i].own[0] - family.own_of(fit.theta, family.curves[i])[0];
      count += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    const double slope = (count * sxy - sx * sy) / (count * sxx - sx * sx);
    const double change = std::exp(slope * std::log(sizes.back() / sizes.front()));
    if (std::abs(std::log(change)) > 0.1)
      out.warnings.push_back({"plate_size", "k",
                              fmt::format("sigma = k (z/b)^n does not hold between plates: from b = {:.3g} m to {:.3g} m k changes by a factor {:.3g}",
                                          sizes.front(), sizes.back(), change),
                              "use the tests of the plate nearest to the wheel's contact patch, or kc and kphi"});
  }
  return out;
}

ModuliFit fit_bekker_moduli(std::span<const PressureSinkageTest> tests, const SoilTestOptions& o) {
  PlateTests plates = plate_tests(tests, o);
  Family& family = plates.family;
  std::vector<double> sizes_all;
  for (std::size_t i = 0; i < tests.size(); ++i) {
    sizes_all.push_back(bekker_size(tests[i]));
    family.curves[i].condition = sizes_all.back();
  }
  const std::vector<double> sizes = distinct(sizes_all);
  if (sizes.size() < 2) throw InputError("kc and kphi need plates of at least two sizes");
  ModuliFit out;
  const double reference = plates.reference;
  // theta: kc/b0 and kphi times reference^n in units of the mean level, ln n.
  double b0 = 0;
  for (const double b : sizes_all) b0 += b / static_cast<double>(sizes_all.size());
  Vector2d mean = Vector2d::Zero();
  for (const Vector2d& own : family.own_start) mean += own / static_cast<double>(tests.size());
  const double level = std::exp(mean[0]);
  family.level_parameters = 2;
  family.model = [=](const VectorXd& theta, const Curve& c, double x) {
    if (!(std::abs(theta[2]) < 4)) return std::numeric_limits<double>::quiet_NaN();
    return level * (theta[0] * b0 / c.condition + theta[1]) * std::pow(x / reference, std::exp(theta[2]));
  };
  family.own_of = [=](const VectorXd& theta, const Curve& c) {
    return Vector2d(std::log(level * (theta[0] * b0 / c.condition + theta[1])), theta[2]);
  };
  const FamilyFit scaled = fit_family(family, Eigen::Vector3d(0.0, 1.0, mean[1]), o);
  // With theta = (kc, kphi, ln n) in units of their solution's size, whose profiles are wanted.
  const double power = std::pow(reference, -std::exp(scaled.theta[2]));
  const double unit = level * power, unit_c = unit * b0;
  family.model = [=](const VectorXd& theta, const Curve& c, double x) {
    if (!(std::abs(theta[2]) < 4)) return std::numeric_limits<double>::quiet_NaN();
    return unit * (theta[0] * b0 / c.condition + theta[1]) * std::pow(x, std::exp(theta[2]));
  };
  family.own_of = [=](const VectorXd& theta, const Curve& c) {
    return Vector2d(std::log(unit * (theta[0] * b0 / c.condition + theta[1])) + std::exp(theta[2]) * std::log(reference), theta[2]);
  };
  const FamilyFit fit = fit_family(family, scaled.theta, o);
  out.estimates = {{"kc", "N/m^(n+1)"}, {"kphi", "N/m^(n+2)"}, {"n", "-"}};
  out.estimates[2].coordinate = Coordinate::log;
  finish(out, family, fit, {0, 1, 2}, o.confidence);
  const Eigen::Vector3d units(unit_c, unit, 1.0);
  for (int i = 0; i < 2; ++i) {
    Estimate& e = out.estimates[static_cast<std::size_t>(i)];
    e.value *= units[i];
    e.low *= units[i];
    e.high *= units[i];
  }
  set_covariance(out, units.asDiagonal() * out.coordinate_covariance * units.asDiagonal());
  fill_curves(family, fit, out.curves);
  own_levels_to_k(out.curves, fit, reference, false);

  const double n = out.estimates[2].value;
  double count = 0, sx = 0, sxx = 0, sy = 0, sxy = 0;
  for (const PowerLaw& w : plates.wong) out.wong_n += w.n / static_cast<double>(tests.size());
  for (const double b : sizes) {
    ModuliFit::Plate plate;
    plate.size = b;
    double k = 0, square = 0, wong = 0;
    for (std::size_t i = 0; i < tests.size(); ++i) {
      if (std::abs(sizes_all[i] - b) > 0.02 * b) continue;
      plate.tests += 1;
      plate.n += out.curves[i].own_shape;
      // Pressure of this test at the reference depth, as a modulus for the common n.
      const double own = std::exp(fit.own[i].own[0]) * std::pow(reference, -n);
      k += own;
      square += own * own;
      const Curve& c = family.curves[i];
      double weight = 0, sum = 0;
      for (Eigen::Index p = 0; p < c.x.size(); ++p) {
        if (!(c.y[p] > 0)) continue;
        weight += c.y[p] * c.y[p];
        sum += c.y[p] * c.y[p] * (std::log(c.y[p]) - out.wong_n * std::log(c.x[p]));
      }
      wong += std::exp(sum / weight);
    }
    plate.n /= plate.tests;
    plate.modulus = k / plate.tests;
    if (plate.tests > 1) plate.modulus_std = std::sqrt(std::max(0.0, (square - k * k / plate.tests) / (plate.tests - 1)));
    wong /= plate.tests;
    count += 1, sx += 1 / b, sxx += 1 / (b * b), sy += wong, sxy += wong / b;
    out.plates.push_back(plate);
  }
  out.wong_kc = (count * sxy - sx * sy) / (count * sxx - sx * sx);
  out.wong_kphi = (sy - out.wong_kc * sx) / count;
  warn_sinkage(out, out.curves, fit, o);
  const Estimate &kc = out.estimates[0], &kphi = out.estimates[1];
  if (kc.value < 0)
    out.warnings.push_back({"negative", "kc",
                            fmt::format("kc is negative: larger plates meet a higher pressure at the same sinkage, as in frictional soil; below b = {:.3g} m the "
                                        "formula has no strength left",
                                        -kc.value / kphi.value),
                            "do not use it for contacts smaller than the plates"});
  if (kphi.value < 0)
    out.warnings.push_back({"negative", "kphi",
                            fmt::format("kphi is negative: for contacts wider than b = {:.3g} m the formula has no strength left", -kc.value / kphi.value),
                            "do not use it for contacts larger than the plates"});
  if (sizes.back() < 2 * sizes.front())
    out.warnings.push_back({"weakly_identified", "kc", fmt::format("the plates' sizes differ by a factor of {:.2g} only", sizes.back() / sizes.front()),
                            "add a plate of at least twice the size"});
  if (kc.low < 0 && kc.high > 0)
    out.warnings.push_back({"weakly_identified", "kc", "the interval of kc contains zero: these tests do not show that the plate's size matters in the way of kc/b",
                            "repeat the tests of the smallest and of the largest plate"});
  double n_low = 1e9, n_high = 0;
  for (const ModuliFit::Plate& p : out.plates) {
    n_low = std::min(n_low, p.n);
    n_high = std::max(n_high, p.n);
  }
  if (n_high > 1.25 * n_low)
    out.warnings.push_back({"model_misfit", "n", fmt::format("the exponent differs between plates, from {:.3g} to {:.3g}: one n for all is a compromise", n_low, n_high),
                            "fit over the same range of pressure or depth for every plate"});
  return out;
}

UnloadingFit fit_unloading(std::span<const PressureSinkageTest> tests, double share, double confidence) {
  if (!(share > 0 && share < 1)) throw InputError("share of the pressure that marks unloading: is to be between 0 and 1");
  UnloadingFit out;
  out.confidence = confidence;
  for (const PressureSinkageTest& t : tests) {
    const std::size_t n = std::min(t.sinkage.size(), t.pressure.size());
    std::size_t peak = 0;
    double deepest = 0;
    for (std::size_t i = 0; i < n; ++i) deepest = std::max(deepest, t.sinkage[i]);
    for (std::size_t i = 0; i < n; ++i) {
      if (!(t.pressure[i] < share * t.pressure[peak])) {
        if (t.pressure[i] >= t.pressure[peak]) peak = i;
        continue;
      }
      // Unloaded: on to the recovery of the pressure, or to the end of the test.
      UnloadingLoop loop;
      loop.begin = loop.lowest = peak;
      std::size_t j = peak;
      for (; j < n && (j <= i || t.pressure[j] < 0.95 * t.pressure[peak]); ++j) {
        if (t.sinkage[j] > t.sinkage[peak] + 0.02 * deepest) break;  // failed and went on, without unloading
        if (t.pressure[j] < t.pressure[loop.lowest]) loop.lowest = j;
      }
      loop.end = std::min(j, n - 1);
      loop.file = t.file;
      loop.sinkage = t.sinkage[peak];
      loop.pressure = t.pressure[peak];
      loop.lowest_pressure = t.pressure[loop.lowest];
      const double back = t.sinkage[peak] - t.sinkage[loop.lowest], drop = loop.pressure - loop.lowest_pressure;
      if (loop.lowest > peak + 1 && back > 1e-3 * deepest && drop > (1 - share) * loop.pressure && loop.pressure > 0) {
        loop.stiffness = drop / back;
        // Width of the loop at half the pressure, as an error of the displacement.
        const double half = 0.5 * (loop.pressure + loop.lowest_pressure);
        double down = loop.sinkage, up = loop.sinkage;
        for (std::size_t q = peak; q <= loop.lowest; ++q)
          if (t.pressure[q] >= half) down = t.sinkage[q];
        for (std::size_t q = loop.lowest; q <= loop.end; ++q)
          if (t.pressure[q] <= half) up = t.sinkage[q];
        loop.stiffness_std = loop.stiffness * std::min(1.0, 0.5 * std::abs(up - down) / back);
        out.loops.push_back(loop);
      }
      i = std::max(i, loop.end);
      peak = i < n ? i : n - 1;
      // The pressure before the loop stays the mark that the next one is measured from.
      if (t.pressure[loop.begin] > t.pressure[peak]) peak = loop.end;
    }
  }
  if (out.loops.empty()) return out;
  out.estimates = {{"k0", "Pa/m"}, {"A_u", "Pa/m^2"}};
  double count = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  std::vector<double> depths;
  for (const UnloadingLoop& l : out.loops) {
    count += 1, x += l.sinkage, y += l.stiffness, xx += l.sinkage * l.sinkage, xy += l.sinkage * l.stiffness, yy += l.stiffness * l.stiffness;
    depths.push_back(l.sinkage);
  }
  MatrixXd covariance = MatrixXd::Zero(2, 2);
  std::sort(depths.begin(), depths.end());
  const bool several = depths.back() > 1.2 * depths.front() && count >= 2;
  if (several) {
    const double d = count * xx - x * x;
    const double slope = (count * xy - x * y) / d, base = (y - slope * x) / count;
    double rest = 0, stated = 0;
    for (const UnloadingLoop& l : out.loops) {
      rest += std::pow(l.stiffness - base - slope * l.sinkage, 2);
      stated += l.stiffness_std * l.stiffness_std / count;
    }
    const double variance = count > 2 ? std::max(rest / (count - 2), stated) : std::max(stated, std::pow(0.1 * y / count, 2));
    out.estimates[0].value = base;
    out.estimates[1].value = slope;
    covariance << variance * xx / d, -variance * x / d, -variance * x / d, variance * count / d;
  } else {
    out.estimates[0].value = y / count;
    out.estimates[1].identified = false;
    covariance(0, 0) = count > 1 ? std::max(0.0, yy - y * y / count) / (count - 1) / count : std::pow(out.loops[0].stiffness_std, 2);
    out.warnings.push_back({"not_identified", "A_u", "all unloading began at nearly the same depth: how the stiffness grows with depth is not known",
                            "unload at three depths, the deepest at least twice the first"});
  }
  set_covariance(out, covariance);
  out.degrees_of_freedom = std::max(1.0, count - 2);
  const double t = t_quantile(confidence, out.degrees_of_freedom);
  for (Estimate& e : out.estimates) {
    e.low = e.value - t * e.std;
    e.high = e.value + t * e.std;
  }
  if (several && out.estimates[0].value < 0)
    out.warnings.push_back({"negative", "k0", "the unloading stiffness would vanish at a small depth", "unload at a smaller depth too"});
  return out;
}

std::vector<Warning> compare_with_wheel(const WheelUse& use, const bekker::ContactAngles& angles, std::span<const PressureSinkageTest> plates,
                                        const SinkageFit* sinkage, std::span<const DirectShearTest> shear, const ShearFit* shear_fit) {
  std::vector<Warning> out;
  double deepest_test = 0, rate = 0;
  std::vector<double> sizes;
  for (const PressureSinkageTest& t : plates) {
    for (const double z : t.sinkage)
      if (std::isfinite(z)) deepest_test = std::max(deepest_test, z);
    sizes.push_back(t.plate_width);
    if (t.rate) rate = std::max(rate, *t.rate);
  }
  std::sort(sizes.begin(), sizes.end());
  double largest_stress = 0, smallest_stress = std::numeric_limits<double>::infinity(), travel = 0, shear_rate = 0;
  for (const DirectShearTest& t : shear) {
    largest_stress = std::max(largest_stress, t.normal_stress);
    smallest_stress = std::min(smallest_stress, t.normal_stress);
    for (const double j : t.shear_displacement)
      if (std::isfinite(j)) travel = std::max(travel, std::abs(j));
    if (t.rate) shear_rate = std::max(shear_rate, *t.rate);
  }
  if (!sinkage || use.normal_loads.empty()) return out;
  bekker::Soil soil;
  soil.k = sinkage->value("k");
  soil.n = sinkage->value("n");
  soil.plate_width = sinkage->plate_width;
  if (shear_fit) {
    soil.cohesion = shear_fit->value("cohesion");
    soil.friction_angle = shear_fit->value("friction_angle");
    soil.shear_modulus = shear_fit->value("shear_modulus");
  } else {
    soil.cohesion = 0.0;
    soil.friction_angle = 0.55;
    soil.shear_modulus = 0.01;
  }
  double deepest = 0, contact = 0, peak = 0, slide = 0, penetration = 0;
  try {
    const bekker::SteadyWheel wheel({use.radius, use.width}, soil, angles, {}, {bekker::SkidShear::as_printed, 1e-6});
    for (const double load : use.normal_loads)
      for (const double slip : use.slips) {
        bekker::Operating op;
        op.slip = slip;
        op.normal_load = load;
        if (use.angular_velocity) op.angular_velocity = *use.angular_velocity;
        const bekker::SteadyState s = wheel.solve(op);
        deepest = std::max(deepest, s.sinkage);
        contact = std::max(contact, use.radius * std::sin(s.entry_angle));
        std::vector<bekker::ProfilePoint> points(41);
        wheel.profile(op, s, points);
        for (const bekker::ProfilePoint& p : points) {
          peak = std::max(peak, p.sigma);
          slide = std::max(slide, std::abs(p.shear_displacement));
        }
        if (use.angular_velocity)
          penetration = std::max(penetration, *use.angular_velocity * use.radius * std::abs(1 - slip) * std::sin(s.entry_angle));
      }
  } catch (const std::runtime_error& e) {
    out.push_back({"depth_range", "", std::string("the wheel cannot be solved with the fitted soil: ") + e.what(), "check k and n, and the load"});
    return out;
  }
  const double patch = std::min(use.width, contact);
  if (!sizes.empty() && (patch < 0.5 * sizes.front() || patch > 2 * sizes.back()))
    out.push_back({"plate_size", "k", fmt::format("the wheel's contact patch is about {:.3g} m across (short side), the plates {:.3g} to {:.3g} m", patch, sizes.front(), sizes.back()),
                   fmt::format("press a plate of about {:.2g} m by {:.2g} m", patch, std::max(use.width, contact))});
  if (deepest_test > 0 && deepest > 1.1 * deepest_test)
    out.push_back({"depth_range", "n", fmt::format("the wheel sinks to {:.3g} m, the plates were pressed to {:.3g} m", deepest, deepest_test), "press the plate as deep as the wheel sinks"});
  if (deepest_test > 0 && deepest < 0.2 * deepest_test)
    out.push_back({"depth_range", "n", fmt::format("the wheel sinks to {:.3g} m only, the fit reaches to {:.3g} m and is ruled by its deep end", deepest, deepest_test),
                   fmt::format("fit the first {:.2g} m (--max-depth)", 2 * deepest)});
  if (!shear.empty() && (peak < 0.5 * smallest_stress || peak > 2 * largest_stress))
    out.push_back({"depth_range", "friction_angle", fmt::format("the wheel presses with up to {:.4g} Pa, the shear tests with {:.4g} to {:.4g} Pa", peak, smallest_stress, largest_stress),
                   fmt::format("shear at about {:.2g} and {:.2g} Pa", 0.3 * peak, peak)});
  if (travel > 0 && slide > 2 * travel)
    out.push_back({"depth_range", "shear_modulus", fmt::format("under the wheel the soil is sheared by up to {:.3g} m, in the tests by {:.3g} m", slide, travel), "shear further"});
  if (rate > 0 && penetration > 0 && (penetration > 10 * rate || penetration < 0.1 * rate))
    out.push_back({"rate", "k", fmt::format("the wheel presses soil down at up to {:.3g} m/s, the plates at {:.3g} m/s", penetration, rate),
                   "dry sand hardly minds; fine or wet soil: press at the wheel's rate"});
  if (shear_rate > 0 && use.angular_velocity) {
    const double speed = *use.angular_velocity * use.radius * 0.3;
    if (speed > 10 * shear_rate || speed < 0.1 * shear_rate)
      out.push_back({"rate", "cohesion", fmt::format("at slip 0.3 the rim slides at {:.3g} m/s, the shear tests at {:.3g} m/s", speed, shear_rate),
                     "dry sand hardly minds; fine or wet soil: shear at the wheel's rate"});
  }
  return out;
}

SoilTestFits fit_soil_tests(const recording::Recording& recording, const SoilTestOptions& options) {
  SoilTestFits out;
  if (!recording.direct_shear.empty()) out.shear = fit_direct_shear(recording.direct_shear, options);
  if (!recording.pressure_sinkage.empty()) {
    // Eq. 25 holds for one plate: of several sizes the one nearest to the wheel's width.
    const double wheel_width = recording.wheel.width > 0 ? recording.wheel.width : recording.pressure_sinkage.front().plate_width;
    double nearest = recording.pressure_sinkage.front().plate_width;
    std::vector<double> widths;
    for (const PressureSinkageTest& t : recording.pressure_sinkage) {
      widths.push_back(t.plate_width);
      if (std::abs(std::log(t.plate_width / wheel_width)) < std::abs(std::log(nearest / wheel_width))) nearest = t.plate_width;
    }
    std::vector<PressureSinkageTest> chosen;
    for (const PressureSinkageTest& t : recording.pressure_sinkage)
      if (std::abs(t.plate_width - nearest) <= 0.02 * nearest) chosen.push_back(t);
    out.sinkage = fit_pressure_sinkage(chosen, options);
    if (chosen.size() < recording.pressure_sinkage.size())
      out.warnings.push_back({"plate_size", "k", fmt::format("of {} plate sizes, k and n are those of the plate of {:.3g} m, the nearest to the wheel's width", distinct(widths).size(), nearest),
                              "the fit of kc and kphi shows how they change with the size"});
    std::vector<double> sizes;
    for (const PressureSinkageTest& t : recording.pressure_sinkage) sizes.push_back(bekker_size(t));
    if (distinct(sizes).size() > 1) out.moduli = fit_bekker_moduli(recording.pressure_sinkage, options);
    UnloadingFit unloading = fit_unloading(recording.pressure_sinkage, 0.7, options.confidence);
    if (!unloading.loops.empty()) out.unloading = std::move(unloading);
  }
  WheelUse use;
  use.radius = recording.wheel.radius;
  use.width = recording.wheel.width;
  for (const recording::Run& r : recording.runs) {
    if (r.condition.normal_load) use.normal_loads.push_back(*r.condition.normal_load);
    if (r.condition.angular_velocity) use.angular_velocity = std::max(use.angular_velocity.value_or(0.0), *r.condition.angular_velocity);
  }
  use.normal_loads = distinct(use.normal_loads);
  if (use.normal_loads.size() > 2) use.normal_loads = {use.normal_loads.front(), use.normal_loads.back()};
  bekker::ContactAngles angles;
  angles.a0 = recording.soil.a0.value_or(angles.a0);
  angles.a1 = recording.soil.a1.value_or(angles.a1);
  angles.theta_r = recording.soil.theta_r.value_or(angles.theta_r);
  if (use.radius > 0 && use.width > 0)
    for (Warning& w : compare_with_wheel(use, angles, recording.pressure_sinkage, out.sinkage ? &*out.sinkage : nullptr, recording.direct_shear,
                                      out.shear ? &*out.shear : nullptr))
      out.warnings.push_back(std::move(w));
  return out;
}

void apply(const SoilTestFits& fits, recording::SoilBelief& soil) {
  if (fits.shear) {
    const bool keep_cohesion = !fits.shear->estimates[0].identified && soil.cohesion.has_value();
    if (!keep_cohesion) soil.cohesion = fits.shear->value("cohesion");
    soil.friction_angle = fits.shear->value("friction_angle");
    soil.shear_modulus = fits.shear->value("shear_modulus");
  }
  if (fits.sinkage) {
    soil.k = fits.sinkage->value("k");
    soil.n = fits.sinkage->value("n");
    soil.plate_width = fits.sinkage->plate_width;
    soil.kc.reset();
    soil.kphi.reset();
  }
}

}  // namespace terrode::calibration
