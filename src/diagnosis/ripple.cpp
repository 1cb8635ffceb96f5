#include "diagnosis/ripple.h"

#include <gsl/gsl_fft_real.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/linear_algebra.h"
#include "core/statistics.h"

namespace terrode::diagnosis {
namespace {

// Power over its local background on an even grid of frequencies, for one run.
struct Spectrum {
  double step = 0, top = 0, resolution = 0;  // Hz
  std::array<std::vector<double>, kChannels> ratio, amplitude;
  const Condition* condition = nullptr;
  double rim_speed = 0, rim_force = 0, pull_deviation = 0;
};

// A series less its least-squares sinusoid of so much angle a sample [rad].
Eigen::VectorXd without_line(const Eigen::VectorXd& y, double turn) {
  Eigen::MatrixXd a(y.size(), 2);
  for (Eigen::Index i = 0; i < y.size(); ++i) a.row(i) << std::cos(turn * static_cast<double>(i)), std::sin(turn * static_cast<double>(i));
  return y - a * solve_symmetric(a.transpose() * a, a.transpose() * y);
}

bool spectrum_of(const Campaign& c, const RunData& run, double run_in_length, Spectrum& out) {
  if (run.time.size() < 64) return false;
  const Condition& q = c.conditions[static_cast<std::size_t>(run.condition)];
  out.condition = &q;
  out.rim_speed = q.angular_velocity > 0 ? q.angular_velocity * c.wheel.radius : q.forward_velocity;
  double begin = out.rim_speed > 0 ? 4.0 * run_in_length / out.rim_speed : 0.0;
  begin = std::min(begin, 0.5 * run.time.back());
  const auto first = static_cast<std::size_t>(std::lower_bound(run.time.begin(), run.time.end(), begin) - run.time.begin());
  const std::size_t n = run.time.size() - first;
  if (n < 48) return false;
  const double duration = run.time.back() - run.time[first];
  const double dt = duration / static_cast<double>(n - 1);
  std::size_t size = 256;
  while (size < 4 * n) size *= 2;
  out.step = 1.0 / (dt * static_cast<double>(size));
  out.top = 0.5 / dt;
  out.resolution = 1.0 / duration;
  bool any = false;
  for (std::size_t ch = 0; ch < kChannels; ++ch) {
    if (run.series[ch].empty()) continue;
    // On an even grid, without its cubic trend, under a Hann window.
    Eigen::MatrixXd a(static_cast<Eigen::Index>(n), 4);
    Eigen::VectorXd y(static_cast<Eigen::Index>(n));
    std::size_t k = first;
    bool whole = true;
    for (std::size_t i = 0; i < n; ++i) {
      const double t = run.time[first] + dt * static_cast<double>(i);
      while (k + 2 < run.time.size() && run.time[k + 1] < t) ++k;
      const double u = std::clamp((t - run.time[k]) / (run.time[k + 1] - run.time[k]), 0.0, 1.0);
      const auto e = static_cast<Eigen::Index>(i);
      y(e) = (1 - u) * run.series[ch][k] + u * run.series[ch][k + 1];
      whole = whole && std::isfinite(y(e));
      const double s = 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0;
      a.row(e) << 1, s, s * s, s * s * s;
    }
    if (!whole) continue;
    if (ch == 1) out.rim_force = std::abs(y.mean()) / c.wheel.radius;
    y -= a * solve_symmetric(a.transpose() * a, a.transpose() * y);
    if (ch == 0) out.pull_deviation = std::sqrt(y.squaredNorm() / static_cast<double>(n));
    std::vector<double> padded(size, 0.0);
    double window_sum = 0, window_squares = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double w = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(n));
      padded[i] = w * y(static_cast<Eigen::Index>(i));
      window_sum += w;
      window_squares += w * w;
    }
    gsl_fft_real_radix2_transform(padded.data(), 1, size);
    std::vector<double> power(size / 2);
    for (std::size_t i = 1; i < size / 2; ++i) power[i] = padded[i] * padded[i] + padded[size - i] * padded[size - i];
    power[0] = power[1];
    // What wanders shows most at low rates however far the median looks around: an autoregressive process of the variance and
    // memory that the strongest line leaves is background too.
    const Eigen::VectorXd rest = without_line(y, 2.0 * std::numbers::pi * static_cast<double>(std::max_element(power.begin(), power.end()) - power.begin()) / static_cast<double>(size));
    const double variance = rest.squaredNorm() / static_cast<double>(n);
    const double memory = variance > 0 ? std::clamp(rest.head(rest.size() - 1).dot(rest.tail(rest.size() - 1)) / rest.squaredNorm(), 0.0, 0.999) : 0.0;
    // Background: median within +-1.5 Hz (or a tenth of the band), over ln 2 to make it a mean of exponentials.
    const auto half = static_cast<std::ptrdiff_t>(std::max(0.1 * out.top, std::min(1.5, 0.4 * out.top)) / out.step);
    out.ratio[ch].resize(power.size());
    out.amplitude[ch].resize(power.size());
    const auto count = static_cast<std::ptrdiff_t>(power.size());
    double level = 0;
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      if (i % 8 == 0) {
        const auto lo = std::clamp<std::ptrdiff_t>(i - half, 0, std::max<std::ptrdiff_t>(0, count - 2 * half)), hi = std::min(count, lo + 2 * half);
        level = median({power.begin() + lo, power.begin() + hi}) / std::numbers::ln2;
      }
      const auto e = static_cast<std::size_t>(i);
      const double turn = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(size);
      const double wander = window_squares * variance * (1.0 - memory * memory) / (1.0 - 2.0 * memory * std::cos(turn) + memory * memory);
      const double background = std::max(level, wander);
      out.ratio[ch][e] = background > 0 ? power[e] / background : 0.0;
      out.amplitude[ch][e] = 2.0 * std::sqrt(power[e]) / window_sum;
    }
    any = true;
  }
  return any;
}

