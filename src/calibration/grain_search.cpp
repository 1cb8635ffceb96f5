#include "calibration/grain_search.h"

#include <fmt/format.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multimin.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>

#include "core/random.h"

namespace terrode::calibration {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Components kept of each test: so many as give this share of the curves' variance, at most kComponents.
constexpr double kShare = 0.99;
constexpr Index kComponents = 4;
// Streams of random numbers of one search.
constexpr std::uint64_t kDesign = 1000, kAsk = 2000, kPosterior = 3000, kFront = 4000, kDraws = 5000;

const char* remedy_of(const std::string& name) {
  if (name == "young_modulus") return "a test that shows the grains' elasticity: unloading and reloading of a plate, or higher stresses";
  if (name == "friction") return "direct shear at further normal stresses, carried on until the stress no longer changes";
  if (name == "rolling_friction") return "an angle of repose, which rolling resistance rules";
  if (name == "restitution") return "slow tests do not see it: drop or shake the grains, or take it from a table";
  return "take it from a sieve analysis";
}

// Points of a latin hypercube, of several tries the one whose nearest neighbours are farthest apart.
std::vector<VectorXd> spread_points(std::size_t count, Index d, Random& random) {
  std::vector<VectorXd> best;
  double best_gap = -1.0;
  for (int attempt = 0; attempt < 100; ++attempt) {
    std::vector<VectorXd> points(count, VectorXd(d));
    for (Index i = 0; i < d; ++i) {
      std::vector<std::size_t> order(count);
      std::iota(order.begin(), order.end(), 0);
      for (std::size_t s = count; s > 1; --s) std::swap(order[s - 1], order[random.below(s)]);
      for (std::size_t s = 0; s < count; ++s) points[s][i] = (static_cast<double>(order[s]) + random.uniform()) / static_cast<double>(count);
    }
    double gap = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < count; ++a)
      for (std::size_t b = 0; b < a; ++b) gap = std::min(gap, (points[a] - points[b]).norm());
    if (gap > best_gap) best_gap = gap, best = points;
  }
  return best;
}

VectorXd anywhere(Index d, Random& random) {
  VectorXd u(d);
  for (Index i = 0; i < d; ++i) u[i] = random.uniform();
  return u;
}

// Largest value of a function on the unit cube: many places, then shrinking steps about the best ones.
VectorXd maximise(const std::function<double(const VectorXd&)>& f, Index d, const std::vector<VectorXd>& also, Random& random) {
  std::vector<std::pair<double, VectorXd>> found;
  for (const VectorXd& u : also) found.emplace_back(f(u), u);
  for (int i = 0; i < 600 + 200 * static_cast<int>(d); ++i) {
    const VectorXd u = anywhere(d, random);
    found.emplace_back(f(u), u);
  }
  const std::size_t keep = std::min<std::size_t>(5, found.size());
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(keep), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  found.resize(keep);
  for (auto& [value, u] : found) {
    double step = 0.1;
    for (int i = 0; i < 120; ++i) {
      VectorXd v = u;
      for (Index k = 0; k < d; ++k) v[k] = std::clamp(v[k] + step * random.normal(), 0.0, 1.0);
      const double there = f(v);
      if (there > value) value = there, u = v;
      else step = std::max(2e-3, 0.95 * step);
    }
  }
  return std::max_element(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; })->second;
}

std::vector<const Evaluation*> good_of(const std::vector<Evaluation>& done, int level) {
  std::vector<const Evaluation*> out;
  for (const Evaluation& e : done)
    if (e.level == level && e.error.empty()) out.push_back(&e);
  return out;
}

}  // namespace

