#include "analysis/autoregression.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace terrode::analysis {

double AutoRegression::spectrum(double f) const {
  double re = 1.0, im = 0.0;
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    const double w = 2.0 * std::numbers::pi * f * static_cast<double>(k + 1);
    re -= coefficients[k] * std::cos(w);
    im += coefficients[k] * std::sin(w);
  }
  return innovation_variance / std::max(re * re + im * im, std::numeric_limits<double>::min());
}

namespace {

// Runs Burg's recursion to `order`; calls seen(model) after each order, 0 included.
template <typename Seen>
void burg(std::span<const double> x, int order, Seen&& seen) {
  const std::size_t n = x.size();
  AutoRegression model;
  if (n == 0) return seen(model);
  double mean = 0.0;
  for (const double v : x) mean += v;
  mean /= static_cast<double>(n);
  std::vector<double> forward(n), backward(n);
  double energy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    forward[i] = backward[i] = x[i] - mean;
    energy += forward[i] * forward[i];
  }
  model.innovation_variance = energy / static_cast<double>(n);
  seen(model);
  const std::size_t top = std::min<std::size_t>(static_cast<std::size_t>(std::max(order, 0)), n / 3);
  for (std::size_t m = 1; m <= top; ++m) {
    double numerator = 0.0, denominator = 0.0;
    for (std::size_t i = m; i < n; ++i) {
      numerator += forward[i] * backward[i - 1];
      denominator += forward[i] * forward[i] + backward[i - 1] * backward[i - 1];
    }
    if (!(denominator > 0.0)) return;
    const double k = 2.0 * numerator / denominator;
    for (std::size_t i = n - 1; i >= m; --i) {
      const double f = forward[i], b = backward[i - 1];
      forward[i] = f - k * b;
      backward[i] = b - k * f;
    }
    std::vector<double> a(m);
    for (std::size_t i = 0; i + 1 < m; ++i) a[i] = model.coefficients[i] - k * model.coefficients[m - 2 - i];
    a[m - 1] = k;
    model.coefficients = std::move(a);
    model.innovation_variance *= 1.0 - k * k;
    seen(model);
  }
}

}  // namespace

AutoRegression fit_burg(std::span<const double> x, int order) {
  AutoRegression out;
  burg(x, order, [&](const AutoRegression& m) { out = m; });
  return out;
}

AutoRegression fit_burg_best(std::span<const double> x, int max_order) {
  AutoRegression best;
  double best_score = std::numeric_limits<double>::infinity();
  const double n = static_cast<double>(x.size());
  burg(x, max_order, [&](const AutoRegression& m) {
    const double k = static_cast<double>(m.coefficients.size()) + 1.0;
    if (n - k - 1.0 <= 0.0 || !(m.innovation_variance > 0.0)) {
      if (best_score == std::numeric_limits<double>::infinity()) best = m;
      return;
    }
    const double score = n * std::log(m.innovation_variance) + 2.0 * k * n / (n - k - 1.0);
    if (score < best_score) {
      best_score = score;
      best = m;
    }
  });
  return best;
}

}  // namespace terrode::analysis
