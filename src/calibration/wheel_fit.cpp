#include "calibration/wheel_fit.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "analysis/steady_state.h"
#include "calibration/least_squares.h"
#include "core/linear_algebra.h"
#include "core/parallel.h"
#include "core/random.h"

namespace terrode::calibration {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_log(const std::string& name) { return name == "shear_modulus" || name == "k" || name == "n"; }

const char* unit_of(const std::string& name) {
  if (name == "cohesion" || name == "k") return "Pa";
  if (name == "friction_angle" || name == "theta_r") return "rad";
  return name == "shear_modulus" ? "m" : "-";
}

double* member(const std::string& name, bekker::Soil& soil, bekker::ContactAngles& angles) {
  if (name == "cohesion") return &soil.cohesion;
  if (name == "friction_angle") return &soil.friction_angle;
  if (name == "shear_modulus") return &soil.shear_modulus;
  if (name == "k") return &soil.k;
  if (name == "n") return &soil.n;
  if (name == "a0") return &angles.a0;
  if (name == "a1") return &angles.a1;
  return &angles.theta_r;
}

// A parameter's coordinate (value or logarithm) kept between its limits: x = middle + half sin(u).
struct Bounded {
  std::string name;
  bool log = false;
  double low = 0.0, high = 0.0, start_low = 0.0, start_high = 0.0;  // in the coordinate

  explicit Bounded(const std::string& n) : name(n), log(is_log(n)) {
    const ParameterRange r = parameter_range(n);
    const auto coordinate = [this](double v) { return log ? std::log(v) : v; };
    low = coordinate(r.low), high = coordinate(r.high), start_low = coordinate(r.start_low), start_high = coordinate(r.start_high);
  }
  double coordinate(double u) const { return 0.5 * (low + high) + 0.5 * (high - low) * std::sin(u); }
  double value(double u) const { return log ? std::exp(coordinate(u)) : coordinate(u); }
  double slope(double u) const { return 0.5 * (high - low) * std::cos(u); }
  double inverse(double x) const { return std::asin(std::clamp((2 * x - low - high) / (high - low), -0.999, 0.999)); }
  bool at_limit(double u) const {
    const double x = coordinate(u), near = 1e-4 * (high - low);
    return x - low < near || high - x < near;
  }
};

// Differences over kDifferenceStep are good to a part in a thousand with forces solved this closely.
constexpr double kSolverTolerance = 1e-8, kDifferenceStep = 3e-5;
// Evaluations of all points that one profile may take.
constexpr int kProfileBudget = 1500;

struct Problem_ {
  const WheelData& data;
  const WheelFitOptions& options;
  std::vector<Bounded> parameters;
  std::vector<std::pair<std::size_t, std::size_t>> values;  // (point, channel) of each wheel residual
  std::vector<VectorXd> prior_mean;                          // in coordinates
  std::vector<MatrixXd> prior_root;                          // inverse of the Cholesky factor of the covariance
  std::vector<std::vector<Index>> prior_index;               // which parameters
  Index prior_count = 0;
  std::array<double, 3> discrepancy{};

  Problem_(const WheelData& d, const WheelFitOptions& o) : data(d), options(o) {
    for (const char* name : kWheelParameters)
      if (std::find(o.free.begin(), o.free.end(), name) != o.free.end()) parameters.emplace_back(name);
    for (std::size_t p = 0; p < d.points.size(); ++p)
      for (std::size_t c = 0; c < 3; ++c)
        if (o.use[c] && d.points[p].mean[c]) values.emplace_back(p, c);
    for (const Fit& prior : o.priors) add_prior(prior);
  }

