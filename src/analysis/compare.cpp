#include "analysis/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/lines.h"
#include "analysis/spectrum.h"
#include "analysis/steady_state.h"

namespace terrode::analysis {
namespace {

// The numbers of ISO/TS 18571 (2014), tables 1 to 4.
constexpr double kInnerCorridor = 0.05, kOuterCorridor = 0.5;
constexpr double kLargestShift = 0.2;
constexpr double kMagnitudeLimit = 0.5, kWarp = 0.1;
constexpr double kSlopeLimit = 2.0;
constexpr std::size_t kLongestCurve = 2000;  // samples that are warped; longer curves are thinned

double norm1(std::span<const double> x) {
  double s = 0.0;
  for (const double v : x) s += std::abs(v);
  return s;
}

// Derivative smoothed over nine samples, by least squares.
std::vector<double> smooth_slope(std::span<const double> x, double step) {
  const auto n = static_cast<std::ptrdiff_t>(x.size());
  std::vector<double> out(x.size());
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const std::ptrdiff_t a = std::max<std::ptrdiff_t>(i - 4, 0), b = std::min<std::ptrdiff_t>(i + 4, n - 1);
    const double centre = 0.5 * static_cast<double>(a + b);
    double top = 0.0, bottom = 0.0;
    for (std::ptrdiff_t k = a; k <= b; ++k) {
      const double u = static_cast<double>(k) - centre;
      top += u * x[static_cast<std::size_t>(k)];
      bottom += u * u;
    }
    out[static_cast<std::size_t>(i)] = top / (bottom * step);
  }
  return out;
}

// Distance of two curves whose time may be stretched within a band (dynamic time warping): sum of |a - b| along the
// cheapest path over the sum of |a| along it.
double warped_distance(std::span<const double> a, std::span<const double> b) {
  const std::size_t n = a.size();
  const auto band = std::max<std::size_t>(static_cast<std::size_t>(kWarp * static_cast<double>(n)), 1);
  constexpr double inf = std::numeric_limits<double>::infinity();
  struct Cost {
    double sum = inf, size = 0.0;
  };
  std::vector<Cost> last(n), now(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::fill(now.begin(), now.end(), Cost{});
    const std::size_t lo = i > band ? i - band : 0, hi = std::min(i + band, n - 1);
    for (std::size_t j = lo; j <= hi; ++j) {
      Cost best;
      if (i == 0 && j == 0) best = {0.0, 0.0};
      if (i > 0 && j > 0 && last[j - 1].sum < best.sum) best = last[j - 1];
      if (i > 0 && last[j].sum < best.sum) best = last[j];
      if (j > 0 && now[j - 1].sum < best.sum) best = now[j - 1];
      now[j] = {best.sum + std::abs(a[i] - b[j]), best.size + std::abs(a[i])};
    }
    std::swap(last, now);
  }
  if (last[n - 1].size > 0.0) return last[n - 1].sum / last[n - 1].size;
  return last[n - 1].sum > 0.0 ? inf : 0.0;
}

std::vector<double> steady_samples(const recording::Run& run, const std::string& channel, double begin) {
  std::vector<double> out;
  const recording::Channel* c = run.find(channel);
  for (std::size_t i = 0; c && i < run.time.size(); ++i)
    if (run.time[i] >= begin && std::isfinite(c->values[i])) out.push_back(c->values[i]);
  return out;
}

bool close(const std::optional<double>& a, const std::optional<double>& b, double relative) {
  if (!a || !b) return true;
  return std::abs(*a - *b) <= relative * std::max(std::abs(*a), std::abs(*b)) + 1e-12;
}

// Same load, rate and pass; the slip is judged by the caller. A wheel that is locked on one side has rate zero on both.
bool same_besides_slip(const recording::Condition& a, const recording::Condition& b, double relative) {
  return a.pass == b.pass && close(a.normal_load, b.normal_load, relative) && close(a.angular_velocity, b.angular_velocity, relative);
}

struct Known {
  std::size_t run;
  std::map<std::string, SteadyState> steady;
};

EvenSeries resampled(const recording::Run& run, const std::string& channel, double from, double to, double step) {
  const recording::Channel* c = run.find(channel);
  EvenSeries even = even_series(run.time, c->values);
  EvenSeries out;
  out.t0 = from;
  out.step = step;
  const auto n = static_cast<std::size_t>((to - from) / step + 1e-9) + 1;
  for (std::size_t i = 0; i < n; ++i) {
    const double at = (from + step * static_cast<double>(i) - even.t0) / even.step;
    const auto k = static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(even.x.size() - 2)));
    const double u = std::clamp(at - static_cast<double>(k), 0.0, 1.0);
    out.x.push_back((1.0 - u) * even.x[k] + u * even.x[k + 1]);
  }
  return out;
}

