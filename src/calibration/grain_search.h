// A search for grain parameters whose simulated soil tests match measured ones, in few evaluations.
//
// Surrogate. The curves of each test, relative to the measured stress (target_vector), are written in their principal
// components, and each component is a Gaussian process over the free parameters (Higdon et al., J. Am. Stat. Assoc.
// 103(482), 2008). The misfit of a test, the mean square of the relative difference, is then a sum of squares of
// Gaussian processes; its expected improvement is found by sampling (Astudillo & Frazier, Bayesian optimization of
// composite functions, ICML 2019). Every evaluation has a seed of its own: what grains scatter by from bed to bed is the
// processes' noise, the incumbent is the smallest expected misfit of the mean curve, not the luckiest bed, and the best
// place so far is visited again. A dearer bed takes the cheaper one's prediction as its trend (Kennedy & O'Hagan,
// Biometrika 87(1), 2000).
//
// How sure. The parameters' distribution given the measured curves, uniform over the ranges beforehand, is sampled by
// Metropolis' method; the covariance holds the measured curves' scatter, enlarged where the best misfit exceeds it, and
// what the surrogate does not know. The scatter is known from a few repeats, hence Student's t in place of the normal law.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "calibration/dem_tests.h"
#include "calibration/estimate.h"
#include "calibration/gaussian_process.h"

namespace terrode::calibration {

enum class SearchMethod { surrogate, random, simplex };

struct FreeParameter {
  std::string name;
  double low = 0.0, high = 0.0;   // range; equal: the parameter's own
};

struct SearchOptions {
  std::vector<FreeParameter> free = {{"young_modulus"}, {"friction"}, {"rolling_friction"}};
  std::vector<int> evaluations = {40};   // of each bed, cheap to dear
  int batch = 4;                         // asked for at a time (surrogate and random)
  int confirmations = 4;                 // the last of them: the place found, with new seeds
  double shear_weight = 0.5;             // of the shear tests in the misfit; the plates have the rest
  SearchMethod method = SearchMethod::surrogate;
  std::uint64_t seed = 1;
  double confidence = 0.95;

  Problems validate() const;
};

// One simulation of all tests with one bed.
struct Evaluation {
  int index = 0;
  int level = 0;                         // which bed
  std::string purpose;                   // design, improve, trade_off, repeat, random, simplex, confirm
  Eigen::VectorXd unit;                  // free parameters on the unit cube
  std::uint64_t seed = 1;                // of its beds
  std::vector<std::vector<double>> curves;  // Pa, one for each target; empty while it is not done, or where it failed
  std::string error;
  double seconds = 0.0;                  // processor time
  bool done() const { return !curves.empty() || !error.empty(); }
};

struct Misfit {
  double shear = 0.0, plates = 0.0;      // relative mean squares
  double total = 0.0;                    // weighted
};

// Surrogate of the curves over the free parameters, at one bed or several.
class CurveSurrogate {
 public:
  // Throws InputError with fewer than 3 evaluations of the first bed. Dearer beds with fewer are left out.
  CurveSurrogate(const std::vector<TestTarget>& targets, const std::vector<Evaluation>& done, int levels);

  int levels() const { return static_cast<int>(processes_.size()); }
  Eigen::Index components() const { return target_.size(); }
  // Mean and variance of the mean curve's components at a point.
  void predict(const Eigen::VectorXd& unit, int level, Eigen::VectorXd& mean, Eigen::VectorXd& variance) const;
  // Expected misfit of the mean curve.
  Misfit misfit(const Eigen::VectorXd& unit, int level, double shear_weight) const;
  // Mean curve [Pa] of every target.
  std::vector<std::vector<double>> curves(const Eigen::VectorXd& unit, int level) const;
  // ln of the density of the measured components at a point, their covariance enlarged by `factor`.
  double log_likelihood(const Eigen::VectorXd& unit, int level, double factor) const;
  double chi_squared(const Eigen::VectorXd& unit, int level) const;
  // Deviation from bed to bed of each test's misfit root (relative stress), from the processes' noise.
  double bed_scatter(int level, const std::string& test) const;
  // Standardised leave-one-out residuals of all processes of a bed.
  std::vector<double> leave_one_out(int level) const;
  // First component of the plates: those before are the shear tests'.
  Eigen::Index split() const { return split_; }
  const Eigen::VectorXd& target() const { return target_; }
  double rest(bool plates) const { return rest_[plates ? 1 : 0]; }