  void add_prior(const Fit& prior) {
    std::vector<Index> mine, its;
    for (std::size_t e = 0; e < prior.estimates.size(); ++e) {
      if (!prior.estimates[e].identified) continue;
      for (std::size_t i = 0; i < parameters.size(); ++i)
        if (parameters[i].name == prior.estimates[e].name) mine.push_back(static_cast<Index>(i)), its.push_back(static_cast<Index>(e));
    }
    if (mine.empty()) return;
    VectorXd mean(static_cast<Index>(mine.size()));
    MatrixXd covariance(mean.size(), mean.size());
    for (Index a = 0; a < mean.size(); ++a) {
      mean[a] = prior.estimates[static_cast<std::size_t>(its[static_cast<std::size_t>(a)])].in_coordinate();
      for (Index b = 0; b < mean.size(); ++b)
        covariance(a, b) = prior.coordinate_covariance(its[static_cast<std::size_t>(a)], its[static_cast<std::size_t>(b)]);
    }
    // Student's t has a variance larger by nu/(nu - 2).
    const double nu = prior.degrees_of_freedom;
    covariance *= nu > 2.5 ? nu / (nu - 2) : 5.0;
    const MatrixXd precision = inverse_of_symmetric(covariance);
    prior_root.push_back(cholesky(precision).lower.transpose());
    prior_mean.push_back(mean);
    prior_index.push_back(mine);
    prior_count += mean.size();
  }

  Index count() const { return static_cast<Index>(values.size()) + prior_count; }

  void apply(const VectorXd& u, bekker::Soil& soil, bekker::ContactAngles& angles) const {
    soil = options.soil;
    angles = options.angles;
    for (std::size_t i = 0; i < parameters.size(); ++i) *member(parameters[i].name, soil, angles) = parameters[i].value(u[static_cast<Index>(i)]);
  }

  // Predictions of all points; false where the soil does not carry the wheel.
  bool predict(const VectorXd& u, std::vector<std::array<double, 3>>& out) const {
    bekker::Soil soil;
    bekker::ContactAngles angles;
    apply(u, soil, angles);
    try {
      const bekker::SteadyWheel wheel({data.radius, data.width}, soil, angles, {}, {bekker::SkidShear::as_printed, kSolverTolerance});
      out.resize(data.points.size());
      for (std::size_t p = 0; p < data.points.size(); ++p) {
        const bekker::SteadyState s = wheel.solve(data.points[p].operating);
        out[p] = {s.drawbar_pull, s.driving_torque, s.sinkage};
      }
      return true;
    } catch (const RunError&) {
      return false;
    }
  }

  double deviation(std::size_t point, std::size_t channel) const {
    return std::hypot(data.points[point].standard_error[channel], discrepancy[channel]);
  }

  ResidualFunction residuals() const {
    return [this](const VectorXd& u, VectorXd& r) {
      std::vector<std::array<double, 3>> at;
      if (u.cwiseAbs().maxCoeff() > 1e3 || !predict(u, at)) return false;
      Index i = 0;
      for (const auto& [p, c] : values) r[i++] = (at[p][c] - *data.points[p].mean[c]) / deviation(p, c);
      for (std::size_t q = 0; q < prior_mean.size(); ++q) {
        VectorXd d(prior_mean[q].size());
        for (Index a = 0; a < d.size(); ++a) {
          const auto k = prior_index[q][static_cast<std::size_t>(a)];
          d[a] = parameters[static_cast<std::size_t>(k)].coordinate(u[k]) - prior_mean[q][a];
        }
        r.segment(i, d.size()) = prior_root[q] * d;
        i += d.size();
      }
      return true;
    };
  }
};


// Discrepancy of each channel so that sum r^2/(se^2 + d^2) = count - share of the parameters.
void update_discrepancy(Problem_& problem, const LeastSquaresResult& fit) {
  const MatrixXd inverse = inverse_of_symmetric(fit.jacobian.transpose() * fit.jacobian);
  for (std::size_t c = 0; c < 3; ++c) {
    if (problem.options.discrepancy[c]) continue;
    double taken = 0.0, count = 0.0, square = 0.0;
    std::vector<std::pair<double, double>> terms;  // r^2, se^2
    for (std::size_t i = 0; i < problem.values.size(); ++i) {
      const auto& [p, channel] = problem.values[i];
      if (channel != c) continue;
      const auto row = static_cast<Index>(i);
      taken += fit.jacobian.row(row) * inverse * fit.jacobian.row(row).transpose();
      count += 1;
      const double r = fit.residuals[row] * problem.deviation(p, c);
      terms.emplace_back(r * r, std::pow(problem.data.points[p].standard_error[c], 2));
      square += std::pow(*problem.data.points[p].mean[c], 2);
    }
    if (count == 0) continue;
    const double wanted = std::max(0.5, count - taken);
    const double floor = 1e-6 * std::sqrt(square / count) + 1e-12;
    const auto sum = [&](double d) {
      double s = 0;
      for (const auto& [rr, ss] : terms) s += rr / (ss + d * d);
      return s;
    };
    double lo = floor, hi = 10 * std::sqrt(square / count) + 10 * floor;
    if (sum(lo) > wanted) {
      for (int i = 0; i < 80; ++i) {
        const double middle = std::sqrt(lo * hi);
        (sum(middle) > wanted ? lo : hi) = middle;
      }
    }
    problem.discrepancy[c] = lo;
  }
}

std::string remedy_of(const std::string& name) {
  if (name == "cohesion" || name == "friction_angle") return "run at a second load, at least twice or half of this one, or add direct shear tests";
  if (name == "shear_modulus") return "add runs at slips of 0.02 to 0.15, where the shear stress is still rising";
  if (name == "k" || name == "n") return "run at a second load, at least twice or half of this one, or add plate tests";
  if (name == "a0") return "measure the torque besides drawbar pull and sinkage";
  if (name == "a1") return "add runs at high slip";
  return "measure where contact ends behind the wheel";
}

}  // namespace

