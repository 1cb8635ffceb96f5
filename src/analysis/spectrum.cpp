#include "analysis/spectrum.h"

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_fft_real.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>

#include "core/problem.h"
#include "core/statistics.h"

namespace terrode::analysis {
namespace {

constexpr double kLongGap = 0.1;     // of the series
constexpr double kGapFactor = 1.75;  // a step this much longer than the median holds a missing sample

std::size_t power_of_two(std::size_t n) {
  std::size_t p = 1;
  while (p < n) p *= 2;
  return p;
}

// Transform of h x, zero-padded to n (a power of two), at frequencies 0 .. n/2.
std::vector<std::complex<double>> transform(const std::vector<double>& x, const std::vector<double>& h, std::size_t n) {
  std::vector<double> work(n, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i) work[i] = x[i] * h[i];
  gsl_fft_real_radix2_transform(work.data(), 1, n);
  std::vector<std::complex<double>> out(n / 2 + 1);
  out[0] = work[0];
  for (std::size_t k = 1; k < n / 2; ++k) out[k] = {work[k], work[n - k]};
  if (n > 1) out[n / 2] = work[n / 2];
  return out;
}

// Number of eigenvalues of the symmetric tridiagonal matrix (d, e) below x (Sturm sequence).
std::size_t count_below(const std::vector<double>& d, const std::vector<double>& e, double x) {
  std::size_t count = 0;
  double q = 1.0;
  for (std::size_t i = 0; i < d.size(); ++i) {
    q = d[i] - x - (i > 0 ? e[i - 1] * e[i - 1] / q : 0.0);
    if (q == 0.0) q = std::numeric_limits<double>::min();
    if (q < 0.0) ++count;
  }
  return count;
}

// Solves (T - shift) y = b for the symmetric tridiagonal T by elimination with partial pivoting.
std::vector<double> solve_shifted(const std::vector<double>& d, const std::vector<double>& e, double shift, std::vector<double> b) {
  const std::size_t n = d.size();
  std::vector<double> main(n), up(n, 0.0), up2(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    main[i] = d[i] - shift;
    if (i + 1 < n) up[i] = e[i];
  }
  for (std::size_t i = 0; i + 1 < n; ++i) {
    double low = e[i];
    if (std::abs(low) > std::abs(main[i])) {  // rows i and i+1 change places
      std::swap(main[i], low);
      std::swap(up[i], main[i + 1]);
      if (i + 2 < n) std::swap(up2[i], up[i + 1]);
      std::swap(b[i], b[i + 1]);
    }
    if (main[i] == 0.0) main[i] = std::numeric_limits<double>::epsilon();
    const double f = low / main[i];
    main[i + 1] -= f * up[i];
    if (i + 2 < n) up[i + 1] -= f * up2[i];
    b[i + 1] -= f * b[i];
  }
  if (main[n - 1] == 0.0) main[n - 1] = std::numeric_limits<double>::epsilon();
  for (std::size_t i = n; i-- > 0;) {
    double v = b[i];
    if (i + 1 < n) v -= up[i] * b[i + 1];
    if (i + 2 < n) v -= up2[i] * b[i + 2];
    b[i] = v / main[i];
  }
  return b;
}

void normalise(std::vector<double>& v) {
  double s = 0.0;
  for (const double x : v) s += x * x;
  s = std::sqrt(s);
  for (double& x : v) x /= s;
}

// Tapers are needed again and again for series of one length (the runs of a campaign): the last few are kept.
std::shared_ptr<const Tapers> kept_dpss(std::size_t n, double nw, std::size_t k) {
  struct Kept {
    std::size_t n, k;
    double nw;
    std::shared_ptr<const Tapers> tapers;
  };
  static std::mutex lock;
  static std::vector<Kept> kept;
  constexpr std::size_t kKept = 8, kLongest = 1 << 16;
  {
    const std::lock_guard<std::mutex> guard(lock);
    for (const Kept& e : kept)
      if (e.n == n && e.k == k && e.nw == nw) return e.tapers;
  }
  auto made = std::make_shared<const Tapers>(dpss(n, nw, k));
  const std::lock_guard<std::mutex> guard(lock);
  if (n <= kLongest) {
    if (kept.size() >= kKept) kept.erase(kept.begin());
    kept.push_back({n, k, nw, made});
  }
  return made;
}

struct Transforms {
  std::shared_ptr<const Tapers> tapers;
  std::size_t n = 0;  // padded length
  std::vector<std::vector<std::complex<double>>> x;
};

Transforms transforms(const EvenSeries& series, const MultitaperOptions& options) {
  Transforms out;
  const std::size_t n = series.x.size();
  if (n < 8) throw InputError("a spectrum needs at least 8 samples");
  out.tapers = kept_dpss(n, options.nw, options.tapers);
  out.n = power_of_two(n * std::max<std::size_t>(options.padding, 1));
  for (const auto& h : out.tapers->h) out.x.push_back(transform(series.x, h, out.n));
  return out;
}

}  // namespace

EvenSeries even_series(std::span<const double> t, std::span<const double> x) {
  std::vector<double> tt, xx, steps;
  for (std::size_t i = 0; i < std::min(t.size(), x.size()); ++i) {
    if (!std::isfinite(t[i]) || !std::isfinite(x[i]) || (!tt.empty() && t[i] <= tt.back())) continue;
    tt.push_back(t[i]);
    xx.push_back(x[i]);
  }
  EvenSeries out;
  if (tt.size() < 2) {
    out.x = xx;
    return out;
  }
  for (std::size_t i = 1; i < tt.size(); ++i) steps.push_back(tt[i] - tt[i - 1]);
  out.step = median(steps);
  const double whole = tt.back() - tt.front();
  std::size_t from = 0, to = tt.size(), start = 0;
  double longest = -1.0;
  for (std::size_t i = 1; i <= tt.size(); ++i) {
    if (i < tt.size() && tt[i] - tt[i - 1] <= std::max(kLongGap * whole, kGapFactor * out.step)) continue;
    if (tt[i - 1] - tt[start] > longest) {
      longest = tt[i - 1] - tt[start];
      from = start;
      to = i;
    }
    start = i;
  }
  out.t0 = tt[from];
  const auto count = static_cast<std::size_t>((tt[to - 1] - tt[from]) / out.step + 1e-6) + 1;
  // Steps whose mean is not their median (a clock with rounded steps) would shift the end; the mean of the piece counts
  // unless gaps make it useless.
  const double mean_step = (tt[to - 1] - tt[from]) / static_cast<double>(to - from - 1);
  if (mean_step < 1.05 * out.step && mean_step > 0.95 * out.step) {
    out.step = mean_step;
    out.x.resize(to - from);
  } else {
    out.x.resize(count);
  }
  std::size_t k = from;
  std::size_t bridged = 0;
  for (std::size_t i = 0; i < out.x.size(); ++i) {
    const double at = std::min(out.t0 + out.step * static_cast<double>(i), tt[to - 1]);
    while (k + 2 < to && tt[k + 1] < at) ++k;
    const double gap = tt[k + 1] - tt[k];
    const double u = (at - tt[k]) / gap;
    out.x[i] = (1.0 - u) * xx[k] + u * xx[k + 1];
    if (gap > kGapFactor * out.step && u > 1e-6 && u < 1.0 - 1e-6) ++bridged;
  }
  out.interpolated = static_cast<double>(bridged) / static_cast<double>(out.x.size());
  return out;
}

void remove_trend(std::vector<double>& x, int degree) {
  const std::size_t n = x.size();
  if (n == 0) return;
  // Legendre-like polynomials made orthogonal on the samples by Gram-Schmidt.
  std::vector<std::vector<double>> basis;
  for (int d = 0; d <= degree && static_cast<std::size_t>(d) < n; ++d) {
    std::vector<double> p(n);
    for (std::size_t i = 0; i < n; ++i) p[i] = std::pow(2.0 * static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(n - 1, 1)) - 1.0, d);
    for (const auto& q : basis) {
      double dot = 0.0;
      for (std::size_t i = 0; i < n; ++i) dot += p[i] * q[i];
      for (std::size_t i = 0; i < n; ++i) p[i] -= dot * q[i];
    }
    normalise(p);
    double dot = 0.0;
    for (std::size_t i = 0; i < n; ++i) dot += p[i] * x[i];
    for (std::size_t i = 0; i < n; ++i) x[i] -= dot * p[i];
    basis.push_back(std::move(p));
  }
}

