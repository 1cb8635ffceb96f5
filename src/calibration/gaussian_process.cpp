#include "calibration/gaussian_process.h"

#include <fmt/format.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multimin.h>

#include <cmath>
#include <limits>
#include <memory>

#include "core/problem.h"

namespace terrode::calibration {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double matern(double r) {
  const double s = std::sqrt(5.0) * r;
  return (1.0 + s + s * s / 3.0) * std::exp(-s);
}

double square(double x) { return x * x; }

}  // namespace

double GaussianProcess::evaluate(const VectorXd& theta) {
  const Index d = x_.cols(), n = x_.rows();
  if (theta.cwiseAbs().maxCoeff() > 12.0) return std::numeric_limits<double>::infinity();
  signal_ = std::exp(theta[0]);
  noise_ = std::exp(theta[1]);
  lengths_ = theta.tail(d).array().exp();
  MatrixXd k(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < i; ++j) {
      const double r = (x_.row(i) - x_.row(j)).transpose().cwiseQuotient(lengths_).norm();
      k(i, j) = k(j, i) = signal_ * matern(r);
    }
    k(i, i) = signal_ * (1.0 + 1e-9) + noise_;
  }
  k_.compute(k);
  if (k_.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  k_inverse_h_ = k_.solve(h_);
  a_.compute(h_.transpose() * k_inverse_h_);
  if (a_.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  beta_ = a_.solve(k_inverse_h_.transpose() * y_);
  alpha_ = k_.solve(y_ - h_ * beta_);
  const double fit = (y_ - h_ * beta_).dot(alpha_);
  double log_det = 0.0;
  for (Index i = 0; i < n; ++i) log_det += 2.0 * std::log(k_.matrixLLT()(i, i));
  for (Index i = 0; i < h_.cols(); ++i) log_det += 2.0 * std::log(a_.matrixLLT()(i, i));
  log_likelihood_ = -0.5 * (fit + log_det + static_cast<double>(n - h_.cols()) * std::log(2.0 * M_PI));
  double prior = square((theta[1] - std::log(0.03)) / 2.0) + square(theta[0] / 2.0);
  for (Index i = 0; i < d; ++i) prior += square((theta[2 + i] - std::log(0.7)) / 0.8);
  return -log_likelihood_ + 0.5 * prior;
}

void GaussianProcess::fit(const MatrixXd& x, const VectorXd& y, const VectorXd& trend) {
  const Index n = x.rows(), d = x.cols();
  if (n < 3 || y.size() != n || d < 1 || (trend.size() != 0 && trend.size() != n))
    throw InputError(fmt::format("a Gaussian process needs at least 3 observations, as many values as points; it has {} points and {} values", n, y.size()));
  if (!x.allFinite() || !y.allFinite() || !trend.allFinite()) throw InputError("a Gaussian process needs finite values");
  x_ = x;
  centre_ = y.mean();
  scale_ = std::max(1e-12 * (std::abs(centre_) + 1e-300), std::sqrt((y.array() - centre_).square().mean()));
  y_ = (y.array() - centre_) / scale_;
  h_ = MatrixXd::Ones(n, 1);
  if (trend.size() > 0) {
    trend_centre_ = trend.mean();
    trend_scale_ = std::sqrt((trend.array() - trend_centre_).square().mean());
    if (trend_scale_ > 1e-9 * (std::abs(trend_centre_) + 1e-300) && n > 3) {
      h_.conservativeResize(n, 2);
      h_.col(1) = (trend.array() - trend_centre_) / trend_scale_;
    }
  }
  static const bool quiet = (gsl_set_error_handler_off(), true);
  static_cast<void>(quiet);
  // Simplex search of the hyperparameters from a few places (Nelder & Mead; GSL).
  const auto p = static_cast<std::size_t>(d + 2);
  struct Call {
    GaussianProcess* self;
    VectorXd theta;
  } call{this, VectorXd(d + 2)};
  gsl_multimin_function f{[](const gsl_vector* at, void* data) {
                            Call& c = *static_cast<Call*>(data);
                            for (Index i = 0; i < c.theta.size(); ++i) c.theta[i] = gsl_vector_get(at, static_cast<std::size_t>(i));
                            const double value = c.self->evaluate(c.theta);
                            return std::isfinite(value) ? value : 1e10;
                          },
                          p, &call};
  const std::unique_ptr<gsl_multimin_fminimizer, void (*)(gsl_multimin_fminimizer*)> search(
      gsl_multimin_fminimizer_alloc(gsl_multimin_fminimizer_nmsimplex2, p), gsl_multimin_fminimizer_free);
  VectorXd best(d + 2), step = VectorXd::Constant(d + 2, 0.7);
  double best_value = std::numeric_limits<double>::infinity();
  for (const auto& [noise, length] : {std::pair{0.03, 0.7}, std::pair{0.3, 0.4}}) {
    VectorXd start = VectorXd::Constant(d + 2, std::log(length));
    start[0] = 0.0;
    start[1] = std::log(noise);
    gsl_vector_view from = gsl_vector_view_array(start.data(), p), size = gsl_vector_view_array(step.data(), p);
    if (gsl_multimin_fminimizer_set(search.get(), &f, &from.vector, &size.vector) != GSL_SUCCESS) continue;
    for (int i = 0; i < 60 * static_cast<int>(p) && gsl_multimin_fminimizer_iterate(search.get()) == GSL_SUCCESS; ++i)
      if (gsl_multimin_fminimizer_size(search.get()) < 1e-2) break;
    if (search->fval < best_value) {
      best_value = search->fval;
      for (Index i = 0; i < best.size(); ++i) best[i] = gsl_vector_get(search->x, static_cast<std::size_t>(i));
    }
  }
  if (!std::isfinite(best_value) || !std::isfinite(evaluate(best))) throw RunError("Gaussian process: no hyperparameters fit the observations");
}

GaussianProcess::Prediction GaussianProcess::predict(const VectorXd& x, double trend) const {
  const Index n = x_.rows();
  VectorXd k(n);
  for (Index i = 0; i < n; ++i) k[i] = signal_ * matern((x_.row(i).transpose() - x).cwiseQuotient(lengths_).norm());
  VectorXd h = VectorXd::Ones(h_.cols());
  if (h.size() > 1) h[1] = (trend - trend_centre_) / trend_scale_;
  const VectorXd u = k_.matrixL().solve(k);
  const VectorXd r = h - k_inverse_h_.transpose() * k;
  const double variance = signal_ - u.squaredNorm() + r.dot(a_.solve(r));
  return {centre_ + scale_ * (h.dot(beta_) + k.dot(alpha_)), scale_ * scale_ * std::max(0.0, variance)};
}

VectorXd GaussianProcess::leave_one_out() const {
  const Index n = x_.rows();
  const MatrixXd inverse = k_.solve(MatrixXd::Identity(n, n)) - k_inverse_h_ * a_.solve(k_inverse_h_.transpose());
  VectorXd out(n);
  for (Index i = 0; i < n; ++i) out[i] = alpha_[i] / std::sqrt(std::max(1e-300, inverse(i, i)));
  return out;
}

double GaussianProcess::noise_variance() const { return noise_ * scale_ * scale_; }
double GaussianProcess::signal_variance() const { return signal_ * scale_ * scale_; }

}  // namespace terrode::calibration