void compare_series(const recording::Run& recorded, double recorded_begin, const recording::Run& computed, double computed_begin,
                    const std::string& channel, double radius, ChannelComparison& out) {
  // From the start of both records: what a rating sees includes how the run settles.
  const double length = std::min(recorded.time.back() - recorded.time.front(), computed.time.back() - computed.time.front());
  const EvenSeries a = even_series(recorded.time, recorded.find(channel)->values);
  const EvenSeries b = even_series(computed.time, computed.find(channel)->values);
  if (a.x.size() < 16 || b.x.size() < 16) return;
  const double step = std::max({a.step, b.step, length / static_cast<double>(kLongestCurve)});
  const EvenSeries ra = resampled(recorded, channel, recorded.time.front(), recorded.time.front() + length, step);
  EvenSeries rb = resampled(computed, channel, computed.time.front(), computed.time.front() + length, step);
  rb.x.resize(std::min(ra.x.size(), rb.x.size()));
  if (rb.x.size() >= 10) out.rating = rate_curves(std::span(ra.x).first(rb.x.size()), rb.x, step);

  LineOptions lines;
  lines.wheel_radius = radius;
  lines.begin = recorded_begin;
  const ChannelSpectrum sa = channel_spectrum(recorded, channel, lines);
  lines.begin = computed_begin;
  const ChannelSpectrum sb = channel_spectrum(computed, channel, lines);
  if (!sa.lines.empty()) out.recorded_line = sa.lines.front().frequency;
  if (!sb.lines.empty()) out.computed_line = sb.lines.front().frequency;
  if (sa.background.empty() || sb.background.empty()) return;
  // Densities averaged over the wider bandwidth, from there to the lower of the two highest frequencies.
  const double width = std::max(sa.spectrum.half_bandwidth, sb.spectrum.half_bandwidth);
  const double top = std::min(sa.highest, sb.highest);
  const auto mean_density = [&](const Spectrum& s, double f) {
    double sum = 0.0, count = 0.0;
    const double df = s.frequency[1] - s.frequency[0];
    for (double g = f - width; g <= f + width; g += df) {
      const auto i = static_cast<std::size_t>(std::clamp(std::round(g / df), 0.0, static_cast<double>(s.density.size() - 1)));
      sum += s.density[i];
      count += 1.0;
    }
    return sum / count;
  };
  double squares = 0.0, count = 0.0;
  for (double f = 2.0 * width; f <= top; f += 2.0 * width) {
    const double p = mean_density(sa.spectrum, f), q = mean_density(sb.spectrum, f);
    if (!(p > 0.0) || !(q > 0.0)) continue;
    squares += std::log(q / p) * std::log(q / p);
    count += 1.0;
  }
  if (count > 0.0) out.spectral_distance = std::sqrt(squares / count);
}

}  // namespace

CurveRating rate_curves(std::span<const double> reference, std::span<const double> result, double step) {
  const std::size_t n = reference.size();
  if (n < 10 || result.size() != n) throw InputError("a rating needs two curves of the same length, at least 10 samples");
  CurveRating r;
  double largest = 0.0;
  for (const double x : reference) largest = std::max(largest, std::abs(x));
  const double inner = kInnerCorridor * largest, outer = kOuterCorridor * largest;
  for (std::size_t i = 0; i < n; ++i) {
    const double off = std::abs(reference[i] - result[i]);
    double score = 1.0;
    if (off > outer) score = 0.0;
    else if (off > inner) score = ((outer - off) / (outer - inner)) * ((outer - off) / (outer - inner));
    r.corridor += score / static_cast<double>(n);
  }
  // The shift of largest normalised correlation.
  const auto most = static_cast<std::ptrdiff_t>(kLargestShift * static_cast<double>(n));
  double best = -2.0;
  std::ptrdiff_t shift = 0;
  for (std::ptrdiff_t m = -most; m <= most; ++m) {
    const std::size_t from_a = m > 0 ? static_cast<std::size_t>(m) : 0, from_b = m < 0 ? static_cast<std::size_t>(-m) : 0;
    const std::size_t count = n - static_cast<std::size_t>(std::abs(m));
    double ab = 0.0, aa = 0.0, bb = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double x = reference[from_a + i], y = result[from_b + i];
      ab += x * y;
      aa += x * x;
      bb += y * y;
    }
    const double c = aa > 0.0 && bb > 0.0 ? ab / std::sqrt(aa * bb) : (aa == bb ? 1.0 : 0.0);
    if (c > best + 1e-12 || (c > best - 1e-12 && std::abs(m) < std::abs(shift))) {
      best = c;
      shift = m;
    }
  }
  r.shift = static_cast<double>(shift) * step;
  r.phase = most > 0 ? 1.0 - static_cast<double>(std::abs(shift)) / static_cast<double>(most) : 1.0;
  const std::size_t from_a = shift > 0 ? static_cast<std::size_t>(shift) : 0, from_b = shift < 0 ? static_cast<std::size_t>(-shift) : 0;
  const std::size_t count = n - static_cast<std::size_t>(std::abs(shift));
  const auto a = reference.subspan(from_a, count), b = result.subspan(from_b, count);
  std::vector<double> ta, tb;
  const std::size_t thin = std::max<std::size_t>(count / kLongestCurve, 1);
  for (std::size_t i = 0; i < count; i += thin) {
    ta.push_back(a[i]);
    tb.push_back(b[i]);
  }
  r.magnitude = std::max(0.0, 1.0 - warped_distance(ta, tb) / kMagnitudeLimit);
  const auto sa = smooth_slope(a, step), sb = smooth_slope(b, step);
  double off = 0.0;
  for (std::size_t i = 0; i < count; ++i) off += std::abs(sa[i] - sb[i]);
  const double steepness = norm1(sa);
  r.slope = steepness > 0.0 ? std::max(0.0, 1.0 - off / steepness / kSlopeLimit) : (off == 0.0 ? 1.0 : 0.0);
  r.total = 0.4 * r.corridor + 0.2 * (r.phase + r.magnitude + r.slope);
  return r;
}