Tapers dpss(std::size_t n, double nw, std::size_t k) {
  if (n < 4 || !(nw > 0.5) || nw >= 0.5 * static_cast<double>(n)) throw InputError("tapers need at least 4 samples and a bandwidth above 1/2 and below n/2");
  k = std::clamp<std::size_t>(k, 1, static_cast<std::size_t>(std::max(1.0, 2.0 * nw - 1.0)));
  const double nn = static_cast<double>(n);
  const double cosine = std::cos(kTwoPi * nw / nn);
  std::vector<double> d(n), e(n - 1);
  for (std::size_t i = 0; i < n; ++i) {
    const double u = 0.5 * (nn - 1.0) - static_cast<double>(i);
    d[i] = u * u * cosine;
    if (i + 1 < n) e[i] = 0.5 * static_cast<double>(i + 1) * (nn - 1.0 - static_cast<double>(i));
  }
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t i = 0; i < n; ++i) {
    const double r = (i > 0 ? std::abs(e[i - 1]) : 0.0) + (i + 1 < n ? std::abs(e[i]) : 0.0);
    low = std::min(low, d[i] - r);
    high = std::max(high, d[i] + r);
  }
  Tapers out;
  for (std::size_t j = 0; j < k; ++j) {
    // The (n - j)-th eigenvalue in rising order, by bisection.
    double a = low, b = high;
    for (int it = 0; it < 200 && b - a > 1e-15 * std::max(std::abs(a), std::abs(b)); ++it) {
      const double m = 0.5 * (a + b);
      if (m <= a || m >= b) break;
      (count_below(d, e, m) >= n - j ? b : a) = m;
    }
    // Inverse iteration from a start with the right parity and about the right number of zeros.
    std::vector<double> v(n);
    for (std::size_t i = 0; i < n; ++i)
      v[i] = std::cos(std::numbers::pi * static_cast<double>(j) * (static_cast<double>(i) + 0.5) / nn) + 1e-3 * std::sin(static_cast<double>(i + 1) * 0.7);
    for (int it = 0; it < 4; ++it) {
      v = solve_shifted(d, e, 0.5 * (a + b), std::move(v));
      normalise(v);
    }
    // Even sequences have a positive sum, odd ones begin with a positive lobe.
    double sum = 0.0, tilt = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      sum += v[i];
      tilt += v[i] * (0.5 * (nn - 1.0) - static_cast<double>(i));
    }
    const double sign = (j % 2 == 0 ? sum : tilt) < 0.0 ? -1.0 : 1.0;
    for (double& x : v) x *= sign;
    out.h.push_back(std::move(v));
  }
  // Concentration: energy of the transform within the band, from the autocorrelation of the sequence.
  const std::size_t padded = power_of_two(2 * n);
  const std::vector<double> ones(n, 1.0);
  for (const auto& h : out.h) {
    const auto X = transform(h, ones, 4 * padded);
    const double df = 1.0 / static_cast<double>(4 * padded);
    double inside = 0.0, all = 0.0;
    for (std::size_t i = 0; i < X.size(); ++i) {
      const double weight = i == 0 || i + 1 == X.size() ? 0.5 : 1.0;
      const double p = weight * std::norm(X[i]);
      all += p;
      const double f = df * static_cast<double>(i), w = nw / nn;
      if (f <= w - 0.5 * df) inside += p;
      else if (f < w + 0.5 * df) inside += p * (w + 0.5 * df - f) / df;
    }
    out.concentration.push_back(std::min(inside / all, 1.0));
  }
  return out;
}

