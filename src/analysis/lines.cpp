#include "analysis/lines.h"

#include <fmt/format.h>
#include <gsl/gsl_cdf.h>
#include <gsl/gsl_sf_gamma.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "analysis/autoregression.h"
#include "analysis/steady_state.h"
#include "core/linear_algebra.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace terrode::analysis {
namespace {

constexpr std::size_t kFewestSamples = 32;
constexpr int kBackgroundOrder = 6;
constexpr int kBackgroundRounds = 20;
constexpr double kEvidenceCap = 15.0;        // of one run for one axis, so that no single run decides
constexpr double kDecisive = 4.605170186;    // ln 100
constexpr double kFilteredShare = 1e-4;
constexpr int kMaxHarmonic = 8;
constexpr int kResonanceOrder = 16;
// Rates that rise with slip need not start from zero: |r omega - v| + offset r omega is tried for these offsets, at the
// price of ln 10 in evidence against the pure axis.
constexpr double kSlipOffsets[] = {0.0, 0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175, 0.2, 0.225, 0.25, 0.3, 0.35, 0.4, 0.5, 0.7, 1.0};
constexpr double kOffsetPrice = 2.302585093;

double log_chi2_tail(double x, double dof) {
  const double p = gsl_cdf_chisq_Q(x, dof);
  if (p > 1e-280) return std::log(p);
  const double a = 0.5 * dof, y = 0.5 * x;
  return (a - 1.0) * std::log(y) - y - gsl_sf_lngamma(a) - std::log1p(-(a - 1.0) / y);
}

// ln of 1 - (1 - p)^m from ln p.
double log_any_of(double log_p, double m) {
  if (log_p < -20.0) return std::min(0.0, log_p + std::log(m));
  return std::log(-std::expm1(m * std::log1p(-std::min(std::exp(log_p), 1.0 - 1e-16))));
}

double normal_deviate(double log_p) {
  if (log_p > -600.0) return gsl_cdf_ugaussian_Qinv(std::exp(log_p));
  const double a = -2.0 * log_p;
  return std::sqrt(a - std::log(kTwoPi) - std::log(a));
}

double spacing(const Spectrum& s) { return s.frequency.size() > 1 ? s.frequency[1] - s.frequency[0] : 1.0; }

std::size_t bin_of(const Spectrum& s, double f) {
  const double i = std::round(f / spacing(s));
  return static_cast<std::size_t>(std::clamp(i, 0.0, static_cast<double>(s.frequency.size() - 1)));
}

// Mean of a velocity over a window: measured where there is a channel, else as commanded; 0 where neither is known.
double mean_velocity(const recording::Run& run, const char* name, const std::optional<double>& commanded, double begin, double end) {
  if (const recording::Channel* c = run.find(name)) {
    double sum = 0.0, count = 0.0;
    for (std::size_t i = 0; i < run.time.size(); ++i)
      if (run.time[i] >= begin && run.time[i] <= end && std::isfinite(c->values[i])) {
        sum += c->values[i];
        count += 1.0;
      }
    if (count > 0.0) return sum / count;
  }
  return commanded.value_or(0.0);
}

// The way along an axis at the samples of an even series: turns, metres or metres slipped.
std::vector<double> axis_coordinate(const recording::Run& run, const EvenSeries& series, Axis axis, double radius) {
  auto velocity = [&](const char* name, const std::optional<double>& commanded) -> std::vector<double> {
    std::vector<double> out(series.x.size(), commanded.value_or(0.0));
    const recording::Channel* c = run.find(name);
    if (!c) return out;
    std::size_t k = 0;
    double last = commanded.value_or(0.0);
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double t = series.t0 + series.step * static_cast<double>(i);
      while (k < run.time.size() && run.time[k] <= t + 0.5 * series.step) {
        if (std::isfinite(c->values[k])) last = c->values[k];
        ++k;
      }
      out[i] = last;
    }
    return out;
  };
  const auto omega = velocity(recording::channel::angular_velocity, run.condition.angular_velocity);
  const auto v = velocity(recording::channel::forward_velocity, run.condition.forward_velocity);
  std::vector<double> u(series.x.size(), 0.0);
  for (std::size_t i = 1; i < u.size(); ++i) {
    const auto speed = [&](std::size_t k) {
      if (axis == Axis::wheel) return omega[k] / kTwoPi;
      if (axis == Axis::travel) return v[k];
      return radius * omega[k] - v[k];
    };
    u[i] = u[i - 1] + 0.5 * series.step * (speed(i) + speed(i - 1));
  }
  return u;
}

struct Windowed {
  EvenSeries series;  // trend removed
  double mean = 0.0, std = 0.0, begin = 0.0, end = 0.0;
  bool usable = false;
};

Windowed window_of(const recording::Run& run, const std::string& channel, const LineOptions& options) {
  const recording::Channel* c = run.find(channel);
  if (!c) throw InputError(Problem{run.file, 0, 0, channel, fmt::format("is not a channel of run '{}'", run.id), {}});
  Windowed w;
  SteadyOptions steady;
  steady.begin = options.begin;
  steady.end = options.end;
  const double begin = steady_begin(run, steady);
  const double end = options.end.value_or(run.time.empty() ? 0.0 : run.time.back());
  const auto from = static_cast<std::size_t>(std::lower_bound(run.time.begin(), run.time.end(), begin) - run.time.begin());
  const auto to = static_cast<std::size_t>(std::upper_bound(run.time.begin(), run.time.end(), end) - run.time.begin());
  if (to <= from) return w;
  w.series = even_series(std::span(run.time).subspan(from, to - from), std::span(c->values).subspan(from, to - from));
  if (w.series.x.size() < 2) return w;
  w.begin = w.series.t0;
  w.end = w.series.t0 + w.series.length() - w.series.step;
  const double n = static_cast<double>(w.series.x.size());
  for (const double x : w.series.x) w.mean += x / n;
  double squares = 0.0, largest = 0.0;
  for (const double x : w.series.x) {
    squares += (x - w.mean) * (x - w.mean);
    largest = std::max(largest, std::abs(x));
  }
  w.std = std::sqrt(squares / (n - 1.0));
  remove_trend(w.series.x, options.trend);
  double left = 0.0;
  for (const double x : w.series.x) left += x * x;
  w.usable = w.series.x.size() >= kFewestSamples && std::sqrt(left / n) > 1e-12 * largest;
  return w;
}

}  // namespace

