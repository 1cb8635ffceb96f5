#include "diagnosis/held_out.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "core/problem.h"
#include "core/parallel.h"

namespace terrode::diagnosis {
namespace {

// From so many held-out blocks on the loudest for and the loudest against are left out.
constexpr std::size_t kBlocksToTrim = 6;

}  // namespace

std::vector<std::pair<std::string, std::vector<char>>> blocks_of(const Campaign& c) {
  std::map<double, int> loads, speeds;
  for (const RunData& r : c.runs) {
    const Condition& q = c.conditions[static_cast<std::size_t>(r.condition)];
    ++loads[std::round(q.normal_load * 10) / 10];
    ++speeds[q.angular_velocity];
  }
  const auto commonest = [](const std::map<double, int>& m) {
    return std::max_element(m.begin(), m.end(), [](const auto& a, const auto& b) { return a.second < b.second; })->first;
  };
  const double load = commonest(loads), speed = commonest(speeds);
  std::vector<std::pair<std::string, std::vector<char>>> out;
  const auto add = [&](const std::string& name, const std::function<bool(const Condition&)>& in) {
    std::vector<char> held(c.runs.size(), 0);
    int n = 0;
    for (std::size_t r = 0; r < c.runs.size(); ++r)
      if (in(c.conditions[static_cast<std::size_t>(c.runs[r].condition)])) {
        held[r] = 1;
        ++n;
      }
    if (n > 0 && n < static_cast<int>(c.runs.size()) - 3) out.emplace_back(name, std::move(held));
  };
  const auto plain = [&](const Condition& q) { return std::abs(q.normal_load - load) < 0.05 * load && q.angular_velocity == speed && q.pass == 1; };
  for (const auto& [w, n] : loads)
    if (std::abs(w - load) > 0.05 * load && loads.size() <= 8) add(fmt::format("load {:.4g} N", w), [w = w](const Condition& q) { return std::abs(q.normal_load - w) < 0.06; });
  for (const auto& [v, n] : speeds)
    if (v != speed) add(fmt::format("speed {:.4g} rad/s", v), [v = v](const Condition& q) { return q.angular_velocity == v; });
  std::set<int> passes;
  for (const Condition& q : c.conditions) passes.insert(q.pass);
  for (const int p : passes)
    if (p > 1) add(fmt::format("pass {}", p), [p](const Condition& q) { return q.pass == p; });
  add("slips below 0", [&](const Condition& q) { return plain(q) && q.slip < 0; });
  add("slips 0 to 0.15", [&](const Condition& q) { return plain(q) && q.slip >= 0 && q.slip < 0.15; });
  add("slips 0.15 to 0.45", [&](const Condition& q) { return plain(q) && q.slip >= 0.15 && q.slip < 0.45; });
  add("slips above 0.45", [&](const Condition& q) { return plain(q) && q.slip >= 0.45; });
  return out;
}

Fold fold(const Model& model, const Tried& from, const Hypothesis& h, const std::vector<char>& held, int iterations, bool of_series) {
  const Campaign& campaign = model.campaign();
  Fold out;
  std::vector<char> use(held.size());
  for (std::size_t r = 0; r < use.size(); ++r) use[r] = !held[r];
  out.fit = model.fit(h, from.fit.base, {}, use, iterations);
  if (!std::isfinite(out.fit.chi2)) return out;
  try {
    const auto p = model.predict(h, out.fit);
    for (std::size_t r = 0; r < use.size(); ++r)
      for (std::size_t ch = 0; ch < kChannels; ++ch)
        if (held[r] && campaign.runs[r].has[ch]) {
          const auto m = settled_means(campaign.runs[r], p[r], ch);
          out.squares[ch] += std::pow(m[0] - m[1], 2);
          ++out.count[ch];
        }
    if (of_series) {
      // Curves of the soil take part in both.
      const std::vector<char> none(held.size(), 0);
      out.chi2 = model.residuals(h, out.fit, held).squaredNorm() - model.residuals(h, out.fit, none).squaredNorm();
    }
    out.solved = true;
  } catch (const RunError&) {
  }
  return out;
}

HeldOut held_out(const Model& model, const Tried& a, const Tried& b, bool of_series, int threads) {
  const auto blocks = blocks_of(model.campaign());
  const std::array<const Tried*, 2> both = {&a, &b};
  const std::array<Hypothesis, 2> from = {continued(model, a), continued(model, b)};
  using Folds = std::array<Fold, 2>;
  std::vector<Folds> folds(blocks.size());
  parallel_for(2 * blocks.size(), threads, [&](std::size_t k) { folds[k / 2][k % 2] = fold(model, *both[k % 2], from[k % 2], blocks[k / 2].second, 6, of_series); });
  std::erase_if(folds, [](const Folds& f) { return !f[0].solved || !f[1].solved; });
  const auto heard = [&](const auto& takes_part, const auto& gain) {
    std::vector<const Folds*> out;
    for (const Folds& f : folds)
      if (takes_part(f)) out.push_back(&f);
    std::sort(out.begin(), out.end(), [&](const Folds* x, const Folds* y) { return gain(*x) < gain(*y); });
    if (out.size() >= kBlocksToTrim) {
      if (gain(*out.back()) > 0) out.pop_back();
      if (gain(*out.front()) < 0) out.erase(out.begin());
    }
    return out;
  };
  HeldOut out;
  for (std::size_t ch = 0; ch < kChannels; ++ch) {
    int n = 0;
    for (const Folds* f : heard([ch](const Folds& x) { return x[0].count[ch] > 0; }, [ch](const Folds& x) { return x[0].squares[ch] - x[1].squares[ch]; })) {
      n += (*f)[0].count[ch];
      for (std::size_t k = 0; k < 2; ++k) out.error[k][ch] += (*f)[k].squares[ch];
    }
    for (auto& o : out.error) o[ch] = n ? std::sqrt(o[ch] / n) : 0.0;
  }
  if (!of_series) return out;
  const auto gain = [](const Folds& f) { return f[0].chi2 - f[1].chi2; };
  for (const Folds* f : heard([](const Folds&) { return true; }, gain)) out.series += gain(*f);
  return out;
}

}  // namespace terrode::diagnosis