std::pair<double, double> Spectrum::confidence(std::size_t i, double probability) const {
  const double dof = degrees_of_freedom[i], tail = 0.5 * (1.0 - probability);
  return {dof / gsl_cdf_chisq_Qinv(tail, dof), dof / gsl_cdf_chisq_Pinv(tail, dof)};
}

Spectrum multitaper(const EvenSeries& series, const MultitaperOptions& options) {
  const Transforms tr = transforms(series, options);
  const std::size_t K = tr.x.size(), bins = tr.n / 2 + 1;
  const double n = static_cast<double>(series.x.size());
  Spectrum out;
  out.half_bandwidth = options.nw / series.length();
  out.tapers = K;
  std::vector<double> at_zero(K, 0.0);
  double at_zero_squares = 0.0;
  for (std::size_t k = 0; k < K; ++k) {
    for (const double h : tr.tapers->h[k]) at_zero[k] += h;
    if (k % 2 == 1) at_zero[k] = 0.0;
    at_zero_squares += at_zero[k] * at_zero[k];
  }
  double variance = 0.0;
  for (const double x : series.x) variance += x * x / n;
  out.frequency.resize(bins);
  out.density.resize(bins);
  out.degrees_of_freedom.resize(bins);
  out.f_statistic.resize(bins);
  out.line.resize(bins);
  for (std::size_t i = 0; i < bins; ++i) {
    out.frequency[i] = static_cast<double>(i) / (static_cast<double>(tr.n) * series.step);
    // Thomson's adaptive weights, Eqs. 5.3 and 5.4: a taper counts less where leakage from elsewhere dominates it.
    double s = 0.0;
    for (std::size_t k = 0; k < std::min<std::size_t>(2, K); ++k) s += std::norm(tr.x[k][i]) / static_cast<double>(std::min<std::size_t>(2, K));
    double dof = 2.0 * static_cast<double>(K);
    for (int it = 0; it < 20; ++it) {
      double top = 0.0, bottom = 0.0, fourth = 0.0;
      for (std::size_t k = 0; k < K; ++k) {
        const double lambda = tr.tapers->concentration[k];
        const double weight = s > 0.0 ? s / (lambda * s + (1.0 - lambda) * variance) : 1.0;
        const double w2 = weight * weight * lambda;
        top += w2 * std::norm(tr.x[k][i]);
        bottom += w2;
        fourth += w2 * w2;
      }
      const double next = bottom > 0.0 ? top / bottom : 0.0;
      dof = fourth > 0.0 ? 2.0 * bottom * bottom / fourth : dof;
      const bool settled = std::abs(next - s) <= 1e-6 * s;
      s = next;
      if (settled) break;
    }
    const double sides = i == 0 || i + 1 == bins ? 1.0 : 2.0;
    out.density[i] = sides * series.step * s;
    out.degrees_of_freedom[i] = dof;
    std::complex<double> mu = 0.0;
    for (std::size_t k = 0; k < K; ++k) mu += at_zero[k] * tr.x[k][i];
    mu /= at_zero_squares;
    double rest = 0.0;
    for (std::size_t k = 0; k < K; ++k) rest += std::norm(tr.x[k][i] - mu * at_zero[k]);
    out.f_statistic[i] = rest > 0.0 && K > 1 ? static_cast<double>(K - 1) * std::norm(mu) * at_zero_squares / rest : 0.0;
    out.line[i] = 2.0 * mu;
  }
  return out;
}

