#include "diagnosis/quality.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace terrode::diagnosis {

std::vector<std::string> contradictions(const Campaign& campaign) {
  std::vector<std::string> out;
  int impossible = 0, checked = 0;
  std::map<double, std::vector<std::pair<double, double>>> pulls;
  for (const RunData& r : campaign.runs) {
    const Condition& q = campaign.conditions[static_cast<std::size_t>(r.condition)];
    const auto mean = [&](std::size_t ch) {
      double s = 0, n = 0;
      for (std::size_t b = 0; b < r.mean[ch].size(); ++b) {
        if (!r.steady && r.bins[b].time < 0.3 * r.bins.back().time) continue;
        s += r.mean[ch][b];
        ++n;
      }
      return n > 0 ? s / n : 0.0;
    };
    if (r.has[0] && r.has[1] && q.slip > 0.05 && q.angular_velocity > 0) {
      ++checked;
      const double in = mean(1) * q.angular_velocity, work = mean(0) * q.forward_velocity;
      if (in - work < -0.05 * std::abs(work) - 1e-9) ++impossible;
    }
    if (r.has[0]) pulls[q.normal_load].emplace_back(q.slip, mean(0) / q.normal_load);
  }
  if (checked > 0 && 3 * impossible > checked)
    out.push_back(fmt::format("{} of {} driven runs give out more work than they take in (T omega < DP v): a sign, a unit or a gain is wrong", impossible, checked));
  double low = 0, high = 0;
  int nl = 0, nh = 0;
  for (const auto& [load, list] : pulls)
    for (const auto& [s, p] : list) {
      if (s < -0.05) {
        low += p;
        ++nl;
      }
      if (s > 0.15) {
        high += p;
        ++nh;
      }
    }
  if (nl > 0 && nh > 0 && high / nh < low / nl)
    out.push_back("drawbar pull falls from negative to positive slip: its sign is the other way round");
  for (std::size_t ch = 0; ch < kChannels; ++ch) {
    double top = 0;
    bool has = false;
    for (const RunData& r : campaign.runs) {
      has = has || r.has[ch];
      for (const double v : r.mean[ch]) top = std::max(top, std::abs(v));
    }
    if (has && top == 0)
      out.push_back(fmt::format("{} is zero in every run", channel_name(static_cast<int>(ch))));
  }
  return out;
}

}  // namespace terrode::diagnosis
