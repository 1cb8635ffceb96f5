// What every fit gives back: values with their intervals, their covariance, and what the user should know.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace terrode::calibration {

// Coordinate in which a parameter is fitted and in which its estimate is closest to normal.
enum class Coordinate { value, log };

struct Estimate {
  std::string name;          // as soil files call it: cohesion, friction_angle, shear_modulus, k, n, kc, kphi, a0, ...
  std::string unit;          // SI
  double value = 0.0;
  double std = 0.0;          // standard error, by the delta method where the coordinate is a logarithm
  double low = 0.0;          // interval at the fit's confidence
  double high = 0.0;
  Coordinate coordinate = Coordinate::value;
  bool identified = true;    // false: the data do not set it; the value is an assumption that a warning names
  bool at_bound = false;     // the best value lies outside what it may be and was held at the limit

  double in_coordinate() const;  // ln value, or value
};

// Something the user should know about a fit. `id` is stable: "not_identified", "plate_size", "depth_range", "rate",
// "unusual_value", "weakly_identified", "no_plateau", "softening", "negative", "few_tests", "model_misfit".
struct Warning {
  std::string id;
  std::string parameter;     // the estimate meant; empty: the fit
  std::string text;          // what is so
  std::string remedy;        // which test or change would mend it; may be empty
};

struct Fit {
  std::vector<Estimate> estimates;
  Eigen::MatrixXd covariance;             // of the values, SI units, in the order of the estimates
  Eigen::MatrixXd coordinate_covariance;  // of ln value where the coordinate is log, else as above
  double degrees_of_freedom = 0.0;        // of Student's t for intervals
  double confidence = 0.95;
  std::vector<Warning> warnings;

  const Estimate* find(const std::string& name) const;
  // Throws InputError when there is no such estimate.
  double value(const std::string& name) const;
};

// Sets `covariance` and every `std` from the coordinate covariance (delta method).
void set_covariance(Fit& fit, const Eigen::MatrixXd& coordinate_covariance);

// Two-sided quantile of Student's t: P(|t| <= q) = confidence.
double t_quantile(double confidence, double degrees_of_freedom);

}  // namespace terrode::calibration