Spectrum welch(const EvenSeries& series, std::size_t segments) {
  const std::size_t n = series.x.size();
  segments = std::clamp<std::size_t>(segments, 1, std::max<std::size_t>(n / 8, 1));
  const std::size_t length = std::max<std::size_t>(2 * n / (segments + 1), std::min<std::size_t>(n, 8));
  const std::size_t hop = segments > 1 ? (n - length) / (segments - 1) : 0;
  const std::size_t padded = power_of_two(length);
  std::vector<double> window(length);
  double energy = 0.0;
  for (std::size_t i = 0; i < length; ++i) {
    window[i] = 0.5 - 0.5 * std::cos(kTwoPi * (static_cast<double>(i) + 0.5) / static_cast<double>(length));
    energy += window[i] * window[i];
  }
  Spectrum out;
  const std::size_t bins = padded / 2 + 1;
  out.frequency.resize(bins);
  out.density.assign(bins, 0.0);
  out.half_bandwidth = 0.75 / (static_cast<double>(length) * series.step);
  for (std::size_t s = 0; s < segments; ++s) {
    const auto begin = series.x.begin() + static_cast<std::ptrdiff_t>(s * hop);
    const auto X = transform({begin, begin + static_cast<std::ptrdiff_t>(length)}, window, padded);
    for (std::size_t i = 0; i < bins; ++i) out.density[i] += std::norm(X[i]) / energy / static_cast<double>(segments);
  }
  for (std::size_t i = 0; i < bins; ++i) {
    out.frequency[i] = static_cast<double>(i) / (static_cast<double>(padded) * series.step);
    out.density[i] *= (i == 0 || i + 1 == bins ? 1.0 : 2.0) * series.step;
  }
  // Half-overlapped Hann segments correlate by 1/36 in power: 36/38 of the segments' 2 degrees each remain.
  const double s = static_cast<double>(segments);
  out.degrees_of_freedom.assign(bins, segments > 1 ? 2.0 * s / (1.0 + 2.0 * (s - 1.0) / s / 36.0) : 2.0);
  return out;
}