// Power over background beyond which a run counts little more: the nearest of several orders still leads.
constexpr double kLoud = 60.0;

// Neighbouring laws whose scores differ by less have found the same line.
constexpr double kSameLine = 0.98;

// A line must repeat so often within a run: fewer periods are a trend as well. Waves of a bed are long.
double fewest_periods(Lock lock) { return lock == Lock::travel ? 2.0 : 4.0; }

std::vector<Spectrum> spectra_of(const Campaign& campaign, double run_in_length) {
  std::vector<Spectrum> out;
  for (const RunData& run : campaign.runs) {
    Spectrum s;
    if (spectrum_of(campaign, run, run_in_length, s)) out.push_back(std::move(s));
  }
  return out;
}

// Largest value near a frequency; -1 where it is out of the run's band.
double near_max(const Spectrum& s, const std::vector<double>& v, double f, double tolerance, double fewest) {
  if (v.empty() || f < fewest * s.resolution || f > 0.9 * s.top) return -1;
  const double width = std::max(0.5 * s.resolution, tolerance * f);
  const auto lo = static_cast<std::size_t>(std::max(0.0, std::floor((f - width) / s.step)));
  const auto hi = std::min(v.size() - 1, static_cast<std::size_t>(std::ceil((f + width) / s.step)));
  double best = 0;
  for (std::size_t i = lo; i <= hi; ++i) best = std::max(best, v[i]);
  return best;
}

double frequency_in(const RippleLine& l, const Spectrum& s) {
  switch (l.lock) {
    case Lock::wheel: return l.order * s.condition->angular_velocity / (2 * std::numbers::pi);
    case Lock::slip_path: {
      const double a = std::isfinite(s.condition->slip) ? std::abs(s.condition->slip) : 1.0;
      return s.rim_speed * (l.share + (1 - l.share) * a) / l.wavelength;
    }
    case Lock::time: return l.frequency;
    case Lock::travel: return s.condition->forward_velocity / l.wavelength;
  }
  return 0;
}

// A failing soil's rate wanders; the other lines are sharp.
double tolerance_of(Lock lock) { return lock == Lock::slip_path ? 0.04 : 0.008; }

void judge(RippleLine& line, const std::vector<Spectrum>& spectra) {
  double total = 0;
  int used = 0;
  std::array<std::vector<double>, kChannels> amplitudes, ratios;
  std::vector<double> relative;
  for (const Spectrum& s : spectra) {
    const double f = frequency_in(line, s), tol = tolerance_of(line.lock), fewest = fewest_periods(line.lock);
    double sum = 0;
    int n = 0;
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      const double r = near_max(s, s.ratio[ch], f, tol, fewest);
      if (r < 0) continue;
      ratios[ch].push_back(r);
      amplitudes[ch].push_back(near_max(s, s.amplitude[ch], f, tol, fewest));
      sum = std::max(sum, r);
      ++n;
      if (ch == 0 && s.rim_force > 0) relative.push_back(amplitudes[0].back() / s.rim_force);
    }
    if (!n) continue;
    total += sum < kLoud ? sum : kLoud + 0.1 * kLoud * std::log(sum / kLoud);  // one loud run is not a law
    ++used;
  }
  // A law that few runs can show is no law of the campaign.
  line.score = used >= std::max(3, static_cast<int>(spectra.size()) / 3) ? total / used : 0.0;
  for (std::size_t ch = 0; ch < kChannels; ++ch) {
    line.amplitude[ch] = median(amplitudes[ch]);
    line.channel_score[ch] = median(ratios[ch]);
  }
  line.relative = median(relative);
}