std::string lock_name(Lock lock) {
  switch (lock) {
    case Lock::time: return "time";
    case Lock::wheel: return "wheel";
    case Lock::travel: return "travel";
    case Lock::slip_travel: return "slip_travel";
    case Lock::undecided: break;
  }
  return "undecided";
}

Problems LineOptions::validate() const {
  Problems out;
  require(out, "false_alarm", false_alarm, "", false_alarm > 0.0 && false_alarm < 1.0, "a probability between 0 and 1");
  require(out, "nw", nw, "", nw >= 1.0 && nw <= 32.0, "a time-bandwidth product from 1 to 32");
  require(out, "lowest", lowest, "Hz", lowest >= 0.0, "a frequency of at least 0");
  require(out, "highest", highest, "Hz", highest >= 0.0 && (highest == 0.0 || highest > lowest), "a frequency above lowest, or 0");
  require(out, "smallest_share", smallest_share, "", smallest_share >= 0.0 && smallest_share < 1.0, "a share from 0 to below 1");
  require(out, "trend", trend, "", trend >= 0 && trend <= 2, "0, 1 or 2");
  require(out, "wheel_radius", wheel_radius, "m", wheel_radius >= 0.0, "a radius of at least 0");
  return out;
}

std::vector<double> red_noise_background(const Spectrum& s, double step, std::size_t samples, double lowest, double highest) {
  const std::size_t bins = s.density.size();
  const double df = spacing(s);
  const std::size_t lo = bin_of(s, lowest), hi = std::max(bin_of(s, highest), lo + 1);
  // A running median over this many bins either side; chi^2 is skewed, so its median is below its mean.
  const double dof = s.degrees_of_freedom[(lo + hi) / 2];
  const double median_factor = gsl_cdf_chisq_Pinv(0.5, dof) / dof;
  const auto reach = static_cast<std::size_t>(std::max(12.0 * s.half_bandwidth / df, 1.0));
  std::vector<double> model(bins, 1.0), ratio(bins);
  auto local_level = [&](const std::vector<double>& base) {
    std::vector<double> out(bins);
    double at_lo = 0.0, at_hi = 0.0;
    const std::size_t stride = std::max<std::size_t>(reach / 16, 1);
    std::vector<std::size_t> knots;
    std::vector<double> level;
    for (std::size_t i = lo; i <= hi; i = std::min(i + stride, hi + (i == hi ? 1 : 0))) {
      // Windows keep their width at the ends: shifted, not cut.
      std::size_t a = i > lo + reach ? i - reach : lo, b = std::min(a + 2 * reach, hi);
      if (b - a < 2 * reach) a = b > lo + 2 * reach ? b - 2 * reach : lo;
      std::vector<double> values;
      for (std::size_t k = a; k <= b; ++k) values.push_back(s.density[k] / base[k]);
      knots.push_back(i);
      level.push_back(median(values, std::numeric_limits<double>::quiet_NaN()) / median_factor);
      if (i == hi) break;
    }
    at_lo = level.front();
    at_hi = level.back();
    std::size_t k = 0;
    for (std::size_t i = 0; i < bins; ++i) {
      if (i <= lo) out[i] = at_lo;
      else if (i >= hi) out[i] = at_hi;
      else {
        while (k + 2 < knots.size() && knots[k + 1] < i) ++k;
        const double u = static_cast<double>(i - knots[k]) / static_cast<double>(knots[k + 1] - knots[k]);
        out[i] = (1.0 - u) * level[k] + u * level[k + 1];
      }
      out[i] = std::max(out[i] * base[i], std::numeric_limits<double>::min());
    }
    return out;
  };
  std::vector<double> background;
  const double clip = gsl_cdf_chisq_Pinv(0.95, dof) / dof;
  // First a model of order 1 of the whole spectrum, too stiff to follow a line; then what noise of the last model hardly
  // exceeds is cut off down to that model.
  for (int it = 0; it < kBackgroundRounds; ++it) {
    const int highest_order = it == 0 ? 1 : kBackgroundOrder;
    // Autocovariance of the spectrum with its peaks cut off and what lies outside the band taken from the model.
    std::vector<double> r(kBackgroundOrder + 1, 0.0);
    for (std::size_t i = 0; i < bins; ++i) {
      const bool inside = i >= lo && i <= hi;
      // Down to the model and not to the clip: a line in the first model would keep itself alive.
      const bool own = it == 0 || (inside && s.density[i] <= clip * background[i]);
      const double d = own ? s.density[i] : background[i];
      const double weight = (i == 0 || i + 1 == bins ? 0.5 : 1.0) * d * df;
      const double w = kTwoPi * s.frequency[i] * step;
      double c0 = 1.0, c1 = std::cos(w);
      const double twice = 2.0 * c1;
      for (int k = 0; k <= kBackgroundOrder; ++k) {
        r[static_cast<std::size_t>(k)] += weight * c0;
        const double next = twice * c1 - c0;
        c0 = c1;
        c1 = next;
      }
    }
    if (!(r[0] > 0.0)) break;
    // Levinson-Durbin; order by AICc.
    std::vector<double> a, best;
    double error = r[0], best_error = r[0], best_score = std::numeric_limits<double>::infinity();
    const double n = static_cast<double>(samples);
    for (int m = 0;; ++m) {
      const double k = m + 1.0;
      const double score = n * std::log(error) + 2.0 * k * n / std::max(n - k - 1.0, 1.0);
      if (score < best_score) {
        best_score = score;
        best = a;
        best_error = error;
      }
      if (m == highest_order) break;
      const auto mm = static_cast<std::size_t>(m);
      double acc = r[mm + 1];
      for (std::size_t j = 0; j < mm; ++j) acc -= a[j] * r[mm - j];
      const double reflection = acc / error;
      if (!(std::abs(reflection) < 1.0)) break;
      std::vector<double> next(mm + 1);
      for (std::size_t j = 0; j < mm; ++j) next[j] = a[j] - reflection * a[mm - 1 - j];
      next[mm] = reflection;
      a = std::move(next);
      error *= 1.0 - reflection * reflection;
    }
    // What the spectrum shows of a steep background is its mean over the bandwidth; without the part around zero that
    // went with the trend.
    const AutoRegression fit{best, best_error};
    const auto width = static_cast<std::ptrdiff_t>(s.half_bandwidth / df);
    const auto gone = static_cast<std::ptrdiff_t>(0.5 / (static_cast<double>(samples) * step) / df);
    const auto last = static_cast<std::ptrdiff_t>(bins) - 1;
    std::vector<double> sum(bins + 1, 0.0);
    for (std::size_t i = 0; i < bins; ++i)
      sum[i + 1] = sum[i] + (static_cast<std::ptrdiff_t>(i) < gone ? 0.0 : 2.0 * step * fit.spectrum(s.frequency[i] * step));
    const auto total = [&](std::ptrdiff_t i, std::ptrdiff_t j) { return j >= i ? sum[static_cast<std::size_t>(j) + 1] - sum[static_cast<std::size_t>(i)] : 0.0; };
    for (std::ptrdiff_t i = 0; i <= last; ++i) {
      double mean = total(std::max<std::ptrdiff_t>(i - width, 0), std::min(i + width, last));
      if (i < width) mean += total(1, width - i);                             // mirrored at zero
      if (i + width > last) mean += total(2 * last - i - width, last - 1);    // and at half the rate
      model[static_cast<std::size_t>(i)] = std::max(mean / static_cast<double>(2 * width + 1), std::numeric_limits<double>::min());
    }
    std::vector<double> next = local_level(model);
    double change = it == 0 ? 1.0 : 0.0;
    for (std::size_t i = lo; i <= hi && it > 0; ++i) change = std::max(change, std::abs(std::log(next[i] / background[i])));
    background = std::move(next);
    if (change < 1e-2) break;
  }
  return background;
}

