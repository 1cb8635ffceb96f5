// Nonlinear least squares for a handful of parameters (Levenberg-Marquardt of GSL), with the Jacobian that covariances
// are made of.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <utility>

namespace terrode::calibration {

// Writes the residuals at x and returns true; false where the model cannot be evaluated there (the step is refused).
using ResidualFunction = std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& residuals)>;

struct LeastSquaresOptions {
  int max_iterations = 200;
  double tolerance = 1e-9;       // relative, of the step
  double difference_step = 1e-6; // of the Jacobian, relative to max(|x|, 1)
};

struct LeastSquaresResult {
  Eigen::VectorXd x;
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;      // d residual / d x at x, by central differences
  double sum_of_squares = 0.0;
  bool converged = false;
  int iterations = 0;
};

// Minimises the sum of squares of `count` residuals from `start` (Levenberg-Marquardt with Marquardt's scaling, Moré
// 1978; GSL's gsl_multifit_nlinear). Parameters should be scaled to order 1 (logarithms do that).
// Throws InputError for fewer residuals than parameters and RunError where the model cannot be evaluated at `start`.
LeastSquaresResult least_squares(const ResidualFunction& function, Eigen::Index count, const Eigen::VectorXd& start,
                                 const LeastSquaresOptions& options = {});

// d residual / d x by central differences, one-sided next to points where the model cannot be evaluated; false where
// neither side can.
bool difference_jacobian(const ResidualFunction& function, Eigen::Index count, const Eigen::VectorXd& x, double step,
                         Eigen::MatrixXd& jacobian);

// Where the square root of the risen sum of squares, sqrt((S(x_i) - S_min) factor), reaches t on either side of the
// solution, the other parameters minimised anew: a profile interval of x[index]. `standard_error` of x[index] sets the
// scale of the search; an end more than 16 t of it away is given there.
std::pair<double, double> profile_interval(const ResidualFunction& function, const LeastSquaresResult& best, Eigen::Index index,
                                           double standard_error, double t, double factor = 1.0,
                                           const LeastSquaresOptions& options = {});

// Inverse of a symmetric positive semidefinite matrix; directions with eigenvalues below `relative` of the largest
// (after scaling the diagonal to 1) are given that eigenvalue, so that what is not identified gets a huge variance, not
// a NaN.
Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& matrix, double relative = 1e-12);

}  // namespace terrode::calibration