Problems SearchOptions::validate() const {
  Problems out;
  if (free.empty()) out.push_back({{}, 0, 0, "free", "is empty", "at least one parameter"});
  for (const FreeParameter& f : free) {
    try {
      const GrainParameter& p = grain_parameter(f.name);
      if (f.low != f.high) {
        require(out, "range " + f.name, f.low, p.unit.c_str(), f.low >= p.least && (!p.log || f.low > 0), fmt::format("at least {:g} {}", p.least, p.unit));
        require(out, "range " + f.name, f.high, p.unit.c_str(), f.high > f.low && f.high <= p.most, fmt::format("above the lower end, at most {:g} {}", p.most, p.unit));
      }
    } catch (const InputError& e) {
      out.insert(out.end(), e.problems().begin(), e.problems().end());
    }
    for (const FreeParameter& g : free)
      if (&g < &f && g.name == f.name) out.push_back({{}, 0, 0, "free", "names " + f.name + " twice", {}});
  }
  if (evaluations.empty()) out.push_back({{}, 0, 0, "evaluations", "is empty", "a number for each bed"});
  const int least = static_cast<int>(free.size()) + 3;
  for (const int n : evaluations)
    if (n < least || n > 2000) out.push_back({{}, 0, 0, "evaluations", fmt::format("is {}", n), fmt::format("from {} to 2000 for each bed", least)});
  if (batch < 1 || batch > 256) out.push_back({{}, 0, 0, "batch", fmt::format("is {}", batch), "from 1 to 256"});
  if (!evaluations.empty() && (confirmations < 0 || confirmations > evaluations.back() - least + 1))
    out.push_back({{}, 0, 0, "confirmations", fmt::format("is {}", confirmations), fmt::format("from 0 to {}", std::max(0, evaluations.back() - least + 1))});
  require(out, "shear_weight", shear_weight, "-", shear_weight >= 0 && shear_weight <= 1, "from 0 to 1");
  require(out, "confidence", confidence, "-", confidence > 0 && confidence < 1, "between 0 and 1");
  if (method != SearchMethod::surrogate && evaluations.size() > 1) out.push_back({{}, 0, 0, "evaluations", "are for several beds", "one bed for random search and simplex"});
  return out;
}

CurveSurrogate::CurveSurrogate(const std::vector<TestTarget>& targets, const std::vector<Evaluation>& done, int levels) : targets_(targets) {
  const VectorXd measured = target_vector(targets);
  std::vector<VectorXd> all;
  for (const Evaluation& e : done)
    if (e.error.empty()) all.push_back(target_vector(targets, e.curves));
  if (good_of(done, 0).size() < 3) throw InputError("a surrogate needs at least 3 evaluations of the cheapest bed");
  mean_ = VectorXd::Zero(measured.size());
  for (const VectorXd& y : all) mean_ += y / static_cast<double>(all.size());
  basis_.resize(measured.size(), 0);
  const VectorXd off = measured - mean_;
  for (const bool plates : {false, true}) {
    const auto [begin, count] = test_block(targets, plates ? "pressure_sinkage" : "direct_shear");
    if (!plates) split_ = 0;
    if (count > 0) {
      MatrixXd a(count, static_cast<Index>(all.size()));
      for (std::size_t i = 0; i < all.size(); ++i) a.col(static_cast<Index>(i)) = (all[i] - mean_).segment(begin, count);
      const Eigen::JacobiSVD<MatrixXd> svd(a, Eigen::ComputeThinU);
      const VectorXd square = svd.singularValues().array().square();
      Index kept = 0;
      for (double sum = 0.0; kept < std::min(kComponents, square.size()) && sum < kShare * square.sum(); ++kept) sum += square[kept];
      kept = std::max<Index>(1, kept);
      const Index at = basis_.cols();
      basis_.conservativeResize(Eigen::NoChange, at + kept);
      basis_.rightCols(kept).setZero();
      basis_.block(begin, at, count, kept) = svd.matrixU().leftCols(kept);
      const VectorXd reached = basis_.rightCols(kept).transpose() * off;
      rest_[plates ? 1 : 0] = std::max(0.0, off.segment(begin, count).squaredNorm() - reached.squaredNorm());
    }
    if (!plates) split_ = basis_.cols();
  }
  target_ = basis_.transpose() * off;
  covariance_ = basis_.transpose() * target_covariance(targets) * basis_;
  for (const TestTarget& t : targets) freedom_ += std::max(1.0, t.freedom) / static_cast<double>(targets.size());
  for (int level = 0; level < levels; ++level) {
    const auto good = good_of(done, level);
    if (level > 0 && good.size() < 4) break;
    const Index n = static_cast<Index>(good.size()), d = good.front()->unit.size();
    MatrixXd x(n, d), y(n, target_.size()), trend(n, target_.size());
    VectorXd m, v;
    for (Index i = 0; i < n; ++i) {
      const Evaluation& e = *good[static_cast<std::size_t>(i)];
      x.row(i) = e.unit.transpose();
      y.row(i) = (basis_.transpose() * (target_vector(targets, e.curves) - mean_)).transpose();
      if (level > 0) {
        predict(e.unit, level - 1, m, v);
        trend.row(i) = m.transpose();
      }
    }
    std::vector<GaussianProcess> processes(static_cast<std::size_t>(target_.size()));
    for (Index k = 0; k < target_.size(); ++k) processes[static_cast<std::size_t>(k)].fit(x, y.col(k), level > 0 ? VectorXd(trend.col(k)) : VectorXd());
    processes_.push_back(std::move(processes));
  }
}

