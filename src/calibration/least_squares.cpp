#include "calibration/least_squares.h"

#include <fmt/format.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "core/linear_algebra.h"
#include "core/problem.h"

namespace terrode::calibration {
namespace {

// Residual of a point that cannot be evaluated: large enough that the step there is refused.
constexpr double kRefused = 1e100;

struct Call {
  const ResidualFunction& function;
  double step;
  Eigen::VectorXd x, r;
  Eigen::MatrixXd jacobian;
};

bool evaluate(const ResidualFunction& function, const Eigen::VectorXd& x, Eigen::VectorXd& r) {
  return x.allFinite() && function(x, r) && r.allFinite();
}

int gsl_residuals(const gsl_vector* x, void* data, gsl_vector* out) {
  Call& call = *static_cast<Call*>(data);
  for (Eigen::Index i = 0; i < call.x.size(); ++i) call.x[i] = gsl_vector_get(x, static_cast<std::size_t>(i));
  const bool ok = evaluate(call.function, call.x, call.r);
  for (std::size_t i = 0; i < out->size; ++i)
    gsl_vector_set(out, i, ok ? call.r[static_cast<Eigen::Index>(i)] : kRefused / std::sqrt(static_cast<double>(out->size)));
  return GSL_SUCCESS;
}

int gsl_jacobian(const gsl_vector* x, void* data, gsl_matrix* out) {
  Call& call = *static_cast<Call*>(data);
  Eigen::VectorXd at(call.x.size());
  for (Eigen::Index i = 0; i < at.size(); ++i) at[i] = gsl_vector_get(x, static_cast<std::size_t>(i));
  if (!difference_jacobian(call.function, call.r.size(), at, call.step, call.jacobian)) call.jacobian.setZero();
  for (std::size_t i = 0; i < out->size1; ++i)
    for (std::size_t j = 0; j < out->size2; ++j)
      gsl_matrix_set(out, i, j, call.jacobian(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
  return GSL_SUCCESS;
}

}  // namespace

bool difference_jacobian(const ResidualFunction& function, Eigen::Index count, const Eigen::VectorXd& x, double step,
                         Eigen::MatrixXd& jacobian) {
  jacobian.setZero(count, x.size());
  Eigen::VectorXd centre(count), up(count), down(count);
  bool have_centre = false;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    const double h = step * std::max(1.0, std::abs(x[j]));
    Eigen::VectorXd moved = x;
    moved[j] = x[j] + h;
    const bool up_ok = evaluate(function, moved, up);
    moved[j] = x[j] - h;
    const bool down_ok = evaluate(function, moved, down);
    if (up_ok && down_ok) {
      jacobian.col(j) = (up - down) / (2 * h);
      continue;
    }
    if (!have_centre) have_centre = evaluate(function, x, centre);
    if (!have_centre || (!up_ok && !down_ok)) return false;
    if (up_ok) jacobian.col(j) = (up - centre) / h;
    else jacobian.col(j) = (centre - down) / h;
  }
  return true;
}

LeastSquaresResult least_squares(const ResidualFunction& function, Eigen::Index count, const Eigen::VectorXd& start,
                                 const LeastSquaresOptions& options) {
  if (count < start.size())
    throw InputError(fmt::format("a fit of {} parameters needs at least as many values, and has {}", start.size(), count));
  LeastSquaresResult out;
  Call call{function, options.difference_step, start, Eigen::VectorXd(count), {}};
  if (!evaluate(function, start, call.r)) throw RunError("least squares: the model cannot be evaluated at the starting point");
  static const bool quiet = (gsl_set_error_handler_off(), true);  // GSL would end the program; results are checked here
  static_cast<void>(quiet);
  gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters();
  parameters.scale = gsl_multifit_nlinear_scale_more;
  const auto n = static_cast<std::size_t>(count), p = static_cast<std::size_t>(start.size());
  const std::unique_ptr<gsl_multifit_nlinear_workspace, void (*)(gsl_multifit_nlinear_workspace*)> work(
      gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &parameters, n, p), gsl_multifit_nlinear_free);
  gsl_multifit_nlinear_fdf fdf{};
  fdf.f = gsl_residuals;
  fdf.df = gsl_jacobian;
  fdf.n = n;
  fdf.p = p;
  fdf.params = &call;
  Eigen::VectorXd first = start;
  gsl_vector_view view = gsl_vector_view_array(first.data(), p);
  gsl_multifit_nlinear_init(&view.vector, &fdf, work.get());
  int info = 0;
  const int status = gsl_multifit_nlinear_driver(static_cast<std::size_t>(options.max_iterations), options.tolerance,
                                                 options.tolerance, 0.0, nullptr, nullptr, &info, work.get());
  out.iterations = static_cast<int>(gsl_multifit_nlinear_niter(work.get()));
  // Out of steps, or none that gains: at rest where a full step would no longer change the sum of squares (below).
  const gsl_vector* best = gsl_multifit_nlinear_position(work.get());
  out.x = start;
  for (Eigen::Index i = 0; i < start.size(); ++i) out.x[i] = gsl_vector_get(best, static_cast<std::size_t>(i));
  out.residuals.resize(count);
  if (!evaluate(function, out.x, out.residuals)) throw RunError("least squares: the model cannot be evaluated at the solution");
  out.sum_of_squares = out.residuals.squaredNorm();
  if (difference_jacobian(function, count, out.x, options.difference_step, out.jacobian)) {
    const Eigen::VectorXd gradient = out.jacobian.transpose() * out.residuals;
    const double gain = gradient.dot(inverse_of_symmetric(out.jacobian.transpose() * out.jacobian) * gradient);
    out.converged = status == GSL_SUCCESS || gain <= 1e-4 * out.sum_of_squares;
  }
  return out;
}

namespace {

// Smallest sum of squares with parameter `index` held at `value`; infinity where the model cannot be evaluated.
double profile_sum(const ResidualFunction& function, Eigen::Index count, Eigen::Index index, double value, const LeastSquaresOptions& options,
                   Eigen::VectorXd& at) {
  const Eigen::Index p = at.size();
  Eigen::VectorXd full = at, rest(p - 1);
  full[index] = value;
  for (Eigen::Index i = 0, k = 0; i < p; ++i)
    if (i != index) rest[k++] = at[i];
  const auto compose = [&](const Eigen::VectorXd& x) {
    for (Eigen::Index i = 0, k = 0; i < p; ++i)
      if (i != index) full[i] = x[k++];
  };
  const ResidualFunction held = [&](const Eigen::VectorXd& x, Eigen::VectorXd& r) {
    compose(x);
    return function(full, r);
  };
  Eigen::VectorXd r(count);
  if (!evaluate(function, full, r)) return std::numeric_limits<double>::infinity();
  if (p == 1) return r.squaredNorm();
  if (!evaluate(held, rest, r)) return std::numeric_limits<double>::infinity();
  const LeastSquaresResult fit = least_squares(held, count, rest, options);
  compose(fit.x);
  at = full;
  return fit.sum_of_squares;
}

}  // namespace

std::pair<double, double> profile_interval(const ResidualFunction& function, const LeastSquaresResult& best, Eigen::Index index,
                                           double standard_error, double t, double factor, const LeastSquaresOptions& options) {
  LeastSquaresOptions coarse = options;
  coarse.tolerance = std::max(options.tolerance, 1e-7);
  const auto end = [&](double sign) {
    Eigen::VectorXd at = best.x;
    // The root of the profile is nearly straight, so that scaling the step finds its end in a few evaluations.
    double steps = t, inside = 0.0, outside = 16.0 * t;
    for (int i = 0; i < 12; ++i) {
      const double sum = profile_sum(function, best.residuals.size(), index, best.x[index] + sign * steps * standard_error, coarse, at);
      const double reached = std::sqrt(std::max(0.0, (sum - best.sum_of_squares) * factor));
      if (std::abs(reached - t) < 5e-3 * t) break;
      (reached < t ? inside : outside) = steps;
      if (outside - inside < 1e-3 * outside) break;
      double next = std::isfinite(reached) && reached > 0 ? steps * std::clamp(t / reached, 0.3, 3.0) : 0.5 * (inside + outside);
      if (next <= inside || next >= outside) next = 0.5 * (inside + outside);
      steps = next;
    }
    return best.x[index] + sign * steps * standard_error;
  };
  return {end(-1.0), end(1.0)};
}

Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& matrix, double relative) {
  const Eigen::Index n = matrix.rows();
  Eigen::VectorXd scale(n);
  for (Eigen::Index i = 0; i < n; ++i) scale[i] = matrix(i, i) > 0 ? 1.0 / std::sqrt(matrix(i, i)) : 1.0;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(0.5 * (scaled + scaled.transpose()));
  const double floor = relative * std::max(1e-300, eigen.values.maxCoeff());
  const Eigen::VectorXd inverse = eigen.values.cwiseMax(floor).cwiseInverse();
  return scale.asDiagonal() * (eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose()) * scale.asDiagonal();
}

}  // namespace terrode::calibration
