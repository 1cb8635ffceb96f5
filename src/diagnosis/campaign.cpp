#include "diagnosis/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace terrode::diagnosis {
namespace {

constexpr const char* kNames[kChannels] = {recording::channel::drawbar_pull, recording::channel::driving_torque,
                                           recording::channel::sinkage};

double mean_of(const std::vector<double>& v) {
  double sum = 0;
  int n = 0;
  for (const double x : v)
    if (std::isfinite(x)) {
      sum += x;
      ++n;
    }
  return n ? sum / n : std::nan("");
}

// Edges of bins: fine while a run starts (rut and shear form within the first moments), then even.
std::vector<double> bin_edges(double duration) {
  std::vector<double> edges = {0.0, 0.02, 0.04, 0.07, 0.11, 0.16};
  for (int i = 1; i <= 14; ++i) edges.push_back(0.16 + 0.06 * i);
  edges.back() = 1.0 + 1e-9;
  for (double& e : edges) e *= duration;
  return edges;
}

// Mean without what lies beyond 6 robust deviations of its bin's neighbours is left to validate(); here gaps are skipped.
void fill_bins(const recording::Run& run, RunData& out) {
  if (run.time.size() < 20) return;
  const double start = run.time.front(), duration = run.time.back() - start;
  const std::vector<double> edges = bin_edges(duration);
  std::vector<std::size_t> first;
  std::size_t k = 0;
  for (const double e : edges) {
    while (k < run.time.size() && run.time[k] - start < e) ++k;
    first.push_back(k);
  }
  first.front() = 0;
  for (std::size_t b = 0; b + 1 < edges.size(); ++b) {
    const std::size_t n = first[b + 1] - first[b];
    if (n < 3) continue;
    double t = 0;
    for (std::size_t i = first[b]; i < first[b + 1]; ++i) t += run.time[i] - start;
    std::array<double, kChannels> value{};
    bool whole = true;
    for (int c = 0; c < kChannels; ++c) {
      const recording::Channel* ch = run.find(kNames[c]);
      if (!ch) continue;
      double sum = 0;
      int count = 0;
      for (std::size_t i = first[b]; i < first[b + 1]; ++i)
        if (std::isfinite(ch->values[i])) {
          sum += ch->values[i];
          ++count;
        }
      if (count == 0) whole = false;
      value[static_cast<std::size_t>(c)] = count ? sum / count : 0;
    }
    if (!whole) continue;
    out.bins.push_back({t / static_cast<double>(n), edges[b + 1] - edges[b], static_cast<int>(n)});
    for (int c = 0; c < kChannels; ++c)
      if (run.find(kNames[c])) out.mean[static_cast<std::size_t>(c)].push_back(value[static_cast<std::size_t>(c)]);
  }
  for (int c = 0; c < kChannels; ++c)
    if (const recording::Channel* ch = run.find(kNames[c])) out.series[static_cast<std::size_t>(c)] = ch->values;
  out.time = run.time;
  for (double& t : out.time) t -= start;
}

// At most `count` points of a curve, evenly spread, each the mean of its stretch.
void thin(const std::vector<double>& x, const std::vector<double>& y, std::size_t count, Curve& out) {
  const std::size_t n = std::min(x.size(), y.size());
  const std::size_t pieces = std::min(count, n);
  for (std::size_t p = 0; p < pieces; ++p) {
    const std::size_t a = p * n / pieces, b = std::max(a + 1, (p + 1) * n / pieces);
    double sx = 0, sy = 0;
    int m = 0;
    for (std::size_t i = a; i < b; ++i)
      if (std::isfinite(x[i]) && std::isfinite(y[i])) {
        sx += x[i];
        sy += y[i];
        ++m;
      }
    if (m && sx > 0) {
      out.x.push_back(sx / m);
      out.y.push_back(sy / m);
    }
  }
}

}  // namespace

const char* channel_name(int c) { return kNames[c]; }
const char* channel_unit(int c) {
  constexpr const char* units[kChannels] = {"N", "N m", "m"};
  return units[c];
}

bool same_condition(const Condition& a, const Condition& b) {
  const bool same_slip = (std::isinf(a.slip) && std::isinf(b.slip)) || std::abs(a.slip - b.slip) < 1e-6;
  return same_slip && a.pass == b.pass && std::abs(b.normal_load - a.normal_load) <= 0.02 * b.normal_load &&
         std::abs(b.angular_velocity - a.angular_velocity) <= 1e-3 * std::max(b.angular_velocity, 1e-9);
}

std::array<double, 2> settled_means(const RunData& run, const std::array<std::vector<double>, kChannels>& predicted, std::size_t ch) {
  double o = 0, p = 0, n = 0;
  for (std::size_t b = 0; b < run.bins.size(); ++b) {
    if (!run.steady && run.bins[b].time < 0.3 * run.bins.back().time) continue;
    o += run.bins[b].samples * run.mean[ch][b];
    p += run.bins[b].samples * predicted[ch][b];
    n += run.bins[b].samples;
  }
  return {o / n, p / n};
}