void CurveSurrogate::predict(const VectorXd& unit, int level, VectorXd& mean, VectorXd& variance) const {
  mean.resize(target_.size());
  variance.resize(target_.size());
  for (Index k = 0; k < target_.size(); ++k) {
    double trend = 0.0;
    for (int l = 0; l <= level; ++l) {
      const GaussianProcess::Prediction p = processes_[static_cast<std::size_t>(l)][static_cast<std::size_t>(k)].predict(unit, trend);
      trend = mean[k] = p.mean;
      variance[k] = p.variance;
    }
  }
}

Misfit CurveSurrogate::misfit(const VectorXd& unit, int level, double shear_weight) const {
  VectorXd m, v;
  predict(unit, level, m, v);
  const VectorXd square = (m - target_).array().square() + v.array();
  Misfit out;
  out.shear = square.head(split_).sum() + rest_[0];
  out.plates = square.tail(square.size() - split_).sum() + rest_[1];
  out.total = shear_weight * out.shear + (1.0 - shear_weight) * out.plates;
  return out;
}

std::vector<std::vector<double>> CurveSurrogate::curves(const VectorXd& unit, int level) const {
  VectorXd m, v;
  predict(unit, level, m, v);
  const VectorXd y = mean_ + basis_ * m;
  // Undo the scale: target_vector of curves of 1 Pa.
  std::vector<std::vector<double>> out;
  for (const TestTarget& t : targets_) out.emplace_back(t.at.size(), 1.0);
  const VectorXd one = target_vector(targets_, out);
  Index i = 0;
  for (auto& c : out)
    for (double& value : c) value = y[i] / one[i], ++i;
  return out;
}

double CurveSurrogate::chi_squared(const VectorXd& unit, int level) const {
  VectorXd m, v;
  predict(unit, level, m, v);
  MatrixXd c = covariance_;
  c.diagonal() += v;
  return (m - target_).dot(c.llt().solve(m - target_));
}

double CurveSurrogate::log_likelihood(const VectorXd& unit, int level, double factor) const {
  VectorXd m, v;
  predict(unit, level, m, v);
  MatrixXd c = factor * covariance_;
  c.diagonal() += v;
  const Eigen::LLT<MatrixXd> llt(c);
  double log_det = 0.0;
  for (Index i = 0; i < c.rows(); ++i) log_det += 2.0 * std::log(llt.matrixLLT()(i, i));
  // The scatter is itself known from a few repeats: Student's t of so many variables in place of the normal law.
  const double q = (m - target_).dot(llt.solve(m - target_)), p = static_cast<double>(c.rows());
  return -0.5 * ((freedom_ + p) * std::log1p(q / freedom_) + log_det);
}

double CurveSurrogate::bed_scatter(int level, const std::string& test) const {
  double sum = 0.0;
  const bool plates = test == "pressure_sinkage";
  for (Index k = plates ? split_ : 0; k < (plates ? target_.size() : split_); ++k)
    sum += processes_[static_cast<std::size_t>(level)][static_cast<std::size_t>(k)].noise_variance();
  return std::sqrt(sum);
}

std::vector<double> CurveSurrogate::leave_one_out(int level) const {
  std::vector<double> out;
  for (const GaussianProcess& p : processes_[static_cast<std::size_t>(level)]) {
    const VectorXd r = p.leave_one_out();
    out.insert(out.end(), r.begin(), r.end());
  }
  return out;
}

GrainSearch::GrainSearch(std::vector<TestTarget> targets, SearchOptions options) : targets_(std::move(targets)), options_(std::move(options)) {
  throw_if_any(options_.validate());
  if (targets_.empty()) throw InputError("there is no soil test to match");
  for (const FreeParameter& f : options_.free) {
    GrainParameter p = grain_parameter(f.name);
    if (f.low != f.high) p.low = f.low, p.high = f.high;
    parameters_.push_back(p);
  }
  bool shear = false, plates = false;
  for (const TestTarget& t : targets_) (t.test == "direct_shear" ? shear : plates) = true;
  if (!plates) options_.shear_weight = 1.0;
  if (!shear) options_.shear_weight = 0.0;
}

int GrainSearch::total() const { return std::accumulate(options_.evaluations.begin(), options_.evaluations.end(), 0); }