double area_metric(std::vector<double> a, std::vector<double> b) {
  if (a.empty() || b.empty()) return 0.0;
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double area = 0.0, x = std::min(a.front(), b.front());
  std::size_t i = 0, j = 0;
  while (i < a.size() || j < b.size()) {
    const double next = i < a.size() && (j >= b.size() || a[i] <= b[j]) ? a[i] : b[j];
    const double fa = static_cast<double>(i) / static_cast<double>(a.size()), fb = static_cast<double>(j) / static_cast<double>(b.size());
    area += std::abs(fa - fb) * (next - x);
    x = next;
    while (i < a.size() && a[i] == x) ++i;
    while (j < b.size() && b[j] == x) ++j;
  }
  return area;
}

Comparison compare(const recording::Recording& result, const recording::Recording& reference, const CompareOptions& options) {
  Comparison out;
  std::vector<std::string> channels = options.channels;
  if (channels.empty())
    channels = {recording::channel::drawbar_pull, recording::channel::driving_torque, recording::channel::sinkage, recording::channel::normal_load};
  std::vector<Known> computed, recorded;
  for (std::size_t i = 0; i < result.runs.size(); ++i) computed.push_back({i, steady_states(result.runs[i])});
  for (std::size_t i = 0; i < reference.runs.size(); ++i) recorded.push_back({i, steady_states(reference.runs[i])});
  const auto groups = group_replicates(reference.runs);
  std::map<std::string, PooledScatter> pooled;
  for (const std::string& name : channels) {
    std::vector<ReplicateScatter> scatter;
    for (const Replicates& g : groups) {
      std::vector<SteadyState> means;
      for (const std::size_t r : g.runs)
        if (const auto found = recorded[r].steady.find(name); found != recorded[r].steady.end()) means.push_back(found->second);
      if (!means.empty()) scatter.push_back(replicate_scatter(means));
    }
    pooled[name] = pooled_scatter(scatter);
  }

  std::map<std::string, std::vector<double>> recorded_means, computed_means;
  const double relative = options.condition_tolerance;
  for (const Known& rec : recorded) {
    const recording::Run& run = reference.runs[rec.run];
    const Known *exact = nullptr, *below = nullptr, *above = nullptr;
    const double slip = run.condition.slip;
    for (const Known& k : computed) {
      const recording::Condition& c = result.runs[k.run].condition;
      if (!same_besides_slip(c, run.condition, relative)) continue;
      const double s = c.slip;
      if (s == slip || std::abs(s - slip) <= options.slip_tolerance) {
        const auto off = [&](const Known& x) { return x.run == k.run || result.runs[x.run].condition.slip == slip ? 0.0 : std::abs(result.runs[x.run].condition.slip - slip); };
        const double mine = s == slip ? 0.0 : std::abs(s - slip);
        if (!exact || mine < off(*exact)) exact = &k;
      } else if (std::isfinite(s) && std::isfinite(slip)) {
        if (s < slip && (!below || s > result.runs[below->run].condition.slip)) below = &k;
        if (s > slip && (!above || s < result.runs[above->run].condition.slip)) above = &k;
      }
    }
    if (!exact && !(below && above)) {
      out.unmatched.push_back(run.id);
      continue;
    }
    RunComparison pair;
    pair.recorded_run = run.id;
    pair.condition = run.condition;
    pair.interpolated = !exact;
    pair.computed_run = exact ? result.runs[exact->run].id : result.runs[below->run].id + ".." + result.runs[above->run].id;
    for (const std::string& name : channels) {
      const auto measured = rec.steady.find(name);
      if (measured == rec.steady.end() || (measured->second.samples == 0 && !run.time.empty())) continue;
      const auto get = [&](const Known* k) -> const SteadyState* {
        if (!k) return nullptr;
        const auto found = k->steady.find(name);
        return found == k->steady.end() ? nullptr : &found->second;
      };
      ChannelComparison c;
      c.channel = name;
      c.unit = recording::channel::unit_of(name).value_or("");
      double sem = 0.0;
      if (exact) {
        const SteadyState* s = get(exact);
        if (!s) continue;
        c.computed_mean = s->mean;
        c.computed_drift = s->drift;
        c.computed_std = s->std;
        sem = s->sem;
      } else {
        const SteadyState *a = get(below), *b = get(above);
        if (!a || !b) continue;
        const double sa = result.runs[below->run].condition.slip, sb = result.runs[above->run].condition.slip;
        const double u = (slip - sa) / (sb - sa);
        c.computed_mean = (1.0 - u) * a->mean + u * b->mean;
        c.computed_drift = (1.0 - u) * a->drift + u * b->drift;
        c.computed_std = (1.0 - u) * a->std + u * b->std;
        sem = std::hypot((1.0 - u) * a->sem, u * b->sem);
      }
      const SteadyState& m = measured->second;
      c.recorded_mean = m.mean;
      c.recorded_drift = m.drift;
      c.recorded_std = m.std;
      c.error = c.computed_mean - c.recorded_mean;
      // The scatter between replicates holds what one run's own samples cannot show.
      c.error_sem = std::hypot(sem, std::max(m.sem, pooled[name].std));
      const recording::Run* other = exact ? &result.runs[exact->run] : nullptr;
      if (!run.time.empty() && other && !other->time.empty() && other->find(name) && run.find(name)) {
        const double begin = m.begin_time, computed_begin = get(exact)->begin_time;
        const auto mine = steady_samples(run, name, begin);
        c.area = area_metric(mine, steady_samples(*other, name, computed_begin));
        double sum = 0.0, count = 0.0;
        for (const Replicates& g : groups) {
          if (std::find(g.runs.begin(), g.runs.end(), rec.run) == g.runs.end()) continue;
          for (const std::size_t r : g.runs)
            if (r != rec.run && recorded[r].steady.contains(name)) {
              sum += area_metric(mine, steady_samples(reference.runs[r], name, recorded[r].steady.at(name).begin_time));
              count += 1.0;
            }
        }
        const auto half = mine.begin() + static_cast<std::ptrdiff_t>(mine.size() / 2);
        c.own_area = count > 0.0 ? sum / count : area_metric({mine.begin(), half}, {half, mine.end()});
        compare_series(run, begin, *other, computed_begin, name, reference.wheel.radius, c);
      } else {
        c.area = std::abs(c.error);
        c.own_area = pooled[name].std;
      }
      recorded_means[name].push_back(c.recorded_mean);
      computed_means[name].push_back(c.computed_mean);
      pair.channels[name] = std::move(c);
    }
    out.runs.push_back(std::move(pair));
  }

  for (const std::string& name : channels) {
    ChannelSummary s;
    s.unit = recording::channel::unit_of(name).value_or("");
    double lo = std::numeric_limits<double>::infinity(), hi = -lo, rated = 0.0;
    for (const RunComparison& r : out.runs) {
      const auto found = r.channels.find(name);
      if (found == r.channels.end()) continue;
      const ChannelComparison& c = found->second;
      ++s.pairs;
      s.bias += c.error;
      s.rmse += c.error * c.error;
      lo = std::min(lo, c.recorded_mean);
      hi = std::max(hi, c.recorded_mean);
      if (std::abs(c.error) >= std::abs(s.largest_error)) {
        s.largest_error = c.error;
        s.largest_at_slip = r.condition.slip;
      }
      if (c.rating) {
        s.rating += c.rating->total;
        rated += 1.0;
      }
    }
    if (s.pairs == 0) continue;
    const double n = static_cast<double>(s.pairs);
    s.bias /= n;
    s.rmse = std::sqrt(s.rmse / n);
    const double size = std::max({hi - lo, std::abs(hi), std::abs(lo)});
    s.relative_rmse = size > 0.0 ? s.rmse / size : 0.0;
    s.scatter = pooled[name].std;
    s.area = area_metric(recorded_means[name], computed_means[name]);
    if (rated > 0.0) s.rating /= rated;
    out.summary[name] = s;
  }
  return out;
}

}  // namespace terrode::analysis