ChannelSpectrum channel_spectrum(const recording::Run& run, const std::string& channel, const LineOptions& options) {
  throw_if_any(options.validate());
  ChannelSpectrum out;
  out.channel = channel;
  Windowed w = window_of(run, channel, options);
  out.mean = w.mean;
  out.std = w.std;
  out.begin = w.begin;
  out.end = w.end;
  out.rate = w.series.step > 0.0 ? 1.0 / w.series.step : 0.0;
  out.interpolated = w.series.interpolated;
  const double omega = mean_velocity(run, recording::channel::angular_velocity, run.condition.angular_velocity, w.begin, w.end);
  const double v = mean_velocity(run, recording::channel::forward_velocity, run.condition.forward_velocity, w.begin, w.end);
  out.axis_rate[1] = omega / kTwoPi;
  out.axis_rate[2] = v;
  const bool slips = options.wheel_radius > 0.0 && (omega > 0.0 || v > 0.0);
  out.axis_rate[3] = slips ? std::abs(options.wheel_radius * omega - v) : 0.0;
  // Less than a thousandth of the rim's speed is the error of the velocities, not slip.
  if (out.axis_rate[3] < 1e-3 * std::max(options.wheel_radius * omega, v)) out.axis_rate[3] = 0.0;
  if (!w.usable) return out;

  EvenSeries series = w.series;
  const double length = series.length();
  const MultitaperOptions mt{options.nw, options.tapers, 4};
  out.spectrum = multitaper(series, mt);
  const double W = out.spectrum.half_bandwidth;
  out.lowest = std::max(options.lowest, W);
  out.highest = options.highest > 0.0 ? std::min(options.highest, 0.5 * out.rate) : 0.45 * out.rate;
  if (!(options.highest > 0.0)) {
    // Above the frequency that leaves a ten-thousandth of the variance there is what a filter let through.
    double total = 0.0, above = 0.0;
    for (const double d : out.spectrum.density) total += d;
    for (std::size_t i = out.spectrum.density.size(); i-- > 0;) {
      above += out.spectrum.density[i];
      if (above < kFilteredShare * total) continue;
      out.highest = std::min(out.highest, std::max(out.spectrum.frequency[i] + W, out.lowest + 8.0 * W));
      break;
    }
  }
  if (out.highest < out.lowest + 4.0 * W) return out;

  // The strongest line first; a sinusoid is subtracted before the next is looked for, so that it neither leaks nor
  // raises the background.
  Spectrum s = out.spectrum;
  std::vector<double> background = red_noise_background(s, series.step, series.x.size(), out.lowest, out.highest);
  std::vector<bool> masked(s.density.size(), false);
  const std::size_t lo = bin_of(s, out.lowest), hi = bin_of(s, out.highest);
  const double trials = std::max(1.0, (out.highest - out.lowest) * length);
  double variance = 0.0;
  for (const double x : w.series.x) variance += x * x / static_cast<double>(w.series.x.size());
  struct Found {
    SpectralLine line;
    std::size_t bin;
    double density, dof;
  };
  std::vector<Found> found;
  std::size_t rounds = 0;
  while (found.size() < options.max_lines) {
    std::size_t at = 0;
    double best = 0.0;
    for (std::size_t i = lo + 1; i < hi; ++i) {
      if (masked[i]) continue;
      const double r = s.density[i] / background[i];
      if (r <= best) continue;
      // A rise towards an end or towards a line that is there already is no peak of its own.
      if (r < s.density[i - 1] / background[i - 1] || r < s.density[i + 1] / background[i + 1]) continue;
      best = r;
      at = i;
    }
    if (at == 0) break;
    const double dof = s.degrees_of_freedom[at];
    const double log_p = log_any_of(log_chi2_tail(dof * best, dof), trials);
    if (log_p > std::log(options.false_alarm)) break;
    const auto reach = static_cast<std::size_t>(std::max(W / spacing(s), 1.0));
    const std::size_t a = at > reach ? at - reach : 1, b = std::min(at + reach, s.density.size() - 1);
    // Every frequency within the bandwidth is a trial of the F-test.
    double f_best = 0.0;
    for (std::size_t i = a; i <= b; ++i) f_best = std::max(f_best, s.f_statistic[i]);
    const double k1 = static_cast<double>(s.tapers) - 1.0;
    const double p_f = std::pow(1.0 + f_best / k1, -k1);
    SpectralLine line;
    line.sinusoidal = p_f * 2.0 * options.nw < 0.01;
    const double f_low = s.frequency[a], f_high = s.frequency[b];
    const Sinusoid fit = refine_sinusoid(series, f_low, f_high);
    double power = 0.0, centre = 0.0;
    const std::size_t wide_a = at > 2 * reach ? at - 2 * reach : 1, wide_b = std::min(at + 2 * reach, s.density.size() - 1);
    for (std::size_t i = wide_a; i <= wide_b; ++i) {
      const double d = std::max(s.density[i] - background[i], 0.0) * spacing(s);
      power += d;
      centre += d * s.frequency[i];
    }
    if (line.sinusoidal) {
      line.frequency = fit.frequency;
      line.amplitude = fit.amplitude;
      line.frequency_std = std::max(std::sqrt(3.0 * background[at] / (length * length * length)) / (std::numbers::pi * fit.amplitude), 1e-3 / length);
      line.share_of_variance = variance > 0.0 ? 0.5 * fit.amplitude * fit.amplitude / variance : 0.0;
    } else {
      line.frequency = power > 0.0 ? centre / power : s.frequency[at];
      line.amplitude = std::sqrt(2.0 * power);
      line.frequency_std = W / 3.0;
      line.share_of_variance = variance > 0.0 ? power / variance : 0.0;
    }
    line.share_of_variance = std::min(line.share_of_variance, 1.0);
    if (line.frequency < out.lowest || line.frequency > out.highest) {  // the flank of something outside the band
      for (std::size_t i = a; i <= b; ++i) masked[i] = true;
      continue;
    }
    line.phase = line.sinusoidal ? fit.phase : fit_sinusoid(series, line.frequency).phase;
    // What is left of a line that wavers in amplitude lies within the bandwidth of it: not a line of its own.
    const bool repeated = std::any_of(found.begin(), found.end(), [&](const Found& f) { return std::abs(f.line.frequency - line.frequency) < W; });
    if (!repeated) found.push_back({line, at, s.density[at], dof});
    if (++rounds > 3 * options.max_lines) break;
    for (std::size_t i = a; i <= b; ++i) masked[i] = true;
    if (line.sinusoidal) {
      for (std::size_t i = 0; i < series.x.size(); ++i)
        series.x[i] -= fit.amplitude * std::cos(kTwoPi * fit.frequency * series.step * static_cast<double>(i) + fit.phase);
      s = multitaper(series, mt);
      background = red_noise_background(s, series.step, series.x.size(), out.lowest, out.highest);
    }
  }
  out.background = background;
  out.residual = s.density;
  for (Found& f : found) {
    SpectralLine& line = f.line;
    line.excess = f.density / background[f.bin];
    const double log_p = log_any_of(log_chi2_tail(f.dof * line.excess, f.dof), trials);
    line.false_alarm = std::exp(log_p);
    line.significance = normal_deviate(log_p);
    if (out.axis_rate[1] > 0.0) line.order = line.frequency / out.axis_rate[1];
    if (out.axis_rate[2] > 0.0) line.per_metre = line.frequency / out.axis_rate[2];
    if (out.axis_rate[3] > 0.0) line.per_slip_metre = line.frequency / out.axis_rate[3];
    if (log_p <= std::log(options.false_alarm) && line.share_of_variance >= options.smallest_share) out.lines.push_back(line);
  }
  std::sort(out.lines.begin(), out.lines.end(), [](const SpectralLine& x, const SpectralLine& y) { return x.significance > y.significance; });
  for (std::size_t j = 0; j < out.lines.size(); ++j) {
    for (std::size_t i = 0; i < out.lines.size(); ++i) {
      if (i == j || out.lines[i].harmonic_of >= 0) continue;
      const double ratio = out.lines[j].frequency / out.lines[i].frequency;
      const double n = std::round(ratio);
      if (n < 2.0 || n > kMaxHarmonic) continue;
      const double off = std::abs(out.lines[j].frequency - n * out.lines[i].frequency);
      const double tolerance = std::min(3.0 * (n * out.lines[i].frequency_std + out.lines[j].frequency_std) + 0.1 / length, 1.0 / length);
      if (off > tolerance) continue;
      out.lines[j].harmonic_of = static_cast<int>(i);
      out.lines[j].harmonic = static_cast<int>(n);
      break;
    }
  }

  // Speeds that vary within the run make one axis sharper than the others.
  for (const Axis axis : {Axis::wheel, Axis::travel, Axis::slip_travel}) {
    const double rate = out.axis_rate[static_cast<std::size_t>(axis)];
    if (!(rate > 0.0) || out.lines.empty()) continue;
    std::vector<double> u = axis_coordinate(run, w.series, axis, options.wheel_radius);
    const double whole = u.back();
    if (!(std::abs(whole) > 0.0)) continue;
    double off = 0.0, fastest_line = 0.0;
    for (std::size_t i = 0; i < u.size(); ++i)
      off = std::max(off, std::abs(u[i] / whole - static_cast<double>(i) / static_cast<double>(u.size() - 1)) * length);
    for (const SpectralLine& l : out.lines) fastest_line = std::max(fastest_line, l.frequency);
    if (off * fastest_line < 0.3) continue;
    bool rising = true;
    const double sign = whole > 0.0 ? 1.0 : -1.0;
    for (double& x : u) x *= sign;
    for (std::size_t i = 1; i < u.size(); ++i) rising = rising && u[i] > u[i - 1];
    if (!rising) continue;
    EvenSeries along;
    along.step = u.back() / static_cast<double>(u.size() - 1);
    along.x.resize(u.size());
    std::size_t k = 0;
    for (std::size_t i = 0; i < u.size(); ++i) {
      const double at = along.step * static_cast<double>(i);
      while (k + 2 < u.size() && u[k + 1] < at) ++k;
      const double z = std::clamp((at - u[k]) / (u[k + 1] - u[k]), 0.0, 1.0);
      along.x[i] = (1.0 - z) * w.series.x[k] + z * w.series.x[k + 1];
    }
    out.resampled[axis] = multitaper(along, mt);
  }
  return out;
}