GrainValues GrainSearch::values(const VectorXd& unit) const {
  GrainValues out;
  for (std::size_t i = 0; i < parameters_.size(); ++i) out[parameters_[i].name] = parameters_[i].from_unit(unit[static_cast<Index>(i)]);
  return out;
}

Misfit GrainSearch::observed(const std::vector<std::vector<double>>& curves) const {
  const VectorXd d = target_vector(targets_, curves) - target_vector(targets_);
  const auto [s, ns] = test_block(targets_, "direct_shear");
  const auto [p, np] = test_block(targets_, "pressure_sinkage");
  Misfit out;
  out.shear = ns > 0 ? d.segment(s, ns).squaredNorm() : 0.0;
  out.plates = np > 0 ? d.segment(p, np).squaredNorm() : 0.0;
  out.total = options_.shear_weight * out.shear + (1.0 - options_.shear_weight) * out.plates;
  return out;
}

Misfit GrainSearch::observed(const Evaluation& e) const { return observed(e.curves); }

int GrainSearch::best_observed(const std::vector<Evaluation>& done, int level) const {
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < done.size(); ++i) {
    if (done[i].level != level || !done[i].error.empty() || done[i].purpose == "confirm") continue;
    const double j = observed(done[i]).total;
    if (j < least) least = j, best = static_cast<int>(i);
  }
  return best;
}

VectorXd GrainSearch::recommended(const CurveSurrogate& s, int level) const {
  Random random = Random::stream(options_.seed, kAsk + 999);
  const auto f = [&](const VectorXd& u) { return -s.misfit(u, level, options_.shear_weight).total; };
  return maximise(f, static_cast<Index>(parameters_.size()), {}, random);
}

// Nelder & Mead's simplex as GSL has it, replayed over the evaluations that are there until it asks for one that is not.
bool GrainSearch::ask_simplex(const std::vector<Evaluation>& done, VectorXd& wanted) const {
  static const bool quiet = (gsl_set_error_handler_off(), true);
  static_cast<void>(quiet);
  const auto d = static_cast<std::size_t>(parameters_.size());
  struct Call {
    const GrainSearch& self;
    std::vector<const Evaluation*> known;
    std::size_t at = 0;
    bool missing = false;
    VectorXd wanted;
  } call{*this, {}, 0, false, VectorXd(static_cast<Index>(d))};
  for (const Evaluation& e : done)
    if (e.purpose == "simplex") call.known.push_back(&e);
  gsl_multimin_function f{[](const gsl_vector* x, void* data) -> double {
                            Call& c = *static_cast<Call*>(data);
                            double outside = 0.0;
                            VectorXd u(c.wanted.size());
                            for (Index i = 0; i < u.size(); ++i) {
                              u[i] = gsl_vector_get(x, static_cast<std::size_t>(i));
                              outside += std::max({0.0, -u[i], u[i] - 1.0});
                            }
                            if (c.missing) return GSL_NAN;
                            if (outside > 0.0) return 1e3 * (1.0 + outside);  // costs no simulation
                            if (c.at == c.known.size()) {
                              c.missing = true;
                              c.wanted = u;
                              return GSL_NAN;
                            }
                            const Evaluation& e = *c.known[c.at++];
                            return e.error.empty() ? c.self.observed(e).total : 1e3;
                          },
                          d, &call};
  const std::unique_ptr<gsl_multimin_fminimizer, void (*)(gsl_multimin_fminimizer*)> search(
      gsl_multimin_fminimizer_alloc(gsl_multimin_fminimizer_nmsimplex2, d), gsl_multimin_fminimizer_free);
  VectorXd start = VectorXd::Constant(static_cast<Index>(d), 0.5), step = VectorXd::Constant(static_cast<Index>(d), 0.25);
  gsl_vector_view from = gsl_vector_view_array(start.data(), d), size = gsl_vector_view_array(step.data(), d);
  if (gsl_multimin_fminimizer_set(search.get(), &f, &from.vector, &size.vector) == GSL_SUCCESS)
    for (int i = 0; i < 10000 && !call.missing; ++i) {
      if (gsl_multimin_fminimizer_iterate(search.get()) != GSL_SUCCESS) break;
      if (gsl_multimin_fminimizer_size(search.get()) < 1e-4) break;
    }
  wanted = call.wanted;
  return call.missing;
}

