#include "analysis/quality.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "analysis/steady_state.h"
#include "core/statistics.h"

namespace terrode::analysis {
namespace {

constexpr double kJitter = 0.02;           // deviation of the steps, over their median, that is worth saying
constexpr double kMissing = 1.75;          // a step this many medians long lacks a sample
constexpr std::size_t kStuck = 12;         // samples
constexpr double kOutlier = 8.0;           // robust deviations
constexpr double kSlipDifference = 0.03;
constexpr double kEnergyMargin = 0.02;     // of the larger power

class Checker {
 public:
  Checker(const recording::Run& run, double radius) : run_(run), radius_(radius) {}

  std::vector<QualityFinding> check() {
    if (run_.time.size() < 4) return {};
    check_clock();
    for (const recording::Channel& c : run_.channels) {
      if (c.values.size() != run_.time.size()) continue;
      if (is_clock(c)) {
        check_second_clock(c);
        continue;
      }
      check_gaps(c);
      check_stuck(c);
      check_saturation(c);
      check_outliers(c);
    }
    check_balances();
    return std::move(out_);
  }

 private:
  void add(const std::string& kind, const std::string& channel, std::size_t at, std::size_t count, const std::string& message) {
    out_.push_back({kind, channel, message, at < run_.lines.size() ? run_.lines[at] : 0, run_.time[at], count});
  }

  void check_clock() {
    std::vector<double> steps;
    for (std::size_t i = 1; i < run_.time.size(); ++i) steps.push_back(run_.time[i] - run_.time[i - 1]);
    step_ = median(steps);
    double squares = 0.0, regular = 0.0;
    std::size_t missing = 0, first = 0, longest = 0;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      if (steps[i] > kMissing * step_) {
        if (missing == 0) first = i;
        if (missing == 0 || steps[i] > steps[longest]) longest = i;
        ++missing;
      } else {
        squares += (steps[i] - step_) * (steps[i] - step_);
        regular += 1.0;
      }
    }
    const double jitter = regular > 0.0 ? std::sqrt(squares / regular) / step_ : 0.0;
    if (jitter > kJitter)
      add("jitter", "", 0, steps.size(), fmt::format("sample times jitter: steps of {:.4g} s deviate by {:.1f} %", step_, 100.0 * jitter));
    if (missing > 0)
      add("missing samples", "", first + 1, missing,
          fmt::format("samples are missing in {} places; the longest gap is {:.3g} s at {:.3f} s", missing, steps[longest], run_.time[longest]));
  }

  static bool is_clock(const recording::Channel& c) {
    if (recording::channel::unit_of(c.name)) return false;
    const bool named = c.name == "t" || c.name.find("time") != std::string::npos || c.name.find("clock") != std::string::npos ||
                       (c.name.size() == 2 && c.name[0] == 't' && std::isdigit(static_cast<unsigned char>(c.name[1])));
    if (!named) return false;
    double last = -std::numeric_limits<double>::infinity();
    std::size_t count = 0;
    for (const double v : c.values) {
      if (!std::isfinite(v)) continue;
      if (v < last) return false;
      last = v;
      ++count;
    }
    return count > 3;
  }

  void check_second_clock(const recording::Channel& c) {
    double n = 0.0, mt = 0.0, mx = 0.0;
    for (std::size_t i = 0; i < c.values.size(); ++i)
      if (std::isfinite(c.values[i])) {
        n += 1.0;
        mt += run_.time[i];
        mx += c.values[i];
      }
    mt /= n;
    mx /= n;
    double tt = 0.0, tx = 0.0;
    for (std::size_t i = 0; i < c.values.size(); ++i)
      if (std::isfinite(c.values[i])) {
        tt += (run_.time[i] - mt) * (run_.time[i] - mt);
        tx += (run_.time[i] - mt) * (c.values[i] - mx);
      }
    const double rate = tt > 0.0 ? tx / tt : 1.0;
    add("second clock", c.name, 0, c.values.size(),
        fmt::format("is a second clock: it runs {:+.3g} % against time and begins {:+.4g} s beside it (columns on it need 'clock')",
                    100.0 * (rate - 1.0), c.values.front() - run_.time.front()));
  }

  void check_gaps(const recording::Channel& c) {
    std::size_t count = 0, first = 0;
    for (std::size_t i = 0; i < c.values.size(); ++i)
      if (!std::isfinite(c.values[i]) && count++ == 0) first = i;
    if (count > 0) add("gaps", c.name, first, count, fmt::format("has {} missing samples ({:.2g} %)", count, 100.0 * static_cast<double>(count) / static_cast<double>(c.values.size())));
  }

  void check_stuck(const recording::Channel& c) {
    std::size_t longest = 0, at = 0, stretches = 0;
    for (std::size_t i = 0; i < c.values.size();) {
      std::size_t j = i + 1;
      while (j < c.values.size() && c.values[j] == c.values[i]) ++j;
      if (std::isfinite(c.values[i])) {
        ++stretches;
        if (j - i > longest) {
          longest = j - i;
          at = i;
        }
      }
      i = j;
    }
    if (stretches == 0) return;
    if (stretches == 1 && longest > 3) {
      add("constant", c.name, at, longest, fmt::format("never changes ({:g} {})", c.values[at], c.unit));
      return;
    }
    // A coarse sensor repeats values all the time: a stretch counts when it is long against the usual ones.
    const double usual = static_cast<double>(c.values.size()) / static_cast<double>(stretches);
    if (longest >= kStuck && static_cast<double>(longest) > 8.0 * usual && !at_an_end(c, c.values[at]))
      add("frozen", c.name, at, longest, fmt::format("is frozen at {:g} {} for {} samples from {:.3f} s", c.values[at], c.unit, longest, run_.time[at]));
  }