namespace {

// Log odds for a line at f +-tolerance in a run against none there, from the probability p that noise shows at least what
// is seen: LR = 1/2 + 1/2 (p^(-1/2)/2), that is, the line is visible in every other run, and where it is p follows a
// Beta(1/2, 1) law. In noise LR has mean 1, so that the product over runs exceeds c with probability 1/c at most.
// Frequencies within a bandwidth of a line that is already explained say nothing.
double evidence_at(const ChannelSpectrum& c, const std::vector<double>& log_p, double f, double tolerance,
                   const std::vector<double>& explained) {
  for (const double e : explained)
    if (std::abs(e - f) < c.spectrum.half_bandwidth) return 0.0;
  const double length = c.end - c.begin + 1.0 / c.rate;
  const std::size_t a = bin_of(c.spectrum, f - tolerance), b = bin_of(c.spectrum, f + tolerance);
  const double least = log_any_of(*std::min_element(log_p.begin() + static_cast<std::ptrdiff_t>(a), log_p.begin() + static_cast<std::ptrdiff_t>(b) + 1),
                                  1.0 + 2.0 * tolerance * length);
  return std::min(std::log(0.5 + 0.25 * std::exp(std::min(-0.5 * least, 300.0))), kEvidenceCap);
}

// ln of the probability that noise shows what is seen, bin by bin. Sinusoids count at their frequency and not over the
// whole bandwidth of the spectrum, nor where they leak to.
std::vector<double> log_tails(const ChannelSpectrum& c) {
  std::vector<double> out(c.background.size());
  const auto tail = [&](double ratio, std::size_t i) { return log_chi2_tail(c.spectrum.degrees_of_freedom[i] * ratio, c.spectrum.degrees_of_freedom[i]); };
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = tail(c.residual[i] / c.background[i], i);
  for (const SpectralLine& l : c.lines) {
    if (!l.sinusoidal) continue;
    const double reach = std::max(0.5 / (c.end - c.begin), l.frequency_std);
    for (std::size_t i = bin_of(c.spectrum, l.frequency - reach); i <= bin_of(c.spectrum, l.frequency + reach); ++i)
      out[i] = std::min(out[i], tail(l.excess, i));
  }
  return out;
}

double tolerance_of(const ChannelSpectrum& c, double f) {
  const double length = c.end - c.begin + 1.0 / c.rate;
  return std::max(0.5 / length, 0.005 * f);
}

// Within a run of varying speed: how much sharper the line is along `axis` than in time, as log likelihood.
double sharpness(const ChannelSpectrum& c, const SpectralLine& line, Axis axis) {
  if (axis == Axis::time || c.resampled.empty()) return 0.0;
  const auto found = c.resampled.find(axis);
  if (found == c.resampled.end()) return 0.0;
  const double rate = c.axis_rate[static_cast<std::size_t>(axis)];
  auto peak = [](const Spectrum& s, double f) {
    double best = 0.0;
    for (std::size_t i = bin_of(s, f - s.half_bandwidth); i <= bin_of(s, f + s.half_bandwidth); ++i) best = std::max(best, s.density[i]);
    return best;
  };
  const double there = peak(found->second, line.frequency / rate) / rate;  // density per unit of axis, brought to per Hz
  const double here = peak(c.spectrum, line.frequency);
  return static_cast<double>(c.spectrum.tapers) * std::log(std::max(there, 1e-300) / std::max(here, 1e-300));
}

std::string metres(double per_metre) { return fmt::format("{:.3g} mm", 1e3 / per_metre); }

std::string driver_text(Lock lock, double value, double slip_offset, const LineOptions& options, const std::vector<Axis>& tied) {
  const auto near = [&](double x, double to) { return std::abs(x - to) < 0.02 * to + 0.02; };
  switch (lock) {
    case Lock::wheel: {
      if (options.grouser_count && *options.grouser_count > 0) {
        const double passing = value / *options.grouser_count;
        if (passing > 0.5 && near(passing, std::round(passing)))
          return std::round(passing) == 1.0 ? fmt::format("grouser passing ({} per turn)", *options.grouser_count)
                                            : fmt::format("grouser passing, harmonic {:.0f} ({} lugs)", passing, *options.grouser_count);
      }
      if (near(value, 1.0)) return "once per wheel turn: eccentricity or a bent axle";
      if (near(value, std::round(value))) return fmt::format("{:.0f} per wheel turn: lugs or a gear", value);
      return fmt::format("order {:.4g}: gear or drive", value);
    }
    case Lock::time: return "fixed in time: resonance of the rig, drive or mains";
    case Lock::travel: return fmt::format("every {} of travel: the bed, or nodes of a simulated one", metres(value));
    case Lock::slip_travel:
      if (slip_offset > 0.0)
        return fmt::format("every {} of slip beside {} of rim travel: soil failing in blocks", metres(value), metres(slip_offset * value));
      return fmt::format("every {} of slip: soil failing in blocks", metres(value));
    case Lock::undecided: break;
  }
  std::string text;
  for (const Axis a : tied) text += (text.empty() ? "" : " or ") + lock_name(static_cast<Lock>(a));
  return text.empty() ? "no axis holds it" : "cannot be told apart by these runs: " + text;
}

void fit_rate(LineTrack& track, const std::vector<ChannelSpectrum>& runs, double radius) {
  std::vector<std::size_t> use;
  for (std::size_t i = 0; i < track.points.size(); ++i)
    if (track.points[i].line >= 0) use.push_back(i);
  if (use.size() < 3 || !(radius > 0.0)) return;
  const auto n = static_cast<Eigen::Index>(use.size());
  Eigen::MatrixXd A(n, 3);
  Eigen::VectorXd b(n);
  double w_lo = 1e300, w_hi = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const LineTrack::Point& p = track.points[use[static_cast<std::size_t>(i)]];
    const ChannelSpectrum& c = runs[p.run];
    const double rim = c.axis_rate[1] * kTwoPi * radius;
    const double weight = 1.0 / std::max(c.lines[static_cast<std::size_t>(p.line)].frequency_std, 1e-6);
    A(i, 0) = rim * weight;
    A(i, 1) = c.axis_rate[3] * weight;
    A(i, 2) = weight;
    b(i) = p.frequency * weight;
    w_lo = std::min(w_lo, rim);
    w_hi = std::max(w_hi, rim);
  }
  // With one wheel rate alone a constant cannot be told from the wheel's share; where it is not needed it only adds scatter.
  const auto fit = [&](Eigen::Index columns) {
    const Eigen::MatrixXd M = A.leftCols(columns);
    const LeastSquaresSolution solution = solve_least_squares(M, b);
    const Eigen::VectorXd& sv = solution.singular_values;
    if (!(sv(columns - 1) > 1e-3 * sv(0))) return;
    const Eigen::VectorXd& x = solution.x;
    const double scatter = n > columns ? (M * x - b).squaredNorm() / static_cast<double>(n - columns) : 1.0;
    const Eigen::MatrixXd covariance = inverse(M.transpose() * M) * std::max(scatter, 1.0);
    track.has_fit = true;
    track.by_wheel = x(0);
    track.by_slip = x(1);
    track.by_wheel_std = std::sqrt(covariance(0, 0));
    track.by_slip_std = std::sqrt(covariance(1, 1));
    track.by_time = columns == 3 ? x(2) : 0.0;
    track.by_time_std = columns == 3 ? std::sqrt(covariance(2, 2)) : 0.0;
  };
  if (w_hi - w_lo > 0.05 * w_hi && n > 3) fit(3);
  if (!track.has_fit || std::abs(track.by_time) < 3.0 * track.by_time_std) fit(2);
}

}  // namespace

