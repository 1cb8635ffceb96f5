#include "analysis/steady_state.h"

#include <fmt/format.h>
#include <gsl/gsl_cdf.h>

#include <algorithm>
#include <cmath>

#include "analysis/autoregression.h"

namespace terrode::analysis {
namespace {

constexpr std::size_t kMinSamples = 8;
constexpr std::size_t kBatches = 200;         // a longer run is put into this many
constexpr std::size_t kSamplesPerBatch = 5;   // MSER-5
constexpr std::size_t kScatterBatches = 16;
constexpr int kMaxOrder = 12;

struct Series {
  std::vector<double> t, x;
  std::vector<std::size_t> index;  // sample of the run
};

// Means over equal pieces of time; an empty piece takes the line between its neighbours.
struct Batches {
  double width = 0.0;  // s
  std::vector<double> mean;
};

Batches batch_means(const Series& s, std::size_t from, std::size_t to, std::size_t count) {
  Batches out;
  const double t0 = s.t[from];
  const std::size_t n = to - from;
  // n samples cover n intervals, not n - 1: the last one lasts as long as the others.
  const double length = (s.t[to - 1] - t0) * static_cast<double>(n) / static_cast<double>(n - 1);
  out.width = length / static_cast<double>(count);
  std::vector<double> sum(count, 0.0);
  std::vector<std::size_t> hits(count, 0);
  for (std::size_t i = from; i < to; ++i) {
    const auto b = std::min(count - 1, static_cast<std::size_t>((s.t[i] - t0) / out.width + 1e-9));
    sum[b] += s.x[i];
    ++hits[b];
  }
  out.mean.resize(count);
  std::size_t last = 0;
  for (std::size_t b = 0; b < count; ++b) {
    if (hits[b] == 0) continue;
    out.mean[b] = sum[b] / static_cast<double>(hits[b]);
    for (std::size_t k = last + 1; k < b; ++k) {
      const double u = static_cast<double>(k - last) / static_cast<double>(b - last);
      out.mean[k] = (1.0 - u) * out.mean[last] + u * out.mean[b];
    }
    last = b;
  }
  for (std::size_t k = last + 1; k < count; ++k) out.mean[k] = out.mean[last];
  return out;
}

// The number of batches to cut by MSER.
std::size_t mser_cut(const std::vector<double>& y, double max_discard) {
  const std::size_t n = y.size();
  const auto limit = static_cast<std::size_t>(max_discard * static_cast<double>(n));
  std::size_t best = 0;
  double best_value = std::numeric_limits<double>::infinity();
  // From the end, so that mean and sum of squares grow by one batch at a time (Welford).
  double mean = 0.0, squares = 0.0;
  for (std::size_t taken = 1; taken <= n; ++taken) {
    const std::size_t d = n - taken;
    const double delta = y[d] - mean;
    mean += delta / static_cast<double>(taken);
    squares += delta * (y[d] - mean);
    if (d > limit) continue;
    const double value = squares / (static_cast<double>(taken) * static_cast<double>(taken));
    if (value <= best_value) {
      best_value = value;
      best = d;
    }
  }
  return best;
}

struct Line {
  double mean = 0.0, slope = 0.0, centre = 0.0;
};

Line fit_line(const Series& s, std::size_t from, std::size_t to) {
  Line l;
  const double n = static_cast<double>(to - from);
  for (std::size_t i = from; i < to; ++i) {
    l.mean += s.x[i];
    l.centre += s.t[i];
  }
  l.mean /= n;
  l.centre /= n;
  double sxx = 0.0, sxy = 0.0;
  for (std::size_t i = from; i < to; ++i) {
    const double u = s.t[i] - l.centre;
    sxx += u * u;
    sxy += u * (s.x[i] - l.mean);
  }
  l.slope = sxx > 0.0 ? sxy / sxx : 0.0;
  return l;
}

struct ZeroFrequency {
  double density = 0.0;             // two-sided, unit^2 s
  double degrees_of_freedom = 1.0;
};

// Spectral density at frequency zero of the series less its line (or less its mean).
ZeroFrequency density_at_zero(const Series& s, std::size_t from, std::size_t to, const Line& line, bool remove_slope) {
  Series r;
  r.t.assign(s.t.begin() + static_cast<std::ptrdiff_t>(from), s.t.begin() + static_cast<std::ptrdiff_t>(to));
  r.x.resize(r.t.size());
  for (std::size_t i = 0; i < r.t.size(); ++i)
    r.x[i] = s.x[from + i] - line.mean - (remove_slope ? line.slope * (r.t[i] - line.centre) : 0.0);
  const std::size_t n = r.t.size();
  ZeroFrequency out;
  const std::size_t count = std::min(n, std::max<std::size_t>(kBatches, kMinSamples));
  const Batches fine = batch_means(r, 0, n, count);
  const AutoRegression model = fit_burg_best(fine.mean, std::min<int>(kMaxOrder, static_cast<int>(count / 8)));
  const double by_model = model.spectrum(0.0) * fine.width;
  const double removed = remove_slope ? 2.0 : 1.0;
  const std::size_t coarse_count = std::min(kScatterBatches, n / 2);
  const Batches coarse = batch_means(r, 0, n, coarse_count);
  double squares = 0.0;
  for (const double y : coarse.mean) squares += y * y;
  const double by_batches = squares / std::max(1.0, static_cast<double>(coarse_count) - removed) * coarse.width;
  out.density = std::max(by_model, by_batches);
  // An autoregression of order p leaves about n/(2p) degrees of freedom to its density (Fuller 1996, section 7.3); with
  // strong correlation the effective number of samples limits them.
  double variance = 0.0;
  for (const double y : fine.mean) variance += y * y;
  variance /= static_cast<double>(count);
  const double length = fine.width * static_cast<double>(count);
  const double effective = out.density > 0.0 ? variance * length / out.density : static_cast<double>(count);
  const double order = static_cast<double>(model.coefficients.size());
  out.degrees_of_freedom =
      std::clamp(std::min(effective, static_cast<double>(count) / std::max(1.0, 2.0 * order)) - removed, 1.0, 1000.0);
  return out;
}

bool same(const std::optional<double>& a, const std::optional<double>& b) {
  if (a.has_value() != b.has_value()) return false;
  return !a || std::abs(*a - *b) <= 1e-6 * std::max(std::abs(*a), std::abs(*b));
}

bool same_condition(const recording::Condition& a, const recording::Condition& b) {
  const bool slip = a.slip == b.slip || std::abs(a.slip - b.slip) <= 1e-9;
  return slip && a.pass == b.pass && same(a.normal_load, b.normal_load) && same(a.angular_velocity, b.angular_velocity) &&
         same(a.forward_velocity, b.forward_velocity);
}

}  // namespace

Problems SteadyOptions::validate() const {
  Problems out;
  require(out, "max_discard", max_discard, "", max_discard >= 0.0 && max_discard < 1.0, "a share from 0 to below 1");
  require(out, "drift_level", drift_level, "", drift_level > 0.0 && drift_level < 1.0, "a probability between 0 and 1");
  require(out, "drift_tolerance", drift_tolerance, "", drift_tolerance >= 0.0, "a share of at least 0");
  if (period) require(out, "period", *period, "s", *period > 0.0, "a time above 0");
  if (begin) require(out, "begin", *begin, "s", true, "a time");
  if (end) require(out, "end", *end, "s", !begin || *end > *begin, "a time after begin");
  return out;
}

SteadyState steady_state(std::span<const double> time, std::span<const double> values, const SteadyOptions& options) {
  throw_if_any(options.validate());
  if (time.size() != values.size())
    throw InputError(fmt::format("a series has {} times and {} values", time.size(), values.size()));
  SteadyState out;
  Series s;
  s.t.reserve(time.size());
  s.x.reserve(time.size());
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!std::isfinite(values[i]) || !std::isfinite(time[i])) continue;
    if (options.end && time[i] > *options.end) continue;
    if (!s.t.empty() && time[i] <= s.t.back()) throw InputError(fmt::format("time {} s does not increase", time[i]));
    s.t.push_back(time[i]);
    s.x.push_back(values[i]);
    s.index.push_back(i);
  }
  const std::size_t n = s.t.size();
  if (n < kMinSamples) {
    out.reason = n == 0 ? "no samples" : "too short";
    if (n > 0) {
      out.begin = s.index.front();
      out.end = s.index.back() + 1;
      out.begin_time = s.t.front();
      out.end_time = s.t.back();
      out.samples = n;
      for (const double x : s.x) out.mean += x / static_cast<double>(n);
    }
    return out;
  }

  std::size_t from = 0;
  if (options.begin) {
    from = static_cast<std::size_t>(std::lower_bound(s.t.begin(), s.t.end(), *options.begin) - s.t.begin());
  } else {
    const std::size_t batches = std::clamp(n / kSamplesPerBatch, std::min<std::size_t>(n, 10), kBatches);
    const Batches b = batch_means(s, 0, n, batches);
    const double cut = s.t.front() + b.width * static_cast<double>(mser_cut(b.mean, options.max_discard));
    from = static_cast<std::size_t>(std::lower_bound(s.t.begin(), s.t.end(), cut - 1e-9 * b.width) - s.t.begin());
  }
  if (n - std::min(from, n) < kMinSamples) {
    out.reason = "too short";
    from = n >= kMinSamples ? n - kMinSamples : 0;
  }
  if (options.period) {
    const double step = (s.t.back() - s.t[from]) / static_cast<double>(n - 1 - from);
    const double length = s.t.back() - s.t[from] + step;
    // A window that is short of a whole period by less than half a sample still holds it.
    const auto whole = static_cast<std::size_t>(length / *options.period + 0.5 * step / *options.period);
    if (whole > 0) {
      const double begin = s.t.back() + step - static_cast<double>(whole) * *options.period;
      const auto at = static_cast<std::size_t>(std::lower_bound(s.t.begin(), s.t.end(), begin - 0.5 * step) - s.t.begin());
      if (n - at >= kMinSamples) {
        from = at;
        out.periods = whole;
      }
    }
  }

  out.begin = s.index[from];
  out.end = s.index.back() + 1;
  out.begin_time = s.t[from];
  out.end_time = s.t.back();
  out.samples = n - from;
  const Line line = fit_line(s, from, n);
  out.mean = line.mean;
  out.drift = line.slope;
  double squares = 0.0;
  for (std::size_t i = from; i < n; ++i) squares += (s.x[i] - line.mean) * (s.x[i] - line.mean);
  out.std = std::sqrt(squares / static_cast<double>(out.samples - 1));
  const double length = (out.end_time - out.begin_time) * static_cast<double>(out.samples) / static_cast<double>(out.samples - 1);
  const ZeroFrequency about_mean = density_at_zero(s, from, n, line, false);
  out.sem = std::sqrt(about_mean.density / length);
  out.effective_samples = out.sem > 0.0 ? out.std * out.std / (out.sem * out.sem) : static_cast<double>(out.samples);
  out.correlation_time = length / out.effective_samples;
  const ZeroFrequency about_line = density_at_zero(s, from, n, line, true);
  out.drift_sem = std::sqrt(12.0 * about_line.density / (length * length * length));
  if (out.drift_sem > 0.0) {
    const double t = std::abs(out.drift) / out.drift_sem;
    out.drift_p = 2.0 * gsl_cdf_tdist_Q(t, about_line.degrees_of_freedom);
  } else {
    out.drift_p = out.drift == 0.0 ? 1.0 : 0.0;
  }
  const auto [lowest, highest] = std::minmax_element(s.x.begin(), s.x.end());
  const double size = std::max(std::abs(out.mean), *highest - *lowest);
  const bool drifts = out.drift_p < options.drift_level && std::abs(out.drift) * length > options.drift_tolerance * size;
  if (drifts && out.reason.empty()) out.reason = "drifts";
  out.reached = out.reason.empty();
  return out;
}