std::vector<Evaluation> GrainSearch::ask_surrogate(const std::vector<Evaluation>& done, int level, int left) const {
  const auto d = static_cast<Index>(parameters_.size());
  const auto there = static_cast<std::uint64_t>(done.size());
  std::vector<Evaluation> out;
  const auto add = [&](const VectorXd& u, const char* purpose) {
    Evaluation e;
    e.level = level;
    e.unit = u;
    e.purpose = purpose;
    out.push_back(e);
  };
  int here = 0;
  for (const Evaluation& e : done) here += e.level == level;
  const int budget = options_.evaluations[static_cast<std::size_t>(level)];
  // A third of the budget covers the ranges first (of a dearer bed: a third where the cheaper one's surrogate is likely,
  // the rest spread); the middle twice, for the scatter of beds.
  const int design = std::min(left, level == 0 ? std::max(2 * static_cast<int>(d) + 2, budget / 3) : std::max(4, budget / 3));
  if (here == 0 || good_of(done, level).size() < static_cast<std::size_t>(level == 0 ? 3 : 4)) {
    Random random = Random::stream(options_.seed, kDesign + there);
    const auto points = spread_points(static_cast<std::size_t>(here == 0 ? design : std::min(left, options_.batch)), d, random);
    std::vector<VectorXd> likely;
    if (level > 0 && here == 0) {
      const CurveSurrogate cheaper(targets_, done, level);
      const VectorXd start = recommended(cheaper, cheaper.levels() - 1);
      likely = posterior(cheaper, cheaper.levels() - 1, start, likely_factor(cheaper, cheaper.levels() - 1, start));
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!likely.empty() && i % 3 == 0) add(likely[random.below(likely.size())], "design");
      else if (here == 0 && level == 0 && i < 2 && points.size() >= 8) add(VectorXd::Constant(d, 0.5), "design");
      else add(points[i], "design");
    }
    return out;
  }
  const CurveSurrogate s(targets_, done, level + 1);
  Random random = Random::stream(options_.seed, kAsk + there);
  // The same normal deviates for every place, so that the improvement is a smooth function.
  constexpr int kSamples = 96;
  MatrixXd deviates(kSamples, s.components());
  Random draws = Random::stream(options_.seed, kDraws);
  for (int i = 0; i < kSamples; ++i)
    for (Index k = 0; k < deviates.cols(); ++k) deviates(i, k) = draws.normal();
  std::vector<VectorXd> places;
  for (const Evaluation* e : good_of(done, level)) places.push_back(e->unit);
  const int batch = std::min(left, options_.batch);
  const auto ask = [&](double weight, const char* purpose) {
    double incumbent = std::numeric_limits<double>::infinity();
    for (const VectorXd& u : places) incumbent = std::min(incumbent, s.misfit(u, level, weight).total);
    VectorXd m, v;
    const auto improvement = [&](const VectorXd& u) {
      s.predict(u, level, m, v);
      const VectorXd deviation = v.cwiseSqrt();
      double sum = 0.0;
      for (int i = 0; i < kSamples; ++i) {
        double shear = s.rest(false), plates = s.rest(true);
        for (Index k = 0; k < m.size(); ++k) {
          const double x = m[k] + deviation[k] * deviates(i, k) - s.target()[k];
          (k < s.split() ? shear : plates) += x * x;
        }
        sum += std::max(0.0, incumbent - weight * shear - (1.0 - weight) * plates);
      }
      double away = 1.0;  // from the others of this batch
      for (const Evaluation& e : out) away *= 1.0 - std::exp(-(u - e.unit).squaredNorm() / (0.02 * static_cast<double>(d)));
      return sum / kSamples * away;
    };
    std::vector<VectorXd> near;
    for (const VectorXd& p : places)
      for (int i = 0; i < 3; ++i) {
        VectorXd u = p;
        for (Index k = 0; k < d; ++k) u[k] = std::clamp(u[k] + 0.05 * random.normal(), 0.0, 1.0);
        near.push_back(u);
      }
    add(maximise(improvement, d, near, random), purpose);
  };
  const bool both = options_.shear_weight > 0.0 && options_.shear_weight < 1.0;
  for (int i = 0; i < batch; ++i) {
    if (i == 3 && batch > 3) add(recommended(s, level), "repeat");
    else if (i == 1 && both) ask(random.uniform(), "trade_off");
    else ask(options_.shear_weight, "improve");
  }
  return out;
}