Campaign reduce(const recording::Recording& r) {
  Campaign out;
  out.title = r.title.empty() ? r.folder : r.title;
  Problems problems;
  out.wheel = {r.wheel.radius, r.wheel.width};
  for (Problem& p : out.wheel.validate()) {
    p.key = "wheel." + p.key;
    problems.push_back(std::move(p));
  }
  throw_if_any(problems);
  if (r.wheel.grouser_count) out.known_grousers = *r.wheel.grouser_count;

  bool complete = true;
  const auto take = [&](double& into, const std::optional<double>& value, const char* name) {
    if (value) {
      into = *value;
    } else {
      complete = false;
      out.remarks.push_back(fmt::format("soil.{} is not given: taken as {:.4g} to start the fit", name, into));
    }
  };
  bekker::Soil& s = out.believed;
  s.shear_modulus = 0.005;
  s.cohesion = 200;
  s.n = 1.0;
  take(s.cohesion, r.soil.cohesion, "bekker.cohesion");
  take(s.friction_angle, r.soil.friction_angle, "bekker.friction_angle");
  take(s.shear_modulus, r.soil.shear_modulus, "bekker.shear_modulus");
  take(s.n, r.soil.n, "bekker.n");
  if (r.soil.k) {
    s.k = *r.soil.k;
    s.plate_width = r.soil.plate_width.value_or(0.05);
  } else if (r.soil.kphi) {
    s.k = bekker::bekker_modulus(r.soil.kc.value_or(0), *r.soil.kphi, out.wheel.width);
    s.plate_width = 1.0;
  } else {
    s.plate_width = out.wheel.width;
    s.k = 1e5;
    complete = false;
    out.remarks.push_back("soil.bekker.k is not given: taken as 1e+05 Pa at the wheel's width to start the fit");
  }
  if (r.soil.bulk_density) s.bulk_density = *r.soil.bulk_density;
  if (r.soil.a0) out.believed_angles.a0 = *r.soil.a0;
  if (r.soil.a1) out.believed_angles.a1 = *r.soil.a1;
  if (r.soil.theta_r) out.believed_angles.theta_r = *r.soil.theta_r;
  out.complete_belief = complete;
  throw_if_any(s.validate());
  throw_if_any(out.believed_angles.validate());

  int no_load = 0, no_channel = 0;
  for (const recording::Run& run : r.runs) {
    Condition c;
    c.slip = run.condition.slip;
    c.pass = run.condition.pass;
    if (run.condition.normal_load) {
      c.normal_load = *run.condition.normal_load;
    } else if (const recording::Channel* w = run.find(recording::channel::normal_load)) {
      c.normal_load = mean_of(w->values);
    } else if (const auto w2 = run.steady.find(recording::channel::normal_load); w2 != run.steady.end()) {
      c.normal_load = w2->second.mean;
    }
    if (!(c.normal_load > 0)) {
      ++no_load;
      continue;
    }
    const double r0 = out.wheel.radius;
    if (run.condition.angular_velocity) {
      c.angular_velocity = *run.condition.angular_velocity;
    } else if (run.condition.forward_velocity && std::isfinite(c.slip) && c.slip < 1) {
      c.angular_velocity = *run.condition.forward_velocity / ((1 - c.slip) * r0);
    }
    c.forward_velocity = std::isfinite(c.slip) ? c.angular_velocity * r0 * (1 - c.slip)
                                               : run.condition.forward_velocity.value_or(0.03);
    if (std::isinf(c.slip)) c.angular_velocity = 0;
    RunData data;
    data.id = run.id;
    if (run.time.empty()) {
      data.steady = true;
      bool any = false;
      for (int ch = 0; ch < kChannels; ++ch) {
        const auto found = run.steady.find(kNames[ch]);
        if (found == run.steady.end() || !std::isfinite(found->second.mean)) continue;
        data.mean[static_cast<std::size_t>(ch)] = {found->second.mean};
        data.table_std[static_cast<std::size_t>(ch)] = found->second.std.value_or(0);
        any = true;
      }
      if (any) data.bins.push_back({0, 0, 1});
    } else {
      fill_bins(run, data);
    }
    bool any = false;
    for (int ch = 0; ch < kChannels; ++ch) {
      data.has[static_cast<std::size_t>(ch)] = !data.mean[static_cast<std::size_t>(ch)].empty();
      any = any || data.has[static_cast<std::size_t>(ch)];
    }
    if (!any) {
      ++no_channel;
      continue;
    }
    int index = -1;
    for (std::size_t i = 0; i < out.conditions.size() && index < 0; ++i)
      if (same_condition(c, out.conditions[i])) index = static_cast<int>(i);
    if (index < 0) {
      index = static_cast<int>(out.conditions.size());
      out.conditions.push_back(c);
    }
    data.condition = index;
    ++out.conditions[static_cast<std::size_t>(index)].runs;
    if (!data.time.empty()) out.travel_length = std::max(out.travel_length, c.forward_velocity * data.time.back());
    out.runs.push_back(std::move(data));
  }
  if (no_load) out.remarks.push_back(fmt::format("{} runs without a normal load were left out", no_load));
  if (no_channel) out.remarks.push_back(fmt::format("{} runs without drawbar pull, torque or sinkage were left out", no_channel));
  if (out.runs.empty())
    throw InputError(Problem{r.folder, 0, 0, "runs", "hold nothing to compare", "at least one run with a load and with drawbar_pull, driving_torque or sinkage"});
  for (const Condition& c : out.conditions)
    if (c.runs > 1) ++out.replicated_conditions;

  for (const auto& t : r.pressure_sinkage) {
    Curve c;
    c.plate_width = t.plate_width;
    c.rate = t.rate.value_or(0);
    thin(t.sinkage, t.pressure, 20, c);
    if (c.x.size() >= 4) out.curves.push_back(std::move(c));
  }
  for (const auto& t : r.direct_shear) {
    Curve c;
    c.shear = true;
    c.normal_stress = t.normal_stress;
    c.rate = t.rate.value_or(0);
    // Shear builds up within the first displacements: the start is not thinned away.
    thin(t.shear_displacement, t.shear_stress, 30, c);
    if (c.x.size() >= 4) out.curves.push_back(std::move(c));
  }
  return out;
}

}  // namespace terrode::diagnosis