double steady_begin(const recording::Run& run, const SteadyOptions& options) {
  if (options.begin) return *options.begin;
  double begin = run.time.empty() ? 0.0 : run.time.front();
  SteadyOptions find = options;
  find.period.reset();
  for (const char* name : {recording::channel::drawbar_pull, recording::channel::driving_torque, recording::channel::sinkage})
    if (const recording::Channel* c = run.find(name)) {
      const SteadyState s = steady_state(run.time, c->values, find);
      if (s.samples > 0) begin = std::max(begin, s.begin_time);
    }
  return begin;
}

std::map<std::string, SteadyState> steady_states(const recording::Run& run, const SteadyOptions& options) {
  std::map<std::string, SteadyState> out;
  for (const auto& [name, value] : run.steady) {
    SteadyState s;
    s.reached = true;
    s.mean = value.mean;
    s.std = value.std.value_or(0.0);
    out[name] = s;
  }
  if (run.time.empty()) return out;
  SteadyOptions common = options;
  common.begin = steady_begin(run, options);
  for (const recording::Channel& c : run.channels) out[c.name] = steady_state(run.time, c.values, common);
  return out;
}

std::vector<Replicates> group_replicates(const std::vector<recording::Run>& runs) {
  std::vector<Replicates> out;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    auto found = std::find_if(out.begin(), out.end(), [&](const Replicates& r) { return same_condition(r.condition, runs[i].condition); });
    if (found == out.end()) {
      out.push_back({runs[i].condition, {i}});
    } else {
      found->runs.push_back(i);
    }
  }
  return out;
}