std::vector<Evaluation> GrainSearch::next(const std::vector<Evaluation>& done) const {
  int failed = 0;
  std::string example;
  for (const Evaluation& e : done)
    if (!e.error.empty()) ++failed, example = e.error;
  if (done.size() >= 10 && 2 * failed > static_cast<int>(done.size()))
    throw RunError(fmt::format("{} of {} evaluations failed; the last one said: {}", failed, done.size(), example));
  int level = 0, before = 0;
  while (level < static_cast<int>(options_.evaluations.size()) && static_cast<int>(done.size()) >= before + options_.evaluations[static_cast<std::size_t>(level)])
    before += options_.evaluations[static_cast<std::size_t>(level++)];
  if (level == static_cast<int>(options_.evaluations.size())) return {};
  const bool last = level + 1 == static_cast<int>(options_.evaluations.size());
  const int all = before + options_.evaluations[static_cast<std::size_t>(level)] - static_cast<int>(done.size());
  const int left = all - (last ? options_.confirmations : 0);
  std::vector<Evaluation> out;
  if (left <= 0) {
    // Every confirmation at one place: that of the first of them.
    VectorXd place;
    for (const Evaluation& e : done)
      if (e.purpose == "confirm" && e.index >= total() - options_.confirmations) place = e.unit;
    if (place.size() == 0) place = result(done).best;
    out.resize(static_cast<std::size_t>(all));
    for (Evaluation& e : out) e.unit = place, e.purpose = "confirm", e.level = level;
  } else if (options_.method == SearchMethod::surrogate) {
    out = ask_surrogate(done, level, left);
  } else {
    const bool simplex = options_.method == SearchMethod::simplex;
    Random random = Random::stream(options_.seed, kAsk + done.size());
    out.resize(static_cast<std::size_t>(simplex ? 1 : std::min(left, options_.batch)));
    for (Evaluation& e : out) {
      e.unit = anywhere(static_cast<Index>(parameters_.size()), random);
      e.purpose = simplex ? "simplex" : "random";
      // A simplex that has come to rest has nothing more to ask: its best place is repeated.
      if (simplex && !ask_simplex(done, e.unit)) e.unit = done[static_cast<std::size_t>(std::max(0, best_observed(done, 0)))].unit, e.purpose = "repeat";
    }
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].index = static_cast<int>(done.size() + i);
    out[i].seed = options_.seed * 100000 + done.size() + i + 1;
  }
  return out;
}

double GrainSearch::likely_factor(const CurveSurrogate& s, int level, const VectorXd& start) const {
  Random random = Random::stream(options_.seed, kPosterior + 1);
  const VectorXd mode = maximise([&](const VectorXd& u) { return s.log_likelihood(u, level, 1.0); }, start.size(), {start}, random);
  return std::max(1.0, s.chi_squared(mode, level) / std::max(1.0, static_cast<double>(s.components() - start.size())));
}

std::vector<VectorXd> GrainSearch::posterior(const CurveSurrogate& s, int level, const VectorXd& start, double factor) const {
  const Index d = start.size();
  constexpr int kChains = 4, kSteps = 1500, kBurn = 500;
  std::vector<VectorXd> out;
  for (int chain = 0; chain < kChains; ++chain) {
    Random random = Random::stream(options_.seed, kPosterior + 10 + static_cast<std::uint64_t>(chain));
    VectorXd at = start;
    double here = s.log_likelihood(at, level, factor);
    // Chains begin at different places: the likeliest of some, and what was recommended.
    for (int i = 0; chain > 0 && i < 100; ++i) {
      const VectorXd u = anywhere(d, random);
      const double there = s.log_likelihood(u, level, factor);
      if (i == 0 || there > here) at = u, here = there;
    }
    VectorXd step = VectorXd::Constant(d, 0.15);
    for (int i = 0; i < kSteps; ++i) {
      // One parameter at a time, and all of them together.
      const Index which = static_cast<Index>(random.below(static_cast<std::size_t>(d) + 1));
      VectorXd u = at;
      bool inside = true;
      for (Index k = 0; k < d; ++k) {
        if (which < d && which != k) continue;
        u[k] += (which == d ? 0.5 : 1.0) * step[k] * random.normal();
        inside = inside && u[k] >= 0.0 && u[k] <= 1.0;
      }
      const double there = inside ? s.log_likelihood(u, level, factor) : 0.0;
      const bool accept = inside && std::log(std::max(1e-300, random.uniform())) < there - here;
      if (accept) at = u, here = there;
      if (i < kBurn && which < d) step[which] = std::clamp(step[which] * (accept ? 1.1 : 0.93), 0.005, 0.6);
      if (i >= kBurn && i % 4 == 0) out.push_back(at);
    }
  }
  return out;
}

