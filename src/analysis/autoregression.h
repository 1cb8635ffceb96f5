// Autoregressive models of noise: the background that lines stand out from, and the variance of means.
#pragma once

#include <span>
#include <vector>

namespace terrode::analysis {

// x_i = a_1 x_(i-1) + ... + a_p x_(i-p) + e_i, with e white of variance `innovation_variance`.
struct AutoRegression {
  std::vector<double> coefficients;  // a_1 ... a_p
  double innovation_variance = 0.0;

  // Two-sided spectral density per unit of (cycles per sample), at f in cycles per sample (0 to 0.5): its integral
  // from -1/2 to 1/2 is the variance.
  double spectrum(double f) const;
};

// Burg's method (Burg 1967): always stable. The mean of x is removed first. `order` is cut to what n allows.
AutoRegression fit_burg(std::span<const double> x, int order);

// The same with the order from 0 to `max_order` of smallest AICc (Hurvich & Tsai 1989).
AutoRegression fit_burg_best(std::span<const double> x, int max_order);

}  // namespace terrode::analysis