ReplicateScatter replicate_scatter(std::span<const SteadyState> means) {
  ReplicateScatter out;
  out.count = means.size();
  if (means.empty()) return out;
  const double n = static_cast<double>(means.size());
  for (const SteadyState& s : means) {
    out.mean += s.mean / n;
    out.within_sem += s.sem * s.sem / n;
  }
  out.within_sem = std::sqrt(out.within_sem);
  double squares = 0.0;
  for (const SteadyState& s : means) squares += (s.mean - out.mean) * (s.mean - out.mean);
  if (means.size() > 1) out.between_std = std::sqrt(squares / (n - 1.0));
  out.sem = means.size() > 1 ? out.between_std / std::sqrt(n) : out.within_sem;
  return out;
}

PooledScatter pooled_scatter(std::span<const ReplicateScatter> groups) {
  PooledScatter out;
  double squares = 0.0;
  for (const ReplicateScatter& g : groups) {
    if (g.count < 2) continue;
    squares += g.between_std * g.between_std * static_cast<double>(g.count - 1);
    out.degrees_of_freedom += g.count - 1;
  }
  if (out.degrees_of_freedom > 0) out.std = std::sqrt(squares / static_cast<double>(out.degrees_of_freedom));
  return out;
}

}  // namespace terrode::analysis