SearchResult GrainSearch::result(const std::vector<Evaluation>& done) const {
  SearchResult out;
  out.confidence = options_.confidence;
  std::vector<Evaluation> finished;
  int level = 0;
  for (const Evaluation& e : done) {
    if (!e.done()) continue;
    finished.push_back(e);
    out.failed += !e.error.empty();
    double best = out.best_so_far.empty() ? std::numeric_limits<double>::quiet_NaN() : out.best_so_far.back();
    if (e.error.empty()) {
      if (e.level != level) best = std::numeric_limits<double>::quiet_NaN();  // another bed: begun anew
      level = e.level;
      if (e.purpose != "confirm") best = std::fmin(best, observed(e).total);
    }
    out.best_so_far.push_back(best);
  }
  const int first_best = best_observed(finished, level);
  if (first_best < 0) throw RunError("no evaluation has succeeded");
  out.best = finished[static_cast<std::size_t>(first_best)].unit;
  out.observed = observed(finished[static_cast<std::size_t>(first_best)]);
  std::vector<const Evaluation*> confirmations;
  // Of a search that was carried on there are earlier ones at other places.
  for (auto e = finished.rbegin(); e != finished.rend() && e->purpose == "confirm"; ++e)
    if (e->error.empty()) confirmations.push_back(&*e);

  const auto d = static_cast<Index>(parameters_.size());
  std::unique_ptr<CurveSurrogate> s;
  if (options_.method == SearchMethod::surrogate && good_of(finished, 0).size() >= 3) {
    s = std::make_unique<CurveSurrogate>(targets_, finished, level + 1);
    const int top = s->levels() - 1;
    out.best = recommended(*s, top);
    if (!confirmations.empty()) out.best = confirmations.front()->unit;
    out.expected = s->misfit(out.best, top, options_.shear_weight);
    out.shear_bed_scatter = s->bed_scatter(top, "direct_shear");
    out.plate_bed_scatter = s->bed_scatter(top, "pressure_sinkage");
    double square = 0.0;
    const std::vector<double> loo = s->leave_one_out(top);
    for (const double r : loo) square += r * r;
    out.leave_one_out = std::sqrt(square / static_cast<double>(loo.size()));
    out.scatter_factor = likely_factor(*s, top, out.best);
    out.sample = posterior(*s, top, out.best, out.scatter_factor);
    // The front: places that no other one beats in both tests.
    if (options_.shear_weight > 0.0 && options_.shear_weight < 1.0) {
      Random random = Random::stream(options_.seed, kFront);
      std::vector<FrontPoint> places;
      const auto offer = [&](const VectorXd& u) { places.push_back({u, s->misfit(u, top, options_.shear_weight)}); };
      for (const double w : {0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.98})
        offer(maximise([&](const VectorXd& u) { return -s->misfit(u, top, w).total; }, d, {out.best}, random));
      for (int i = 0; i < 1500; ++i) offer(anywhere(d, random));
      for (std::size_t i = 0; i < out.sample.size(); i += 4) offer(out.sample[i]);
      std::sort(places.begin(), places.end(), [](const FrontPoint& a, const FrontPoint& b) { return a.misfit.shear < b.misfit.shear; });
      double least = std::numeric_limits<double>::infinity();
      for (const FrontPoint& p : places)
        if (p.misfit.plates < least) least = p.misfit.plates, out.front.push_back(p);
    }
  } else if (!confirmations.empty()) {
    out.best = confirmations.front()->unit;
  }
  out.values = values(out.best);

  if (!confirmations.empty()) {
    out.confirmations = static_cast<int>(confirmations.size());
    const double n = out.confirmations;
    for (std::size_t t = 0; t < targets_.size(); ++t) {
      const std::size_t points = targets_[t].at.size();
      std::vector<double> mean(points, 0.0), deviation(points, 0.0);
      for (const Evaluation* e : confirmations)
        for (std::size_t i = 0; i < points; ++i) mean[i] += e->curves[t][i] / n;
      for (const Evaluation* e : confirmations)
        for (std::size_t i = 0; i < points; ++i) deviation[i] += std::pow(e->curves[t][i] - mean[i], 2) / std::max(1.0, n - 1.0);
      double sum = 0.0, pooled = 0.0;
      for (std::size_t i = 0; i < points; ++i) pooled += deviation[i] / static_cast<double>(points);
      for (std::size_t i = 0; i < points; ++i) {
        const double m = targets_[t].measured[i], tilt = m * (2.0 * targets_[t].at[i] / targets_[t].at.back() - 1.0);
        const double variance = 0.5 * (deviation[i] + pooled) / n + std::pow(targets_[t].level_deviation * m, 2) + std::pow(targets_[t].tilt_deviation * tilt, 2);
        sum += std::pow(mean[i] - m, 2) / variance;
        deviation[i] = std::sqrt(deviation[i]);
      }
      out.standardised.push_back(std::sqrt(sum / static_cast<double>(points)));
      out.confirmed.push_back(mean);
      out.confirmed_deviation.push_back(deviation);
    }
    out.observed = observed(out.confirmed);
  }

  for (Index i = 0; i < d; ++i) {
    const GrainParameter& p = parameters_[static_cast<std::size_t>(i)];
    Estimate e;
    e.name = p.name;
    e.unit = p.unit;
    e.coordinate = p.log ? Coordinate::log : Coordinate::value;
    e.value = p.from_unit(out.best[i]);
    e.low = p.low, e.high = p.high;
    e.identified = false;
    out.estimates.push_back(e);
  }
  MatrixXd covariance = MatrixXd::Zero(d, d);
  if (!out.sample.empty()) {
    VectorXd mean = VectorXd::Zero(d), scale(d);
    for (const VectorXd& u : out.sample) mean += u / static_cast<double>(out.sample.size());
    for (const VectorXd& u : out.sample) covariance += (u - mean) * (u - mean).transpose() / static_cast<double>(out.sample.size());
    for (Index i = 0; i < d; ++i) {
      const GrainParameter& p = parameters_[static_cast<std::size_t>(i)];
      scale[i] = p.log ? std::log(p.high / p.low) : p.high - p.low;
      std::vector<double> values;
      for (const VectorXd& u : out.sample) values.push_back(u[i]);
      std::sort(values.begin(), values.end());
      const auto quantile = [&](double q) { return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))]; };
      const double low = quantile(0.5 - 0.5 * options_.confidence), high = quantile(0.5 + 0.5 * options_.confidence);
      Estimate& e = out.estimates[static_cast<std::size_t>(i)];
      e.low = p.from_unit(low);
      e.high = p.from_unit(high);
      // The range alone would give an interval of `confidence` of it.
      const double share = (high - low) / options_.confidence;
      e.identified = share < 0.75;
      if (share >= 0.5)
        out.warnings.push_back({e.identified ? "weakly_identified" : "not_identified", p.name,
                                fmt::format("these tests leave {} anywhere from {:.3g} to {:.3g} {} ({:.0f} percent of the range searched)", p.name, e.low, e.high, p.unit, 100 * share), remedy_of(p.name)});
      if ((low < 0.01 || high > 0.99) && share < 0.5)
        out.warnings.push_back({"at_bound", p.name, fmt::format("{} is likeliest at an end of the range searched ({:.3g} to {:.3g} {})", p.name, p.low, p.high, p.unit), "widen the range (--range)"});
    }
    covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
    for (Index a = 0; a < d; ++a)
      for (Index b = a + 1; b < d; ++b) {
        const double r = covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b) + 1e-300);
        if (std::abs(r) > 0.8)
          out.warnings.push_back({"weakly_identified", parameters_[static_cast<std::size_t>(a)].name,
                                  fmt::format("{} and {} are known only together (correlation {:.2f})", parameters_[static_cast<std::size_t>(a)].name, parameters_[static_cast<std::size_t>(b)].name, r),
                                  remedy_of(parameters_[static_cast<std::size_t>(b)].name)});
      }
    if (out.scatter_factor > 3.0)
      out.warnings.push_back({"model_misfit", "", fmt::format("no parameters in these ranges match the measured curves within their scatter (by a factor of {:.1f}); the intervals are widened by it", std::sqrt(out.scatter_factor)),
                              "finer grains, wider ranges, or another law of contact"});
    if (out.leave_one_out > 1.6)
      out.warnings.push_back({"surrogate", "", fmt::format("the surrogate errs by {:.1f} times what it states (leave-one-out)", out.leave_one_out), "more evaluations"});
  }
  set_covariance(out, covariance);
  out.degrees_of_freedom = std::max(1.0, static_cast<double>(finished.size()) - static_cast<double>(d));
  return out;
}

}  // namespace terrode::calibration
