#include "diagnosis/locate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

namespace terrode::diagnosis {

std::vector<Located> located(const Model& model, const Tried& plain) {
  const Campaign& campaign = model.campaign();
  std::vector<Located> out;
  const auto before = model.predict(plain.hypothesis, plain.fit);
  struct Slice {
    std::map<std::string, std::pair<double, double>> where;
    std::function<bool(const Condition&)> in;
  };
  std::vector<Slice> slices;
  double lo = 1e9, hi = -1e9;
  std::set<double> loads, speeds;
  std::set<int> passes;
  for (const Condition& q : campaign.conditions) {
    if (std::isfinite(q.slip)) {
      lo = std::min(lo, q.slip);
      hi = std::max(hi, q.slip);
    }
    loads.insert(q.normal_load);
    speeds.insert(q.angular_velocity);
    passes.insert(q.pass);
  }
  slices.push_back({{{"slip", {lo, hi}}}, [](const Condition&) { return true; }});
  const double cuts[] = {-1e9, 0.0, 0.15, 0.45, 1e9};
  for (int i = 0; i < 4; ++i) {
    const double a = cuts[i], b = cuts[i + 1];
    slices.push_back({{{"slip", {std::max(a, lo), std::min(b, hi)}}}, [a, b](const Condition& q) { return q.slip >= a && q.slip < b; }});
  }
  if (loads.size() > 1 && loads.size() <= 8)
    for (const double w : loads) slices.push_back({{{"normal_load", {w, w}}}, [w](const Condition& q) { return q.normal_load == w; }});
  if (speeds.size() > 1 && speeds.size() <= 8)
    for (const double v : speeds) slices.push_back({{{"angular_velocity", {v, v}}}, [v](const Condition& q) { return q.angular_velocity == v; }});
  if (passes.size() > 1)
    for (const int p : passes) slices.push_back({{{"pass", {p, p}}}, [p](const Condition& q) { return q.pass == p; }});
  for (std::size_t ch = 0; ch < kChannels; ++ch) {
    std::vector<Located> list;
    for (const Slice& s : slices) {
      double sum = 0, weight = 0;
      int n = 0;
      for (std::size_t r = 0; r < campaign.runs.size(); ++r) {
        const RunData& run = campaign.runs[r];
        if (!run.has[ch] || !s.in(campaign.conditions[static_cast<std::size_t>(run.condition)])) continue;
        const auto m = settled_means(run, before[r], ch);
        const double d = std::max(1e-12, model.run_mean_deviation(static_cast<int>(r), static_cast<int>(ch)));
        sum += (m[0] - m[1]) / (d * d);
        weight += 1 / (d * d);
        ++n;
      }
      if (n < 1 || weight <= 0) continue;
      Located l;
      l.channel = channel_name(static_cast<int>(ch));
      l.unit = channel_unit(static_cast<int>(ch));
      l.where = s.where;
      l.size = sum / weight;
      l.significance = std::abs(sum) / std::sqrt(weight);
      if (l.significance > 3.5) list.push_back(std::move(l));
    }
    // A trend along the travel that all runs share.
    double xy = 0, xx = 0, var = 0, reach = 0;
    for (std::size_t r = 0; r < campaign.runs.size(); ++r) {
      const RunData& run = campaign.runs[r];
      if (run.steady || !run.has[ch] || run.bins.size() < 6) continue;
      const Condition& q = campaign.conditions[static_cast<std::size_t>(run.condition)];
      double mx = 0, my = 0, n = 0;
      for (std::size_t b = 0; b < run.bins.size(); ++b)
        if (run.bins[b].time > 0.3 * run.bins.back().time) {
          mx += q.forward_velocity * run.bins[b].time;
          my += run.mean[ch][b] - before[r][ch][b];
          ++n;
        }
      mx /= n;
      my /= n;
      for (std::size_t b = 0; b < run.bins.size(); ++b)
        if (run.bins[b].time > 0.3 * run.bins.back().time) {
          const double x = q.forward_velocity * run.bins[b].time - mx, y = run.mean[ch][b] - before[r][ch][b] - my;
          xy += x * y;
          xx += x * x;
          var += x * x * std::pow(model.noise().sample[ch], 2) / run.bins[b].samples;
          reach = std::max(reach, q.forward_velocity * run.bins[b].time);
        }
    }
    if (var > 0 && std::abs(xy) / std::sqrt(var) > 5) {
      Located l;
      l.channel = channel_name(static_cast<int>(ch));
      l.unit = channel_unit(static_cast<int>(ch));
      l.where["position"] = {0, reach};
      l.size = xy / xx * reach;
      l.significance = std::abs(xy) / std::sqrt(var);
      list.push_back(std::move(l));
    }
    std::sort(list.begin(), list.end(), [](const Located& a, const Located& b) { return a.significance > b.significance; });
    if (list.size() > 3) list.resize(3);
    for (Located& l : list) out.push_back(std::move(l));
  }
  return out;
}

}  // namespace terrode::diagnosis