std::vector<LineTrack> follow_lines(std::vector<ChannelSpectrum>& runs, const LineOptions& options) {
  struct Seed {
    std::size_t run, line;
    double significance;
  };
  std::vector<Seed> seeds;
  std::vector<std::vector<bool>> taken(runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r) {
    taken[r].assign(runs[r].lines.size(), false);
    for (std::size_t l = 0; l < runs[r].lines.size(); ++l) seeds.push_back({r, l, runs[r].lines[l].significance});
  }
  std::sort(seeds.begin(), seeds.end(), [](const Seed& a, const Seed& b) {
    if (a.significance != b.significance) return a.significance > b.significance;
    return a.run != b.run ? a.run < b.run : a.line < b.line;
  });
  std::vector<LineTrack> tracks;
  std::vector<std::vector<double>> explained(runs.size()), tails(runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r) tails[r] = log_tails(runs[r]);
  // Slip per rim travel: with one value of it in all runs an offset means nothing.
  double least_slip = 1e300, most_slip = 0.0;
  for (const ChannelSpectrum& c : runs) {
    if (c.background.empty() || !(c.axis_rate[1] > 0.0)) continue;
    const double share = c.axis_rate[3] / c.axis_rate[1];
    least_slip = std::min(least_slip, share);
    most_slip = std::max(most_slip, share);
  }
  const bool several_slips = options.wheel_radius > 0.0 && most_slip > 0.0 && least_slip < 0.8 * most_slip;
  const auto slip_rate = [&](const ChannelSpectrum& c, double offset) {
    return c.axis_rate[3] + offset * kTwoPi * options.wheel_radius * c.axis_rate[1];
  };
  const auto reach_of = [](const ChannelSpectrum& c, double f) { return std::max(2.0 * tolerance_of(c, f), 0.7 * c.spectrum.half_bandwidth); };
  for (const Seed& seed : seeds) {
    if (taken[seed.run][seed.line]) continue;
    const ChannelSpectrum& own = runs[seed.run];
    const SpectralLine& line = own.lines[seed.line];
    LineTrack track;
    track.channel = own.channel;
    double best_q[kAxes] = {0, 0, 0, 0};
    bool known[kAxes] = {false, false, false, false};
    const double spread = std::max(2.0 * line.frequency_std, 0.25 / (own.end - own.begin)) / line.frequency;
    // Best total evidence of the other runs for a line whose rate is q axis units.
    const auto search = [&](const auto& rate_of, double& q_best) {
      const double q0 = line.frequency / rate_of(own);
      double best = -1e300;
      constexpr int kSteps = 8;
      for (int k = -kSteps; k <= kSteps; ++k) {
        const double q = q0 * (1.0 + spread * k / kSteps);
        double total = 0.0;
        for (std::size_t r = 0; r < runs.size(); ++r) {
          if (r == seed.run || runs[r].background.empty()) continue;
          const double f = q * rate_of(runs[r]);
          if (!(f >= runs[r].lowest) || f > runs[r].highest) continue;
          total += evidence_at(runs[r], tails[r], f, tolerance_of(runs[r], f), explained[r]);
        }
        if (total > best + 1e-12 || (k == 0 && total > best - 1e-12)) {
          best = total;
          q_best = q;
        }
      }
      return best;
    };
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (!(own.axis_rate[a] > 0.0)) continue;
      known[a] = true;
      const auto rate_of = [a](const ChannelSpectrum& c) { return c.axis_rate[a]; };
      track.evidence_by_axis[a] = search(rate_of, best_q[a]) + sharpness(own, line, static_cast<Axis>(a));
    }
    if (several_slips && own.axis_rate[1] > 0.0)
      for (const double offset : kSlipOffsets) {
        if (offset == 0.0) continue;
        double q = 0.0;
        const double e = search([&](const ChannelSpectrum& c) { return slip_rate(c, offset); }, q) - kOffsetPrice;
        if (known[3] && e <= track.evidence_by_axis[3]) continue;
        known[3] = true;
        track.evidence_by_axis[3] = e;
        track.slip_offset = offset;
        best_q[3] = q;
      }
    const auto rate_on = [&](std::size_t a, const ChannelSpectrum& c) { return a == 3 ? slip_rate(c, track.slip_offset) : c.axis_rate[a]; };
    std::vector<std::size_t> order;
    for (std::size_t a = 0; a < kAxes; ++a)
      if (known[a]) order.push_back(a);
    std::stable_sort(order.begin(), order.end(), [&](std::size_t x, std::size_t y) { return track.evidence_by_axis[x] > track.evidence_by_axis[y]; });
    const std::size_t winner = order.front();
    const double best = track.evidence_by_axis[winner];
    const double second = order.size() > 1 ? track.evidence_by_axis[order[1]] : 0.0;
    track.evidence = best - second;
    std::vector<Axis> tied;
    for (const std::size_t a : order)
      if (best - track.evidence_by_axis[a] < kDecisive) tied.push_back(static_cast<Axis>(a));
    const auto members = [&](std::size_t a) {
      std::size_t count = 0;
      for (std::size_t r = 0; r < runs.size(); ++r) {
        if (r == seed.run) continue;
        const double f = best_q[a] * rate_on(a, runs[r]);
        for (std::size_t l = 0; l < runs[r].lines.size(); ++l)
          if (!taken[r][l] && std::abs(runs[r].lines[l].frequency - f) < reach_of(runs[r], f)) {
            ++count;
            break;
          }
      }
      return count;
    };
    // Evidence from runs that show no line of their own rests on the background alone: one more run must show it.
    if (best > kDecisive && tied.size() == 1 && (members(winner) > 0 || sharpness(own, line, static_cast<Axis>(winner)) > kDecisive))
      track.locked_to = static_cast<Lock>(winner);
    // A lone run of even speed cannot decide; a known number of lugs at this order can.
    if (track.locked_to == Lock::undecided && options.grouser_count && *options.grouser_count > 0 && known[1] &&
        std::find(tied.begin(), tied.end(), Axis::wheel) != tied.end()) {
      const double passing = line.order / *options.grouser_count;
      const double tolerance = (3.0 * line.frequency_std + 0.25 / (own.end - own.begin)) / own.axis_rate[1] / *options.grouser_count;
      if (passing > 0.5 && std::abs(passing - std::round(passing)) < std::max(tolerance, 0.01)) track.locked_to = Lock::wheel;
    }
    const std::size_t axis = track.locked_to == Lock::undecided ? winner : static_cast<std::size_t>(track.locked_to);
    track.value = best_q[axis];
    track.value_std = line.frequency_std / rate_on(axis, own);
    if (track.locked_to != Lock::slip_travel) track.slip_offset = axis == 3 ? track.slip_offset : 0.0;
    // Lines of other runs that lie where this axis puts them belong to the track.
    double weights = 0.0, mean = 0.0;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      if (runs[r].background.empty()) continue;
      const double f = r == seed.run ? line.frequency : track.value * rate_on(axis, runs[r]);
      if (r != seed.run && (track.locked_to == Lock::undecided && best <= kDecisive)) continue;
      if (r != seed.run && (!(f >= runs[r].lowest) || f > runs[r].highest)) continue;
      LineTrack::Point point;
      point.run = r;
      point.frequency = f;
      if (r == seed.run) {
        point.line = static_cast<int>(seed.line);
      } else {
        double nearest = reach_of(runs[r], f);
        for (std::size_t l = 0; l < runs[r].lines.size(); ++l) {
          if (taken[r][l] || std::abs(runs[r].lines[l].frequency - f) > nearest) continue;
          nearest = std::abs(runs[r].lines[l].frequency - f);
          point.line = static_cast<int>(l);
        }
      }
      if (point.line >= 0) {
        const SpectralLine& l = runs[r].lines[static_cast<std::size_t>(point.line)];
        taken[r][static_cast<std::size_t>(point.line)] = true;
        explained[r].push_back(l.frequency);
        point.frequency = l.frequency;
        point.amplitude = l.amplitude;
        const double deviation = std::max(l.frequency_std, 0.02 / (runs[r].end - runs[r].begin)) / rate_on(axis, runs[r]);
        weights += 1.0 / (deviation * deviation);
        mean += l.frequency / rate_on(axis, runs[r]) / (deviation * deviation);
      } else {
        const std::size_t i = bin_of(runs[r].spectrum, f);
        const double above = std::max(runs[r].spectrum.density[i] - runs[r].background[i], 0.0);
        point.amplitude = std::sqrt(2.0 * above * 2.0 * runs[r].spectrum.half_bandwidth);
      }
      track.points.push_back(point);
    }
    if (weights > 0.0) {
      track.value = mean / weights;
      track.value_std = 1.0 / std::sqrt(weights);
    }
    fit_rate(track, runs, options.wheel_radius);
    if (track.locked_to == Lock::slip_travel && track.slip_offset > 0.0 && track.has_fit && track.by_time == 0.0 &&
        track.by_slip > 0.0 && track.by_wheel > 0.0) {
      // The fit to all its points is finer than the offsets that were tried.
      track.value = track.by_slip;
      track.value_std = track.by_slip_std;
      track.slip_offset = track.by_wheel / track.by_slip;
    }
    const bool alone = track.locked_to == Lock::undecided && tied.size() == 1;
    track.driver = alone ? "shown by one run alone" : driver_text(track.locked_to, track.value, track.slip_offset, options, tied);
    for (const LineTrack::Point& p : track.points) {
      if (p.line < 0) continue;
      SpectralLine& l = runs[p.run].lines[static_cast<std::size_t>(p.line)];
      l.locked_to = track.locked_to;
      l.lock_evidence = track.evidence;
      l.driver = track.driver;
    }
    tracks.push_back(std::move(track));
  }
  return tracks;
}