std::vector<double> lomb_scargle(std::span<const double> t, std::span<const double> x, std::span<const double> frequency) {
  double mean = 0.0, count = 0.0, squares = 0.0;
  for (const double v : x)
    if (std::isfinite(v)) {
      mean += v;
      count += 1.0;
    }
  mean /= std::max(count, 1.0);
  for (const double v : x)
    if (std::isfinite(v)) squares += (v - mean) * (v - mean);
  const double variance = squares / std::max(count - 1.0, 1.0);
  std::vector<double> out;
  out.reserve(frequency.size());
  for (const double f : frequency) {
    const double w = kTwoPi * f;
    double s2 = 0.0, c2 = 0.0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      if (!std::isfinite(x[i])) continue;
      s2 += std::sin(2.0 * w * t[i]);
      c2 += std::cos(2.0 * w * t[i]);
    }
    const double tau = w > 0.0 ? std::atan2(s2, c2) / (2.0 * w) : 0.0;
    double xc = 0.0, xs = 0.0, cc = 0.0, ss = 0.0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      if (!std::isfinite(x[i])) continue;
      const double c = std::cos(w * (t[i] - tau)), s = std::sin(w * (t[i] - tau));
      xc += (x[i] - mean) * c;
      xs += (x[i] - mean) * s;
      cc += c * c;
      ss += s * s;
    }
    const double power = (cc > 0.0 ? xc * xc / cc : 0.0) + (ss > 1e-12 ? xs * xs / ss : 0.0);
    out.push_back(variance > 0.0 ? 0.5 * power / variance : 0.0);
  }
  return out;
}

Coherence coherence_at(const EvenSeries& first, const EvenSeries& second, double frequency, const MultitaperOptions& options) {
  if (first.x.size() != second.x.size()) throw InputError("coherence needs two series of the same length");
  Coherence out;
  const auto kept = kept_dpss(first.x.size(), options.nw, options.tapers);
  const Tapers& tapers = *kept;
  std::complex<double> cross = 0.0;
  double a = 0.0, b = 0.0;
  for (const auto& h : tapers.h) {
    std::complex<double> X = 0.0, Y = 0.0;
    const std::complex<double> turn = std::polar(1.0, -kTwoPi * frequency * first.step);
    std::complex<double> phasor = 1.0;
    for (std::size_t i = 0; i < h.size(); ++i) {
      X += h[i] * first.x[i] * phasor;
      Y += h[i] * second.x[i] * phasor;
      phasor *= turn;
    }
    cross += std::conj(X) * Y;
    a += std::norm(X);
    b += std::norm(Y);
  }
  if (!(a > 0.0) || !(b > 0.0)) return out;
  out.coherence = std::norm(cross) / (a * b);
  out.phase = std::arg(cross);
  out.gain = std::abs(cross) / a;
  out.p = std::pow(std::max(1.0 - out.coherence, 0.0), static_cast<double>(tapers.h.size()) - 1.0);
  return out;
}