// A wheel that runs out of round once per turn lifts its axle by the same amount in every run, whatever phase a run
// starts at: a sine of the wheel's angle in the sinkage, in the runs that turn far enough to tell it from a trend.
RippleLine find_eccentricity(const Campaign& c, double run_in_length) {
  RippleLine out;
  out.lock = Lock::wheel;
  out.order = 1;
  std::vector<double> size, significance, torque, pull;
  for (const RunData& run : c.runs) {
    const Condition& q = c.conditions[static_cast<std::size_t>(run.condition)];
    if (run.time.size() < 64 || run.series[2].empty() || !(q.angular_velocity > 0)) continue;
    const double begin = std::min(4.0 * run_in_length / (q.angular_velocity * c.wheel.radius), 0.5 * run.time.back());
    const auto first = static_cast<std::size_t>(std::lower_bound(run.time.begin(), run.time.end(), begin) - run.time.begin());
    const double turns = q.angular_velocity * (run.time.back() - run.time[first]) / (2 * std::numbers::pi);
    const auto n = static_cast<Eigen::Index>(run.time.size() - first);
    if (turns < 0.8 || turns > 0.2 * static_cast<double>(n)) continue;
    Eigen::MatrixXd a(n, 4);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = run.time[first + static_cast<std::size_t>(i)], psi = q.angular_velocity * t;
      a.row(i) << 1, t, std::cos(psi), std::sin(psi);
    }
    const Eigen::MatrixXd normal = inverse(a.transpose() * a);
    std::array<double, kChannels> amplitude{};
    double sigma = 0;
    bool whole = true;
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      if (run.series[ch].empty()) continue;
      Eigen::VectorXd y(n);
      for (Eigen::Index i = 0; i < n; ++i) y(i) = run.series[ch][first + static_cast<std::size_t>(i)];
      if (!y.allFinite()) {
        whole = false;
        break;
      }
      const Eigen::VectorXd x = normal * (a.transpose() * y), left = y - a * x;
      amplitude[ch] = std::hypot(x(2), x(3));
      if (ch != 2) continue;
      const double rho = std::clamp(left.head(n - 1).dot(left.tail(n - 1)) / std::max(1e-300, left.squaredNorm()), 0.0, 0.95);
      sigma = std::sqrt(left.squaredNorm() / static_cast<double>(n - 4) * std::max(normal(2, 2), normal(3, 3)) * (1 + rho) / (1 - rho));
    }
    if (!whole || !(sigma > 0)) continue;
    size.push_back(amplitude[2]);
    significance.push_back(amplitude[2] / sigma);
    pull.push_back(amplitude[0]);
    torque.push_back(amplitude[1]);
  }
  if (size.size() < 2) return out;
  const double middle = median(size), least = *std::min_element(significance.begin(), significance.end());
  double spread = 0;
  for (const double v : size) spread = std::max(spread, std::abs(v / middle - 1.0));
  if (least < 5.0 || spread > 0.5) return out;
  out.score = median(significance);
  out.deviations = least * std::sqrt(static_cast<double>(size.size()));
  out.amplitude = {median(pull), median(torque), middle};
  out.channel_score = {0, 0, 100};
  return out;
}

}  // namespace

const char* lock_name(Lock lock) {
  switch (lock) {
    case Lock::wheel: return "wheel";
    case Lock::slip_path: return "slip_travel";
    case Lock::time: return "time";
    case Lock::travel: return "travel";
  }
  return "";
}

RippleLine same_law(const RippleLine& line, const Campaign& campaign, double run_in_length) {
  RippleLine out = line;
  judge(out, spectra_of(campaign, run_in_length));
  return out;
}