Oscillation analyse_oscillation(const std::vector<recording::Run>& runs, std::vector<std::string> channels,
                                const LineOptions& options, int threads) {
  throw_if_any(options.validate());
  Oscillation out;
  if (channels.empty())
    for (const std::string& name : recording::channel::names()) {
      if (name == recording::channel::angular_velocity || name == recording::channel::forward_velocity) continue;
      for (const recording::Run& r : runs)
        if (!r.time.empty() && r.find(name)) {
          channels.push_back(name);
          break;
        }
    }
  out.channels = channels;
  const std::size_t per_channel = runs.size();
  std::vector<ChannelSpectrum> all(channels.size() * per_channel);
  parallel_for(all.size(), threads, [&](std::size_t i) {
    const recording::Run& run = runs[i % per_channel];
    const std::string& name = channels[i / per_channel];
    all[i].channel = name;
    if (!run.time.empty() && run.find(name)) all[i] = channel_spectrum(run, name, options);
  });
  for (std::size_t c = 0; c < channels.size(); ++c) {
    std::vector<ChannelSpectrum>& s = out.spectra[channels[c]];
    s.assign(std::make_move_iterator(all.begin() + static_cast<std::ptrdiff_t>(c * per_channel)),
             std::make_move_iterator(all.begin() + static_cast<std::ptrdiff_t>((c + 1) * per_channel)));
    out.tracks[channels[c]] = follow_lines(s, options);
  }
  return out;
}

