#include "calibration/estimate.h"

#include <gsl/gsl_cdf.h>

#include <cmath>

#include "core/problem.h"

namespace terrode::calibration {

double Estimate::in_coordinate() const { return coordinate == Coordinate::log ? std::log(value) : value; }

const Estimate* Fit::find(const std::string& name) const {
  for (const Estimate& e : estimates)
    if (e.name == name) return &e;
  return nullptr;
}

double Fit::value(const std::string& name) const {
  const Estimate* e = find(name);
  if (!e) throw InputError("the fit has no estimate of " + name);
  return e->value;
}

void set_covariance(Fit& fit, const Eigen::MatrixXd& coordinate_covariance) {
  fit.coordinate_covariance = coordinate_covariance;
  Eigen::VectorXd slope(static_cast<Eigen::Index>(fit.estimates.size()));
  for (Eigen::Index i = 0; i < slope.size(); ++i) {
    const Estimate& e = fit.estimates[static_cast<std::size_t>(i)];
    slope[i] = e.coordinate == Coordinate::log ? e.value : 1.0;
  }
  fit.covariance = slope.asDiagonal() * coordinate_covariance * slope.asDiagonal();
  for (Eigen::Index i = 0; i < slope.size(); ++i)
    fit.estimates[static_cast<std::size_t>(i)].std = std::sqrt(std::max(0.0, fit.covariance(i, i)));
}

double t_quantile(double confidence, double degrees_of_freedom) {
  return gsl_cdf_tdist_Pinv(0.5 + 0.5 * confidence, degrees_of_freedom);
}

}  // namespace terrode::calibration