RippleSearch find_ripples(const Campaign& campaign, double run_in_length) {
  RippleSearch out;
  const std::vector<Spectrum> spectra = spectra_of(campaign, run_in_length);
  out.runs = static_cast<int>(spectra.size());
  std::vector<double> rough;
  for (const Spectrum& s : spectra)
    if (s.rim_force > 0) rough.push_back(s.pull_deviation / s.rim_force);
  if (!rough.empty()) out.roughness = median(rough);
  if (spectra.size() < 3) return out;
  double top = 0;
  for (const Spectrum& s : spectra) top = std::max(top, s.top);
  std::array<std::vector<RippleLine>, 4> laws;
  for (int n = 1; n <= kMostLugs; ++n) {
    RippleLine l;
    l.lock = Lock::wheel;
    l.order = n;
    laws[0].push_back(l);
  }
  for (const double q : {0.0, 0.05, 0.1, 0.15, 0.2, 0.3})
    for (double w = 3e-3; w < 0.08; w *= 1.03) {
      RippleLine l;
      l.lock = Lock::slip_path;
      l.share = q;
      l.wavelength = w;
      laws[1].push_back(l);
    }
  for (double f = 0.3; f < 0.9 * top; f += std::max(0.03, 0.008 * f)) {
    RippleLine l;
    l.lock = Lock::time;
    l.frequency = f;
    laws[2].push_back(l);
  }
  for (double w = 1e-3; w < 0.25; w *= 1.012) {
    RippleLine l;
    l.lock = Lock::travel;
    l.wavelength = w;
    laws[3].push_back(l);
  }
  for (auto& family : laws) {
    std::vector<double> scores;
    for (RippleLine& l : family) {
      judge(l, spectra);
      if (l.score > 0) scores.push_back(l.score);
    }
    if (scores.size() < 10) continue;
    const double middle = median(scores);
    std::vector<double> away;
    for (const double s : scores) away.push_back(std::abs(s - middle));
    const double spread = std::max(1.4826 * median(away), 2.0 / std::sqrt(static_cast<double>(spectra.size())));
    // A line is as wide as the runs are short: its law is the middle of the neighbours that take the same bins.
    const RippleLine& top_of = *std::max_element(family.begin(), family.end(), [](const RippleLine& a, const RippleLine& b) { return a.score < b.score; });
    const auto same_line = [&](std::size_t i) { return family[i].share == top_of.share && family[i].score > kSameLine * top_of.score; };
    std::size_t first = static_cast<std::size_t>(&top_of - family.data()), last = first;
    while (first > 0 && same_line(first - 1)) --first;
    while (last + 1 < family.size() && same_line(last + 1)) ++last;
    RippleLine* best = &family[(first + last) / 2];
    best->deviations = (best->score - middle) / spread;
    // Largest of a few hundred robust deviates: 6 is beyond chance at well under one in a thousand campaigns.
    if (best->deviations > 6.0 && best->score > 2.0 * middle) out.lines.push_back(*best);
  }
  std::sort(out.lines.begin(), out.lines.end(), [](const RippleLine& a, const RippleLine& b) { return a.score > b.score; });
  // The same line seen through another lock (all runs at one speed, say): the weaker one is the stronger one's shadow
  // unless it lies elsewhere in most runs. Where both fit as well they are alternatives.
  std::vector<RippleLine> kept;
  for (const RippleLine& l : out.lines) {
    bool shadow = false;
    for (RippleLine& k : kept) {
      int same = 0, both = 0;
      for (const Spectrum& s : spectra) {
        const double f = frequency_in(l, s), g = frequency_in(k, s);
        if (f < 2 * s.resolution || g < 2 * s.resolution) continue;
        ++both;
        if (std::abs(f - g) < std::max(2.0 * s.resolution, 0.06 * g)) ++same;
      }
      const bool mostly = both > 0 && 3 * same > both;
      if (mostly && l.score > 0.85 * k.score && 10 * same > 9 * both) {
        k.alternatives.push_back(l.lock);
        if (l.lock == Lock::wheel) k.order = l.order;
        if (l.lock == Lock::time) k.frequency = l.frequency;
        if (k.wavelength == 0.0) k.wavelength = l.wavelength;
      }
      shadow = shadow || mostly;
    }
    if (!shadow) kept.push_back(l);
  }
  const RippleLine once = find_eccentricity(campaign, run_in_length);
  if (once.score > 0) {
    // The same line may have been seen through another lock.
    std::erase_if(kept, [&](const RippleLine& l) {
      int same = 0, both = 0;
      for (const Spectrum& s : spectra) {
        const double f = frequency_in(l, s), g = frequency_in(once, s);
        if (f < s.resolution || g < s.resolution) continue;
        ++both;
        if (std::abs(f - g) < 1.5 * s.resolution) ++same;
      }
      return both > 0 && 2 * same > both;
    });
    kept.push_back(once);
  }
  out.lines = std::move(kept);
  return out;
}

}  // namespace terrode::diagnosis
