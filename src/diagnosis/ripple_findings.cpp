#include "diagnosis/ripple_findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "diagnosis/words.h"
#include "effects/effect.h"

namespace terrode::diagnosis {
namespace {

bool can_be(const RippleLine& l, Lock lock) {
  return l.lock == lock || std::find(l.alternatives.begin(), l.alternatives.end(), lock) != l.alternatives.end();
}

// A line that only the drawbar pull shows.
bool pull_alone(const RippleLine& l) { return l.channel_score[0] > 15 && l.channel_score[1] < 0.25 * l.channel_score[0] && l.channel_score[2] < 0.25 * l.channel_score[0]; }

// Root mean square ripple of a soil that fails in small blocks, over the rim force: every smooth wheel on sand shows
// about one percent (Shikanai et al. 2000 call it small); a cause is named from twice that.
constexpr double kNaturalRipple = 0.018;

}  // namespace

RippleFindings findings_of(const RippleSearch& ripples, const Campaign& campaign, const Options& options) {
  RippleFindings out;
  const double strongest = ripples.lines.empty() ? 0.0 : ripples.lines.front().relative;
  for (const RippleLine& l : ripples.lines) {
    if (&l != &ripples.lines.front() && l.relative < 0.3 * strongest && l.channel_score[2] < 20) continue;
    Finding f;
    const bool sinkage_leads = l.channel_score[2] > 10 && l.channel_score[2] > 2.0 * std::max(l.channel_score[0], l.channel_score[1]);
    std::vector<std::string> ids;
    switch (l.lock) {
      case Lock::wheel:
        if (sinkage_leads || (l.relative > 0.01 && l.score > 15)) ids = {l.order <= 2 ? "eccentricity" : "grousers"};
        // Lugs work on the soil and so on every channel; a carriage that swings shows in the pull alone.
        if (!ids.empty() && l.order > 2 && can_be(l, Lock::time) && pull_alone(l)) ids = {"carriage_resonance"};
        break;
      case Lock::slip_path:
        if (l.relative > kNaturalRipple) ids = {"periodic_failure"};
        break;
      case Lock::time:
        if (l.relative > 0.012 || sinkage_leads) ids = {sinkage_leads ? "undamped_bed" : "carriage_resonance"};
        // Where all runs have one speed it may be the wheel's as well.
        if (!ids.empty() && l.order > 2 && !pull_alone(l)) ids.insert(ids.begin(), "grousers");
        break;
      case Lock::travel:
        if (l.relative > 0.012 || sinkage_leads) ids = {l.wavelength > 0.03 ? "undulation" : "node_ripple"};
        break;
    }
    for (const Lock a : l.alternatives) {
      if (ids.empty()) break;
      if (ids.front() == "carriage_resonance" && pull_alone(l)) break;
      const char* id = "periodic_failure";
      if (a == Lock::wheel) id = l.order <= 2 ? "eccentricity" : "grousers";
      if (a == Lock::time) id = "carriage_resonance";
      if (a == Lock::travel) id = "node_ripple";
      if (std::find(ids.begin(), ids.end(), id) == ids.end()) ids.emplace_back(id);
    }
    std::erase_if(ids, [&](const std::string& id) { return std::find(options.without.begin(), options.without.end(), id) != options.without.end(); });
    if (ids.empty()) continue;
    f.ids = ids;
    f.probability = 0.97;
    for (const std::string& id : ids) f.share[id] = 0.97 / static_cast<double>(ids.size());
    const effects::Info& info = *effects::find_effect(ids.front())->info;
    f.cls = effects::class_name(info.cls);
    f.equation = info.equation;
    f.source = info.source;
    if (ids.front() == "grousers") f.parameters["count"] = {l.order, 0, "-"};
    if (ids.front() == "eccentricity") f.parameters["offset"] = {l.amplitude[2], 0.2 * l.amplitude[2], "m"};
    if (ids.front() == "periodic_failure") {
      f.parameters["amplitude"] = {l.relative, 0.1 * l.relative, "-"};
      f.parameters["wavelength"] = {l.wavelength, 0.05 * l.wavelength, "m"};
    }
    if (ids.front() == "carriage_resonance") {
      f.parameters["frequency"] = {l.frequency, 0.01 * l.frequency, "Hz"};
      f.parameters["amplitude"] = {l.amplitude[0], 0.1 * l.amplitude[0], "N"};
    }
    if (ids.front() == "undamped_bed") f.parameters["frequency"] = {l.frequency, 0.01 * l.frequency, "Hz"};
    if (ids.front() == "node_ripple") f.parameters["spacing"] = {l.wavelength, 0.01 * l.wavelength, "m"};
    if (ids.front() == "undulation") {
      f.parameters["wavelength"] = {l.wavelength, 0.02 * l.wavelength, "m"};
      f.parameters["amplitude"] = {l.amplitude[2], 0.1 * l.amplitude[2], "m"};
    }
    f.change = l.amplitude;
    f.statement = fmt::format("{}: a line locked to {} in {} runs, {:.3g} N in drawbar pull and {:.3g} N m in torque; {}.", info.name, lock_name(l.lock), ripples.runs,
                              l.amplitude[0], l.amplitude[1], strength_text(f.parameters));
    Located place;
    place.channel = sinkage_leads ? channel_name(2) : channel_name(0);
    place.unit = sinkage_leads ? "m" : "N";
    place.size = sinkage_leads ? l.amplitude[2] : l.amplitude[0];
    place.significance = l.deviations;
    if (l.lock == Lock::wheel) place.where["order"] = {l.order, l.order};
    if (l.lock == Lock::time) place.where["frequency"] = {l.frequency, l.frequency};
    if (l.lock == Lock::travel || l.lock == Lock::slip_path) {
      std::set<double> slips;
      for (const Condition& q : campaign.conditions)
        if (std::isfinite(q.slip)) slips.insert(q.slip);
      if (!slips.empty()) place.where["slip"] = {*slips.begin(), *slips.rbegin()};
    }
    out.places.push_back(place);
    out.findings.push_back(std::move(f));
  }
  return out;
}

}  // namespace terrode::diagnosis