 private:
  std::vector<TestTarget> targets_;
  Eigen::MatrixXd basis_;                // orthonormal columns, one for each component
  Eigen::VectorXd mean_;                 // of the curves, in the form of target_vector
  Eigen::VectorXd target_;               // measured components
  Eigen::MatrixXd covariance_;           // of the measured components
  double freedom_ = 0.0;                 // degrees of freedom in which it is known, mean over the tests
  Eigen::Index split_ = 0;
  double rest_[2] = {0.0, 0.0};          // of the measured curves that no component reaches
  std::vector<std::vector<GaussianProcess>> processes_;  // by bed and component
};

struct FrontPoint {
  Eigen::VectorXd unit;
  Misfit misfit;
};

struct SearchResult : Fit {                // estimates: of the free parameters, with intervals
  Eigen::VectorXd best;                    // recommended, on the unit cube
  GrainValues values;
  Misfit observed;                         // of the mean of the confirmations (of the best evaluation without any)
  Misfit expected;                         // by the surrogate
  int confirmations = 0;
  // Root mean square over all points of (mean of the confirmations - measured)/standard error of that difference, by
  // target; about 1 where they agree within their scatter.
  std::vector<double> standardised;
  std::vector<std::vector<double>> confirmed, confirmed_deviation;  // Pa: mean curves, and their deviation between beds
  std::vector<double> best_so_far;         // observed total misfit after each evaluation
  std::vector<FrontPoint> front;           // by the surrogate: no other place is better in both tests
  double scatter_factor = 1.0;             // by which the measured covariance was enlarged
  double shear_bed_scatter = 0.0, plate_bed_scatter = 0.0;  // relative, from bed to bed
  std::vector<Eigen::VectorXd> sample;     // of the parameters' distribution
  double leave_one_out = 0.0;              // root mean square of the standardised residuals
  int failed = 0;
};

class GrainSearch {
 public:
  GrainSearch(std::vector<TestTarget> targets, SearchOptions options);
  // The next evaluations, in batches; empty at the end. All of `done` are done, in the order of their index. The same
  // `done` gives the same answer. Throws RunError when more than half of ten or more evaluations failed.
  std::vector<Evaluation> next(const std::vector<Evaluation>& done) const;
  // What is known so far. Intervals, front and surrogate only with the method `surrogate`. Throws RunError when nothing
  // succeeded.
  SearchResult result(const std::vector<Evaluation>& done) const;

  GrainValues values(const Eigen::VectorXd& unit) const;
  Misfit observed(const Evaluation& evaluation) const;
  Misfit observed(const std::vector<std::vector<double>>& curves) const;
  const std::vector<TestTarget>& targets() const { return targets_; }
  const std::vector<GrainParameter>& parameters() const { return parameters_; }
  const SearchOptions& options() const { return options_; }
  int total() const;

 private:
  std::vector<Evaluation> ask_surrogate(const std::vector<Evaluation>& done, int level, int left) const;
  bool ask_simplex(const std::vector<Evaluation>& done, Eigen::VectorXd& wanted) const;
  Eigen::VectorXd recommended(const CurveSurrogate& surrogate, int level) const;
  int best_observed(const std::vector<Evaluation>& done, int level) const;
  double likely_factor(const CurveSurrogate& surrogate, int level, const Eigen::VectorXd& start) const;
  std::vector<Eigen::VectorXd> posterior(const CurveSurrogate& surrogate, int level, const Eigen::VectorXd& start, double factor) const;

  std::vector<TestTarget> targets_;
  SearchOptions options_;
  std::vector<GrainParameter> parameters_;  // the free ones, with their ranges
};

}  // namespace terrode::calibration