TimeFrequency time_frequency(const EvenSeries& series, double window, double highest_frequency) {
  TimeFrequency out;
  const auto length = std::min(series.x.size(), static_cast<std::size_t>(std::max(window / series.step, 16.0)));
  if (length < 16) return out;
  const std::size_t hop = std::max<std::size_t>(length / 4, 1);
  std::vector<std::vector<double>> columns;
  for (std::size_t from = 0; from + length <= series.x.size(); from += hop) {
    EvenSeries piece;
    piece.step = series.step;
    piece.x.assign(series.x.begin() + static_cast<std::ptrdiff_t>(from), series.x.begin() + static_cast<std::ptrdiff_t>(from + length));
    remove_trend(piece.x, 1);
    const Spectrum s = multitaper(piece, {2.0, 3, 2});
    if (out.frequency.empty())
      for (const double f : s.frequency)
        if (f <= highest_frequency) out.frequency.push_back(f);
    columns.emplace_back(s.density.begin(), s.density.begin() + static_cast<std::ptrdiff_t>(out.frequency.size()));
    out.time.push_back(series.t0 + series.step * (static_cast<double>(from) + 0.5 * static_cast<double>(length - 1)));
  }
  out.density.resize(out.frequency.size() * out.time.size());
  for (std::size_t t = 0; t < columns.size(); ++t)
    for (std::size_t f = 0; f < out.frequency.size(); ++f) out.density[f * out.time.size() + t] = columns[t][f];
  return out;
}

Sinusoid fit_sinusoid(const EvenSeries& series, double frequency) {
  Sinusoid out;
  out.frequency = frequency;
  const std::size_t n = series.x.size();
  if (n < 4) return out;
  const double nn = static_cast<double>(n);
  // Phases count from the middle of the series, where they correlate least with the frequency.
  const double middle = 0.5 * static_cast<double>(n - 1);
  double sc = 0.0, ss = 0.0, cc = 0.0, cs = 0.0, s2 = 0.0, xc = 0.0, xs = 0.0, mean = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) mean += series.x[i] / nn;
  for (std::size_t i = 0; i < n; ++i) {
    const double a = kTwoPi * frequency * series.step * (static_cast<double>(i) - middle);
    const double c = std::cos(a), s = std::sin(a), x = series.x[i] - mean;
    sc += c;
    ss += s;
    cc += c * c;
    cs += c * s;
    s2 += s * s;
    xc += x * c;
    xs += x * s;
    squares += x * x;
  }
  cc -= sc * sc / nn;
  cs -= sc * ss / nn;
  s2 -= ss * ss / nn;
  const double det = cc * s2 - cs * cs;
  if (!(det > 1e-9 * nn * nn) || !(squares > 0.0)) return out;
  const double a = (xc * s2 - xs * cs) / det, b = (xs * cc - xc * cs) / det;
  out.amplitude = std::hypot(a, b);
  // a cos(w (t - tm)) + b sin(w (t - tm)) = A cos(w (t - t0) + phase), with t0 the series' start
  out.phase = std::remainder(std::atan2(-b, a) - kTwoPi * frequency * series.step * middle, kTwoPi);
  out.explained = std::clamp((a * xc + b * xs) / squares, 0.0, 1.0);
  return out;
}

Sinusoid refine_sinusoid(const EvenSeries& series, double low, double high) {
  const double step = 0.125 / series.length();
  low = std::max(low, step);
  high = std::min(high, 0.5 / series.step);
  Sinusoid best;
  for (double f = low; f <= high + 0.5 * step; f += step)
    if (const Sinusoid s = fit_sinusoid(series, f); s.explained > best.explained) best = s;
  if (best.explained <= 0.0) return fit_sinusoid(series, 0.5 * (low + high));
  double a = best.frequency - step, b = best.frequency + step;
  constexpr double golden = 0.6180339887498949;
  double c = b - golden * (b - a), d = a + golden * (b - a);
  double fc = fit_sinusoid(series, c).explained, fd = fit_sinusoid(series, d).explained;
  for (int it = 0; it < 40 && b - a > 1e-7 * best.frequency; ++it) {
    if (fc > fd) {
      b = d;
      d = c;
      fd = fc;
      c = b - golden * (b - a);
      fc = fit_sinusoid(series, c).explained;
    } else {
      a = c;
      c = d;
      fc = fd;
      d = a + golden * (b - a);
      fd = fit_sinusoid(series, d).explained;
    }
  }
  const Sinusoid s = fit_sinusoid(series, 0.5 * (a + b));
  return s.explained >= best.explained ? s : best;
}

}  // namespace terrode::analysis