Coherence line_coherence(const recording::Run& run, const ChannelSpectrum& of, const std::string& other, double frequency, const LineOptions& options) {
  LineOptions same = options;
  same.begin = of.begin - 1e-9;
  same.end = of.end + 1e-9;
  const Windowed a = window_of(run, of.channel, same), b = window_of(run, other, same);
  if (!a.usable || !b.usable || a.series.x.size() != b.series.x.size()) return {};
  return coherence_at(a.series, b.series, frequency, {options.nw, options.tapers, 4});
}

std::optional<Resonance> resonance_near(const EvenSeries& series, double frequency) {
  if (!(frequency > 0.0) || series.x.size() < kFewestSamples) return std::nullopt;
  // About eight samples a period: more makes the model spend its order on the smoothness of the signal.
  const auto thinned = std::max<std::size_t>(static_cast<std::size_t>(1.0 / (8.0 * frequency * series.step)), 1);
  std::vector<double> x(series.x.size() / thinned, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i)
    for (std::size_t k = 0; k < thinned; ++k) x[i] += series.x[i * thinned + k] / static_cast<double>(thinned);
  if (x.size() < 24) return std::nullopt;
  const double dt = series.step * static_cast<double>(thinned);
  // Forward prediction by least squares, unlike Burg's, is right for a decaying signal too. Order by AICc.
  double mean = 0.0;
  for (const double v : x) mean += v / static_cast<double>(x.size());
  for (double& v : x) v -= mean;
  Eigen::VectorXd coefficients;
  double best_score = std::numeric_limits<double>::infinity();
  const int highest = std::min<int>(kResonanceOrder, static_cast<int>(x.size() / 6));
  const auto rows = static_cast<Eigen::Index>(x.size()) - highest;
  Eigen::MatrixXd moments = Eigen::MatrixXd::Zero(highest + 1, highest + 1);
  for (Eigen::Index i = 0; i <= highest; ++i)
    for (Eigen::Index j = i; j <= highest; ++j) {
      double sum = 0.0;
      for (Eigen::Index n = highest; n < highest + rows; ++n) sum += x[static_cast<std::size_t>(n - i)] * x[static_cast<std::size_t>(n - j)];
      moments(i, j) = moments(j, i) = sum;
    }
  for (Eigen::Index m = 2; m <= highest; m += 2) {
    const Eigen::VectorXd a = solve_symmetric(moments.block(1, 1, m, m), moments.block(1, 0, m, 1));
    const double error = moments(0, 0) - a.dot(moments.block(1, 0, m, 1).col(0));
    const double n = static_cast<double>(rows), k = static_cast<double>(m) + 1.0;
    const double score = n * std::log(std::max(error, 1e-14 * moments(0, 0))) + 2.0 * k * n / std::max(n - k - 1.0, 1.0);
    if (score < best_score) {
      best_score = score;
      coefficients = a;
    }
  }
  const Eigen::Index p = coefficients.size();
  if (p < 2) return std::nullopt;
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(p, p);
  for (Eigen::Index i = 0; i < p; ++i) companion(0, i) = coefficients(i);
  for (Eigen::Index i = 1; i < p; ++i) companion(i, i - 1) = 1.0;
  const Eigen::VectorXcd poles = eigenvalues(companion);
  std::optional<Resonance> best;
  for (Eigen::Index i = 0; i < p; ++i) {
    if (poles(i).imag() <= 0.0) continue;
    const std::complex<double> s = std::log(poles(i)) / dt;
    const double f = std::abs(s) / kTwoPi, damping = -s.real() / std::abs(s);
    if (std::abs(f - frequency) > 0.1 * frequency) continue;
    if (best && best->damping <= damping) continue;
    const double length = series.length();
    best = Resonance{f, std::max(damping, 0.0), std::sqrt(std::max(damping, 1e-12) / (kTwoPi * f * length))};
  }
  return best;
}

double contact_eigenfrequency(double stiffness, double mass) {
  if (!(stiffness > 0.0) || !(mass > 0.0)) throw InputError("an eigenfrequency needs a stiffness and a mass above 0");
  return std::sqrt(stiffness / mass) / kTwoPi;
}

}  // namespace terrode::analysis