ParameterRange parameter_range(const std::string& name) {
  if (name == "cohesion") return {0.0, 5e4, 0.0, 2e3};
  if (name == "friction_angle") return {0.02, 1.2, 0.3, 0.8};
  if (name == "shear_modulus") return {1e-5, 0.5, 5e-4, 0.04};
  if (name == "k") return {10.0, 1e9, 5e3, 5e6};
  if (name == "n") return {0.05, 3.0, 0.3, 1.6};
  if (name == "a0") return {0.0, 1.0, 0.1, 0.6};
  if (name == "a1") return {-1.0, 2.0, 0.0, 0.9};
  if (name == "theta_r") return {-0.8, 0.0, -0.3, -0.01};
  throw InputError(Problem{{}, 0, 0, "parameter", "is '" + name + "'",
                           fmt::format("one of cohesion, friction_angle, shear_modulus, k, n, a0, a1, theta_r")});
}

Problems WheelFitOptions::validate() const {
  Problems out;
  if (free.empty()) out.push_back({{}, 0, 0, "free", "is empty", "at least one parameter"});
  for (const std::string& name : free) {
    try {
      parameter_range(name);
    } catch (const InputError& e) {
      out.insert(out.end(), e.problems().begin(), e.problems().end());
    }
  }
  for (Problem p : soil.validate()) p.key = "soil." + p.key, out.push_back(p);
  for (Problem p : angles.validate()) p.key = "contact." + p.key, out.push_back(p);
  if (starts < (start_from_soil ? 0 : 1) || starts > 100000) out.push_back({{}, 0, 0, "starts", fmt::format("is {}", starts), "from 1 to 100000 (0 with start_from_soil)"});
  require(out, "confidence", confidence, "-", confidence > 0 && confidence < 1, "between 0 and 1");
  for (std::size_t c = 0; c < 3; ++c)
    if (discrepancy[c]) require(out, std::string("discrepancy.") + kWheelChannels[c], *discrepancy[c], kWheelUnits[c], *discrepancy[c] >= 0, "at least 0");
  return out;
}

