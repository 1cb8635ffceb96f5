// Gaussian process regression of one noisy quantity over a handful of parameters in the unit cube.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

namespace terrode::calibration {

// y = h(x)' beta + f(x) + noise, f with covariance v M(r), r^2 = sum (dx_i / l_i)^2 and
//   M(r) = (1 + sqrt(5) r + 5 r^2/3) exp(-sqrt(5) r)                              (Matern, nu = 5/2)
// (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, Eqs. 2.41 to 2.45 for the trend, 4.17). The
// coefficients beta of the trend (a constant; with a cheaper model's prediction as second column the second level of
// Kennedy & O'Hagan 2000) have a flat prior. v, l and the noise's variance are those of the largest marginal likelihood
// times weak priors: ln l normal about ln 0.7 with deviation 0.8, ln(noise/variance of y) normal about ln 0.03 with
// deviation 2.
class GaussianProcess {
 public:
  struct Prediction {
    double mean = 0.0;
    double variance = 0.0;  // of the mean function h' beta + f, without noise
  };

  // x: one row for each observation, in the unit cube; y: observations; trend: their cheaper predictions, or empty.
  // Throws InputError for fewer than 3 observations or sizes that differ.
  void fit(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const Eigen::VectorXd& trend = {});
  // At one point; `trend` is the cheaper prediction there (not used without one in the fit).
  Prediction predict(const Eigen::VectorXd& x, double trend = 0.0) const;
  // Standardised residual of each observation predicted from all others (Rasmussen & Williams Eq. 5.12), noise included:
  // about normal where the model is right.
  Eigen::VectorXd leave_one_out() const;

  double noise_variance() const;            // of one observation, in units of y squared
  double signal_variance() const;
  const Eigen::VectorXd& lengths() const { return lengths_; }
  double log_likelihood() const { return log_likelihood_; }

 private:
  double evaluate(const Eigen::VectorXd& theta);  // sets the factors; returns -ln(posterior density of theta)
  Eigen::MatrixXd x_, h_;
  Eigen::VectorXd y_;                       // scaled: mean 0, deviation 1
  double centre_ = 0.0, scale_ = 1.0, trend_centre_ = 0.0, trend_scale_ = 1.0;
  Eigen::VectorXd lengths_;
  double signal_ = 1.0, noise_ = 0.1;       // scaled
  Eigen::LLT<Eigen::MatrixXd> k_, a_;       // of K, and of H' K^-1 H
  Eigen::VectorXd beta_, alpha_;
  Eigen::MatrixXd k_inverse_h_;
  double log_likelihood_ = 0.0;
};

}  // namespace terrode::calibration