  static bool at_an_end(const recording::Channel& c, double value) {
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (const double v : c.values)
      if (std::isfinite(v)) {
        lo = std::min(lo, v);
        hi = std::max(hi, v);
      }
    return value == lo || value == hi;
  }

  // A clipped channel stands at its largest (or smallest) value often, and much more often than just below.
  void check_saturation(const recording::Channel& c) {
    std::vector<double> v;
    for (const double x : c.values)
      if (std::isfinite(x)) v.push_back(x);
    if (v.size() < 20) return;
    std::sort(v.begin(), v.end());
    for (const bool top : {true, false}) {
      const double end = top ? v.back() : v.front();
      std::size_t count = 0, next = 0, levels = 0;
      double level = end;
      for (std::size_t k = 0; k < v.size() && levels < 4; ++k) {
        const double x = top ? v[v.size() - 1 - k] : v[k];
        if (x == end) ++count;
        else {
          if (x != level) ++levels;
          level = x;
          if (levels < 4) ++next;
        }
      }
      if (count == v.size()) return;
      std::size_t longest = 0, run = 0, at = 0;
      for (std::size_t i = 0; i < c.values.size(); ++i) {
        run = c.values[i] == end ? run + 1 : 0;
        if (run > longest) {
          longest = run;
          at = i + 1 - run;
        }
      }
      if (longest >= 4 && count >= std::max<std::size_t>(6, v.size() / 100) && count > 3 * next)
        add("saturated", c.name, at, count, fmt::format("is saturated at {:g} {}: {} samples stand at its {} value", end, c.unit, count, top ? "largest" : "smallest"));
    }
  }

  // Hampel: against the median of the neighbours, by the median deviation of the whole channel.
  void check_outliers(const recording::Channel& c) {
    constexpr std::size_t reach = 5;
    const std::size_t n = c.values.size();
    if (n < 4 * reach) return;
    std::vector<double> off(n, 0.0), sizes;
    // At the ends there are neighbours on one side only: a run that settles would look like an outlier.
    for (std::size_t i = reach; i + reach < n; ++i) {
      if (!std::isfinite(c.values[i])) continue;
      std::vector<double> near;
      for (std::size_t k = i - reach; k <= i + reach; ++k)
        if (std::isfinite(c.values[k])) near.push_back(c.values[k]);
      off[i] = std::abs(c.values[i] - median(near));
      sizes.push_back(off[i]);
    }
    const double scale = 1.4826 * median(sizes);
    if (!(scale > 0.0)) return;
    std::size_t count = 0, first = 0, worst = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (off[i] <= kOutlier * scale) continue;
      if (count == 0) first = i;
      if (count == 0 || off[i] > off[worst]) worst = i;
      ++count;
    }
    // Many of them are not outliers but the signal's own shape.
    if (count > 0 && count <= std::max<std::size_t>(n / 50, 2))
      add("outliers", c.name, first, count, fmt::format("has {} outliers; the largest is {:g} {} at {:.3f} s, {:.0f} deviations off", count, c.values[worst], c.unit, run_.time[worst], off[worst] / scale));
  }

  std::optional<double> mean(const char* name) const {
    const recording::Channel* c = run_.find(name);
    if (!c) return std::nullopt;
    SteadyOptions options;
    options.begin = begin_;
    const SteadyState s = steady_state(run_.time, c->values, options);
    if (s.samples < 8) return std::nullopt;
    return s.mean;
  }

  void check_balances() {
    if (!(radius_ > 0.0)) return;
    try {
      begin_ = steady_begin(run_);
    } catch (const InputError&) {
      return;
    }
    const auto omega = mean(recording::channel::angular_velocity), v = mean(recording::channel::forward_velocity);
    if (!omega || !v) return;
    const double fastest = std::max(std::abs(*omega) * radius_, std::abs(*v));
    if (fastest > 0.0 && std::isfinite(run_.condition.slip)) {
      // Both differences of speed over the faster of rim and carriage, which is bounded at either sign.
      const double measured = (*omega * radius_ - *v) / fastest;
      const double commanded = run_.condition.slip * *omega * radius_ / fastest;
      if (std::abs(measured - commanded) > kSlipDifference)
        add("slip", "", 0, 0, fmt::format("slip {:.3f} is commanded, the measured velocities give {:.3f}", run_.condition.slip, 1.0 - *v / (*omega * radius_)));
    }
    const auto torque = mean(recording::channel::driving_torque), drawbar = mean(recording::channel::drawbar_pull);
    if (!torque || !drawbar) return;
    const double in = *torque * *omega, out = *drawbar * *v;
    if (in - out < -kEnergyMargin * std::max(std::abs(in), std::abs(out)))
      add("energy", "", 0, 0, fmt::format("the wheel gives out more power than it takes in ({:.3g} W of torque, {:.3g} W of drawbar pull): a sign, gain or unit is wrong", in, out));
  }

  const recording::Run& run_;
  double radius_;
  double step_ = 0.0, begin_ = 0.0;
  std::vector<QualityFinding> out_;
};

}  // namespace

std::vector<QualityFinding> check_quality(const recording::Run& run, double wheel_radius) { return Checker(run, wheel_radius).check(); }

}  // namespace terrode::analysis