WheelData wheel_data(const recording::Recording& recording) {
  WheelData out;
  out.radius = recording.wheel.radius;
  out.width = recording.wheel.width;
  const std::vector<analysis::Replicates> groups = analysis::group_replicates(recording.runs);
  std::vector<std::vector<analysis::ReplicateScatter>> scatter(3);
  for (const analysis::Replicates& g : groups) {
    const recording::Run& first = recording.runs[g.runs.front()];
    std::optional<double> load = g.condition.normal_load;
    std::array<std::vector<analysis::SteadyState>, 3> means;
    std::vector<double> loads;
    for (const std::size_t r : g.runs) {
      const auto states = analysis::steady_states(recording.runs[r]);
      for (std::size_t c = 0; c < 3; ++c)
        if (const auto it = states.find(kWheelChannels[c]); it != states.end() && std::isfinite(it->second.mean)) {
          means[c].push_back(it->second);
          if (!it->second.reached)
            out.notes.push_back(fmt::format("{}: {} does not become steady ({}); its mean is used as it is", recording.runs[r].id, kWheelChannels[c], it->second.reason));
        }
      if (const auto it = states.find("normal_load"); it != states.end() && std::isfinite(it->second.mean)) loads.push_back(it->second.mean);
    }
    if (!load && !loads.empty()) load = std::accumulate(loads.begin(), loads.end(), 0.0) / static_cast<double>(loads.size());
    if (!load && recording.wheel.mass) load = *recording.wheel.mass * 9.81;
    if (!load) {
      out.notes.push_back(first.id + ": no normal load is known; left out");
      continue;
    }
    WheelPoint point;
    point.id = first.id;
    point.replicates = static_cast<int>(g.runs.size());
    point.operating.slip = g.condition.slip;
    point.operating.normal_load = *load;
    point.operating.pass = g.condition.pass;
    if (g.condition.angular_velocity) point.operating.angular_velocity = *g.condition.angular_velocity;
    if (g.condition.forward_velocity && std::isinf(g.condition.slip)) point.operating.forward_velocity = *g.condition.forward_velocity;
    bool any = false;
    for (std::size_t c = 0; c < 3; ++c) {
      scatter[c].push_back(analysis::replicate_scatter(means[c]));
      if (means[c].empty()) continue;
      any = true;
      point.mean[c] = scatter[c].back().mean;
      point.standard_error[c] = scatter[c].back().within_sem / std::sqrt(static_cast<double>(means[c].size()));
    }
    if (!any) {
      out.notes.push_back(first.id + ": none of drawbar_pull, driving_torque, sinkage was recorded; left out");
      for (auto& s : scatter) s.pop_back();
      continue;
    }
    out.points.push_back(point);
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const analysis::PooledScatter pooled = analysis::pooled_scatter(scatter[c]);
    if (pooled.degrees_of_freedom == 0) continue;
    for (std::size_t p = 0; p < out.points.size(); ++p)
      if (out.points[p].mean[c])
        out.points[p].standard_error[c] = std::max(out.points[p].standard_error[c], pooled.std / std::sqrt(std::max(1.0, static_cast<double>(scatter[c][p].count))));
  }
  if (out.points.empty()) throw InputError(Problem{recording.folder, 0, 0, "runs", "hold no run with a load and drawbar pull, torque or sinkage", {}});
  return out;
}

