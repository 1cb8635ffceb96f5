#include "diagnosis/reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/parallel.h"

namespace terrode::diagnosis {
namespace {

// What the plain model leaves of the runs of one condition, run by run; no value where a run lacks the channel.
using Left = std::vector<std::array<std::optional<double>, kChannels>>;

std::vector<Left> left_by_condition(const Campaign& c, const std::vector<std::array<std::vector<double>, kChannels>>& predicted) {
  std::vector<Left> out(c.conditions.size());
  for (std::size_t r = 0; r < c.runs.size(); ++r) {
    std::array<std::optional<double>, kChannels> left;
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      if (!c.runs[r].has[ch]) continue;
      const auto m = settled_means(c.runs[r], predicted[r], ch);
      left[ch] = m[0] - m[1];
    }
    out[static_cast<std::size_t>(c.runs[r].condition)].push_back(left);
  }
  return out;
}

std::optional<double> left_at(const Left& at, std::size_t repeat, std::size_t ch) {
  if (repeat < at.size()) return at[repeat][ch];
  double sum = 0;
  int n = 0;
  for (const auto& run : at)
    if (run[ch]) {
      sum += *run[ch];
      ++n;
    }
  return n ? std::optional(sum / n) : std::nullopt;
}

}  // namespace

Fit fit_plain(Model& model, int threads) {
  const Campaign& c = model.campaign();
  const Eigen::VectorXd believed = model.base_of(c.believed, c.believed_angles);
  const Hypothesis none;
  model.estimate_noise(believed);
  std::vector<Eigen::VectorXd> starts = {believed};
  for (const double ln_k : {-1.0, 1.0})
    for (const double ln_shear : {0.0, 1.5}) {
      Eigen::VectorXd b = believed;
      b(kLnK) += ln_k;
      b(kLnShear) += ln_shear;
      b(kA0) = 0.2;
      b(kA1) = 0.4;
      starts.push_back(b);
    }
  std::vector<Fit> fits(starts.size());
  parallel_for(starts.size(), threads, [&](std::size_t i) { fits[i] = model.fit(none, starts[i]); });
  Fit best;
  best.chi2 = std::numeric_limits<double>::infinity();
  for (const Fit& f : fits)
    if (!std::isfinite(best.chi2) || cost(f) < cost(best) - 1e-6) best = f;
  if (!std::isfinite(best.chi2))
    throw RunError("diagnose: the plain model has no solution near the believed soil; check loads, wheel and soil");
  model.estimate_noise(best.base);
  return model.fit(none, best.base);
}

Relative relative_to(Campaign campaign, const Campaign& reference, int threads) {
  Model model(reference);
  const Fit plain = fit_plain(model, threads);
  const std::vector<Left> left = left_by_condition(reference, model.predict({}, plain));

  Relative out;
  out.reference = reference;
  out.run_in = std::exp(plain.base(kLnRunIn));
  Campaign& c = out.campaign;
  c = campaign;
  c.runs.clear();
  c.conditions.clear();
  c.replicated_conditions = 0;
  int alone = 0;
  std::array<bool, kChannels> lacking{};
  for (const Condition& q : campaign.conditions) {
    const auto found = std::find_if(reference.conditions.begin(), reference.conditions.end(), [&](const Condition& o) { return same_condition(q, o); });
    const auto here = &q - campaign.conditions.data();
    if (found == reference.conditions.end()) {
      alone += q.runs;
      continue;
    }
    const Left& at = left[static_cast<std::size_t>(found - reference.conditions.begin())];
    Condition kept = q;
    kept.runs = 0;
    std::size_t repeat = 0;
    for (const RunData& run : campaign.runs) {
      if (run.condition != here) continue;
      RunData moved = run;
      moved.condition = static_cast<int>(c.conditions.size());
      for (std::size_t ch = 0; ch < kChannels; ++ch) {
        if (!moved.has[ch]) continue;
        const std::optional<double> shift = left_at(at, repeat, ch);
        if (!shift) {
          lacking[ch] = true;
          moved.has[ch] = false;
          moved.mean[ch].clear();
          moved.series[ch].clear();
          continue;
        }
        for (double& v : moved.mean[ch]) v -= *shift;
        for (double& v : moved.series[ch]) v -= *shift;
      }
      ++repeat;
      if (!std::any_of(moved.has.begin(), moved.has.end(), [](bool h) { return h; })) continue;
      ++kept.runs;
      c.runs.push_back(std::move(moved));
    }
    if (kept.runs == 0) continue;
    if (kept.runs > 1) ++c.replicated_conditions;
    c.conditions.push_back(kept);
  }
  if (c.runs.empty())
    throw InputError(Problem{{}, 0, 0, "--reference", fmt::format("'{}' shares no condition with '{}'", reference.title, campaign.title),
                             "a recording with runs at the same slips, loads, speeds and passes"});
  // The soil is the reference's, and so are its tests, as the refitted model has them.
  c.curves = reference.curves;
  const auto curves = model.predict_curves({}, plain);
  for (std::size_t i = 0; i < curves.size(); ++i) c.curves[i].y = curves[i];
  c.believed = model.soil_of(plain.base);
  c.believed_angles = model.angles_of(plain.base);
  c.complete_belief = c.known_soil = true;
  c.remarks.push_back(fmt::format("beside '{}': its refitted soil is the belief, and what the plain model leaves of it is taken off", reference.title));
  if (alone) c.remarks.push_back(fmt::format("{} runs at conditions that the reference does not have were left out", alone));
  for (std::size_t ch = 0; ch < kChannels; ++ch)
    if (lacking[ch]) c.remarks.push_back(fmt::format("the reference lacks {} in runs where this recording has it: left out there", channel_name(static_cast<int>(ch))));
  return out;
}

bool shown_by_reference(const RippleLine& line, const Relative& relative) {
  if (relative.reference.runs.empty()) return false;
  // A wheel out of round is found by a sine of its angle and not in the spectra.
  if (line.lock == Lock::wheel && line.order == 1) {
    const auto lines = find_ripples(relative.reference, relative.run_in).lines;
    return std::any_of(lines.begin(), lines.end(), [&](const RippleLine& l) { return l.lock == Lock::wheel && l.order == 1 && l.amplitude[2] >= 0.25 * line.amplitude[2]; });
  }
  const RippleLine there = same_law(line, relative.reference, relative.run_in);
  const auto lead = static_cast<std::size_t>(std::max_element(line.channel_score.begin(), line.channel_score.end()) - line.channel_score.begin());
  return there.amplitude[lead] >= 0.25 * line.amplitude[lead];
}

}  // namespace terrode::diagnosis