WheelFit fit_wheel(const WheelData& data, const WheelFitOptions& options, const Progress& progress) {
  throw_if_any(options.validate());
  throw_if_any(bekker::WheelSize{data.radius, data.width}.validate());
  for (const WheelPoint& p : data.points) throw_if_any(p.operating.validate());
  Problem_ problem(data, options);
  const auto count = static_cast<Index>(problem.parameters.size());
  if (problem.count() < count)
    throw InputError(fmt::format("{} measured values (and {} from soil tests) cannot set {} parameters", problem.values.size(), problem.prior_count, count));
  for (std::size_t c = 0; c < 3; ++c) {
    double square = 0, number = 0;
    for (const auto& [p, channel] : problem.values)
      if (channel == c) square += std::pow(*data.points[p].mean[c], 2), number += 1;
    problem.discrepancy[c] = options.discrepancy[c].value_or(number > 0 ? 0.1 * std::sqrt(square / number) : 0.0);
    for (const auto& [p, channel] : problem.values)
      if (channel == c && !(problem.deviation(p, c) > 0)) problem.discrepancy[c] = 1e-9;
  }

  // Starting points: a latin hypercube over the ranges; priors and the given soil replace what they know.
  const auto starts = static_cast<std::size_t>(options.starts) + (options.start_from_soil ? 1 : 0);
  std::vector<VectorXd> start(starts, VectorXd(count));
  Random random(options.seed);
  for (Index i = 0; i < count; ++i) {
    const Bounded& b = problem.parameters[static_cast<std::size_t>(i)];
    std::vector<std::size_t> order(starts);
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t s = starts; s > 1; --s) std::swap(order[s - 1], order[random.below(s)]);
    for (std::size_t s = 0; s < starts; ++s) {
      const double share = (static_cast<double>(order[s]) + random.uniform()) / static_cast<double>(starts);
      start[s][i] = b.inverse(b.start_low + share * (b.start_high - b.start_low));
    }
  }
  for (std::size_t q = 0; q < problem.prior_mean.size(); ++q)
    for (std::size_t a = 0; a < problem.prior_index[q].size(); ++a)
      for (std::size_t s = 0; s < starts; s += 2) {
        const Index i = problem.prior_index[q][a];
        start[s][i] = problem.parameters[static_cast<std::size_t>(i)].inverse(problem.prior_mean[q][static_cast<Index>(a)]);
      }
  if (options.start_from_soil) {
    bekker::Soil soil = options.soil;
    bekker::ContactAngles angles = options.angles;
    for (Index i = 0; i < count; ++i) {
      const Bounded& b = problem.parameters[static_cast<std::size_t>(i)];
      const double v = *member(b.name, soil, angles);
      start.back()[i] = b.inverse(b.log ? std::log(v) : v);
    }
  }
  const ResidualFunction residuals = problem.residuals();
  LeastSquaresOptions search;
  search.difference_step = kDifferenceStep;
  search.max_iterations = 60;
  search.tolerance = 1e-5;
  std::vector<std::optional<LeastSquaresResult>> found(starts);
  std::atomic<std::size_t> done{0};
  parallel_for(starts, options.threads, [&](std::size_t s) {
    if (progress.stop_requested()) throw Interrupted("stopped; nothing was kept");
    VectorXd u = start[s];
    VectorXd r(problem.count());
    // A soil too soft to carry the wheel is made stiffer.
    for (int i = 0; i < 12 && !residuals(u, r); ++i)
      for (Index p = 0; p < count; ++p)
        if (problem.parameters[static_cast<std::size_t>(p)].name == "k") {
          const Bounded& b = problem.parameters[static_cast<std::size_t>(p)];
          u[p] = b.inverse(b.coordinate(u[p]) + 1.0);
        }
    if (residuals(u, r)) found[s] = least_squares(residuals, problem.count(), u, search);
    progress.report(0.7 * static_cast<double>(++done) / static_cast<double>(starts), "starting points");
  });
  WheelFit out;
  const LeastSquaresResult* best = nullptr;
  for (const auto& f : found)
    if (f && (!best || f->sum_of_squares < best->sum_of_squares)) best = &*f;
  if (!best) throw RunError("wheel fit: with none of the starting points does the soil carry the wheel; give a soil to start from");
  search.max_iterations = 200;
  search.tolerance = 1e-8;
  LeastSquaresResult fit = least_squares(residuals, problem.count(), best->x, search);
  for (int i = 0; i < 8; ++i) {
    const std::array<double, 3> before = problem.discrepancy;
    update_discrepancy(problem, fit);
    fit = least_squares(residuals, problem.count(), fit.x, search);
    double change = 0;
    for (std::size_t c = 0; c < 3; ++c) change = std::max(change, std::abs(problem.discrepancy[c] - before[c]) / std::max(before[c], 1e-12));
    if (change < 0.01) break;
  }
  // The other minima under the same weights.
  for (const auto& f : found) {
    if (!f) continue;
    out.starts += 1;
    VectorXd r(problem.count());
    if (!residuals(f->x, r)) continue;
    if ((f->x - fit.x).cwiseAbs().maxCoeff() < 0.02 || std::abs(r.squaredNorm() - fit.sum_of_squares) < 0.1) {
      out.starts_at_best += 1;
      continue;
    }
    if (r.squaredNorm() > fit.sum_of_squares + 30) continue;
    const LeastSquaresResult polished = least_squares(residuals, problem.count(), f->x, search);
    if (polished.sum_of_squares < fit.sum_of_squares - 1e-3) {
      fit = polished;
      continue;
    }
    bool same = (polished.x - fit.x).cwiseAbs().maxCoeff() < 0.02 || polished.sum_of_squares - fit.sum_of_squares < 0.01;
    if (same) {
      out.starts_at_best += 1;
    } else if (polished.sum_of_squares < fit.sum_of_squares + 6) {
      std::vector<double> values;
      for (Index p = 0; p < count; ++p) values.push_back(problem.parameters[static_cast<std::size_t>(p)].value(polished.x[p]));
      bool known = false;
      for (const auto& v : out.rivals) {
        bool equal = true;
        for (std::size_t i = 0; i < v.size(); ++i) equal = equal && std::abs(v[i] - values[i]) < 0.02 * (std::abs(v[i]) + 1e-9);
        known = known || equal;
      }
      if (!known) out.rivals.push_back(values);
    }
  }
  problem.apply(fit.x, out.soil, out.angles);
  problem.predict(fit.x, out.predicted);
  out.confidence = options.confidence;
  out.degrees_of_freedom = std::max(1.0, static_cast<double>(problem.count() - count));
  const double t = t_quantile(options.confidence, out.degrees_of_freedom);

  // Covariance in coordinates. A parameter at its limit counts as free, by differences taken inwards: to hold it would
  // make the others look better known than they are.
  const ResidualFunction in_coordinates = [&](const VectorXd& x, VectorXd& r) {
    VectorXd u(count);
    for (Index i = 0; i < count; ++i) {
      const Bounded& b = problem.parameters[static_cast<std::size_t>(i)];
      const double share = (2 * x[i] - b.low - b.high) / (b.high - b.low);
      if (!(std::abs(share) <= 1.0)) return false;
      u[i] = std::asin(share);
    }
    return residuals(u, r);
  };
  VectorXd solution(count);
  for (Index i = 0; i < count; ++i) solution[i] = problem.parameters[static_cast<std::size_t>(i)].coordinate(fit.x[i]);
  VectorXd unit(count);
  for (Index i = 0; i < count; ++i) {
    const Bounded& b = problem.parameters[static_cast<std::size_t>(i)];
    unit[i] = b.log ? 1.0 : b.start_high - b.start_low;
  }
  const ResidualFunction scaled = [&](const VectorXd& x, VectorXd& r) { return in_coordinates(solution + unit.cwiseProduct(x), r); };
  MatrixXd jacobian;
  if (!difference_jacobian(scaled, problem.count(), VectorXd::Zero(count), kDifferenceStep, jacobian))
    throw RunError("wheel fit: the model cannot be evaluated beside its best parameters");
  MatrixXd covariance = unit.asDiagonal() * inverse_of_symmetric(jacobian.transpose() * jacobian) * unit.asDiagonal();
  for (Index i = 0; i < count; ++i) {
    const Bounded& b = problem.parameters[static_cast<std::size_t>(i)];
    Estimate e;
    e.name = b.name;
    e.unit = unit_of(b.name);
    e.coordinate = b.log ? Coordinate::log : Coordinate::value;
    e.value = b.value(fit.x[i]);
    e.at_bound = b.at_limit(fit.x[i]);
    out.free.push_back(b.name);
    out.estimates.push_back(e);
  }
  set_covariance(out, covariance);
  for (Index i = 0; i < count; ++i) {
    if (progress.stop_requested()) throw Interrupted("stopped; nothing was kept");
    const Bounded& b = problem.parameters[static_cast<std::size_t>(i)];
    Estimate& e = out.estimates[static_cast<std::size_t>(i)];
    const double x = b.coordinate(fit.x[i]), se = std::sqrt(covariance(i, i));
    double low = std::max(b.low, x - t * se), high = std::min(b.high, x + t * se);
    if (options.profiles && !e.at_bound) {
      // In the coordinate itself, so that an interval may end at a limit.
      int evaluations = 0;
      const ResidualFunction held = [&](const VectorXd& x_of, VectorXd& r) {
        if (++evaluations > kProfileBudget) return false;
        VectorXd u = x_of;
        if (!(x_of[i] >= b.low && x_of[i] <= b.high)) return false;
        u[i] = std::asin((2 * x_of[i] - b.low - b.high) / (b.high - b.low));
        return residuals(u, r);
      };
      LeastSquaresResult at = fit;
      at.x[i] = x;
      LeastSquaresOptions profile = search;
      profile.max_iterations = 40;
      profile.tolerance = 1e-5;
      try {
        const auto [from, to] = profile_interval(held, at, i, se, t, 1.0, profile);
        if (evaluations <= kProfileBudget) {
          low = std::max(from, b.low);
          high = std::min(to, b.high);
        }
      } catch (const RunError&) {
        evaluations = kProfileBudget + 1;
      }
      if (evaluations > kProfileBudget)
        out.warnings.push_back({"weakly_identified", e.name, fmt::format("the profile of {} is too flat to be followed; its interval is that of the standard error", e.name), remedy_of(e.name)});
    }
    e.low = b.log ? std::exp(low) : low;
    e.high = b.log ? std::exp(high) : high;
    progress.report(0.7 + 0.3 * static_cast<double>(i + 1) / static_cast<double>(count), "intervals");
    const double relative = e.value != 0 ? e.std / std::abs(e.value) : std::numeric_limits<double>::infinity();
    if (e.at_bound)
      out.warnings.push_back({"at_bound", e.name, fmt::format("{} = {:.4g} {} is the limit of its range: the data want it further", e.name, e.value, e.unit),
                              "look at the residuals; a missing effect may hide in it"});
    else if (relative > 0.5 && e.name != "a1" && e.name != "theta_r")
      out.warnings.push_back({"weakly_identified", e.name, fmt::format("{} = {:.4g} {} has a standard error of {:.0f} percent", e.name, e.value, e.unit, 100 * relative), remedy_of(e.name)});
  }
  for (Index a = 0; a < count; ++a)
    for (Index b = a + 1; b < count; ++b) {
      const double r = covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b));
      const std::string &one = out.free[static_cast<std::size_t>(a)], &other = out.free[static_cast<std::size_t>(b)];
      if (std::abs(r) > 0.98)
        out.warnings.push_back({"weakly_identified", one, fmt::format("{} and {} are known only together (correlation {:.3f})", one, other, r), remedy_of(one)});
    }
  for (std::size_t c = 0; c < 3; ++c) {
    WheelFit::Channel& channel = out.channels[c];
    channel.name = kWheelChannels[c];
    channel.unit = kWheelUnits[c];
    channel.discrepancy = problem.discrepancy[c];
    std::vector<std::array<double, 3>> sorted;  // load, slip, scaled residual
    double square = 0, errors = 0;
    for (std::size_t i = 0; i < problem.values.size(); ++i) {
      const auto& [p, which] = problem.values[i];
      if (which != c) continue;
      const double r = fit.residuals[static_cast<Index>(i)];
      out.chi_squared += r * r;
      square += std::pow(r * problem.deviation(p, c), 2);
      errors += std::pow(data.points[p].standard_error[c], 2);
      sorted.push_back({data.points[p].operating.normal_load, data.points[p].operating.slip, r});
      channel.count += 1;
    }
    if (channel.count == 0) continue;
    channel.rmse = std::sqrt(square / channel.count);
    channel.standard_error = std::sqrt(errors / channel.count);
    std::sort(sorted.begin(), sorted.end());
    double lag = 0, all = 0;
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      all += sorted[i][2] * sorted[i][2];
      if (i > 0 && std::abs(sorted[i][0] - sorted[i - 1][0]) < 0.02 * sorted[i][0]) lag += sorted[i][2] * sorted[i - 1][2];
    }
    channel.correlation = all > 0 ? lag / all : 0.0;
    if (channel.count >= 6 && channel.correlation > 2.0 / std::sqrt(static_cast<double>(channel.count)) - 0.15)
      out.warnings.push_back({"model_misfit", "",
                              fmt::format("residuals of {} at neighbouring slips are alike (correlation {:.2f}): the model misses something systematic, and the intervals are too narrow",
                                          channel.name, channel.correlation),
                              "terrode diagnose looks for what is missing"});
  }
  if (!out.rivals.empty())
    out.warnings.push_back({"weakly_identified", "", fmt::format("{} other set(s) of parameters fit nearly as well", out.rivals.size()), "see the list of rivals; priors from soil tests decide"});
  return out;
}

}  // namespace terrode::calibration
