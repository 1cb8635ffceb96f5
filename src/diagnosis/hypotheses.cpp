#include "diagnosis/hypotheses.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/linear_algebra.h"

namespace terrode::diagnosis {
namespace {

// Within runs as rough as this (grains under a small wheel: a fifth) the ripple of lugs, a tenth, can hide.
constexpr double kRough = 0.15;

}  // namespace

std::vector<std::vector<Hypothesis>> listed(const Model& model, const Options& options, const RippleSearch& ripples) {
  const Campaign& c = model.campaign();
  std::array<bool, kChannels> has{};
  bool series = false;
  for (const RunData& r : c.runs) {
    series = series || !r.steady;
    for (std::size_t ch = 0; ch < kChannels; ++ch) has[ch] = has[ch] || r.has[ch];
  }
  int highest_pass = 1;
  for (const Condition& q : c.conditions) {
    highest_pass = std::max(highest_pass, q.pass);
  }
  effects::Surroundings at{c.wheel.radius, c.believed.friction_angle, static_cast<double>(c.known_grousers),
                           ripples.runs >= 3 && ripples.roughness < kRough};
  for (const RippleLine& l : ripples.lines)
    if (l.order >= 4) at.lugs = l.order;
  std::vector<std::vector<Hypothesis>> out;
  for (const effects::EffectType& t : effects::all_effects()) {
    const std::string id(t.info->id);
    const effects::Fingerprint& mark = t.info->fingerprint;
    const effects::Search& search = t.info->search;
    if (search.ripple_alone || std::find(options.without.begin(), options.without.end(), id) != options.without.end()) continue;
    if (mark.with_pass && highest_pass < 2) continue;
    if (!series && (mark.with_time || mark.with_position || search.needs_series)) continue;
    // What rig or sensor do to one channel needs that channel.
    bool of_one_channel = false;
    for (const effects::Parameter& p : t.info->parameters) of_one_channel = of_one_channel || p.name == "channel";
    if (t.info->cls == effects::Class::rig && !of_one_channel) {
      const int moved = (mark.pull != 0) + (mark.torque != 0) + (mark.sinkage != 0);
      if (moved == 1 && !((mark.pull && has[0]) || (mark.torque && has[1]) || (mark.sinkage && has[2]))) continue;
    }
    std::vector<effects::Start> from = search.starts ? search.starts(at) : std::vector<effects::Start>{{}};
    if (from.empty()) continue;
    // Every form of the law; a choice of channel makes candidates of their own.
    for (const effects::Parameter& p : t.info->parameters) {
      const std::string name(p.name);
      if (p.scale != effects::Scale::choice || from.front().contains(name)) continue;
      std::vector<effects::Start> wider;
      for (const effects::Start& start : from)
        for (int choice = static_cast<int>(p.lower); choice <= static_cast<int>(p.upper); ++choice) {
          if (name == "channel" && !has[static_cast<std::size_t>(choice)]) continue;
          wider.push_back(start);
          wider.back()[name] = choice;
        }
      from = std::move(wider);
    }
    std::vector<Hypothesis> starts;
    for (effects::Start& start : from) {
      Hypothesis h;
      h.effects = {{id, std::move(start)}};
      if (of_one_channel) {
        out.push_back({std::move(h)});
      } else {
        starts.push_back(std::move(h));
      }
    }
    if (!starts.empty()) out.push_back(std::move(starts));
  }
  return out;
}

std::vector<Hypothesis> nameless(const Campaign& c) {
  std::vector<Hypothesis> out;
  std::set<double> loads;
  for (const Condition& q : c.conditions) loads.insert(q.normal_load);
  bool has[kChannels] = {false, false, false};
  for (const RunData& r : c.runs)
    for (int ch = 0; ch < kChannels; ++ch) has[ch] = has[ch] || r.has[static_cast<std::size_t>(ch)];
  for (int ch = 0; ch < kChannels; ++ch)
    for (int shape = 0; shape < free_shape_count(); ++shape)
      for (int power = 0; power <= (loads.size() > 1 ? 2 : 0); ++power) {
        if (!has[ch]) continue;
        Hypothesis h;
        h.free_channel = ch;
        h.free_shape = shape;
        h.free_power = power;
        out.push_back(h);
      }
  return out;
}

Hypothesis joined(const Hypothesis& a, const Hypothesis& b) {
  Hypothesis out = a;
  for (const Hypothesis::Member& m : b.effects) out.effects.push_back(m);
  if (b.free_channel >= 0) {
    out.free_channel = b.free_channel;
    out.free_shape = b.free_shape;
    out.free_power = b.free_power;
  }
  return out;
}

Hypothesis continued(const Model& model, const Tried& t) {
  Hypothesis out = t.hypothesis;
  const auto values = model.effects_of(t.hypothesis, t.fit);
  for (Hypothesis::Member& m : out.effects) {
    for (const auto& [name, v] : values.at(m.id))
      if (std::isfinite(v)) m.start[name] = v;
  }
  return out;
}

bool contains(const Hypothesis& h, const std::string& id) {
  for (const Hypothesis::Member& m : h.effects)
    if (m.id == id) return true;
  return false;
}

double first_coordinate(const FitParameter& p, const Hypothesis::Member& member) {
  const auto given = member.start.find(p.name);
  double v = p.strength ? p.null_value + 0.1 * p.prior_deviation : p.prior_mean;
  if (given != member.start.end()) v = to_coordinate(given->second, p.scale);
  return std::clamp(v, p.lower, p.upper);
}

double overdispersion(const Fit& f) {
  return std::max(1.0, f.chi2 / std::max(1, f.data - f.acting));
}

Projected::Projected(const Model& m, const Tried& t) : model(m) {
  const Eigen::MatrixXd j = m.jacobian(t.hypothesis, t.fit);
  q = orthonormal_columns(j);
  r = m.residuals(t.hypothesis, t.fit);
}

Eigen::VectorXd Projected::direction(const Hypothesis& h, const Fit& f, double least) const {
  const Eigen::VectorXd moved = model.residuals(h, f);
  if (moved.size() != r.size()) return {};
  Eigen::VectorXd g = moved - r;
  const double whole = g.norm();
  g -= q * (q.transpose() * g);
  const double length = g.norm();
  if (!(length > 1e-9 && length > least * whole)) return {};
  return g;
}

double Projected::score(const Hypothesis& h, const Fit& f) const {
  const Eigen::VectorXd g = direction(h, f, 1e-7);
  return g.size() ? std::pow(g.dot(r) / g.norm(), 2) : 0.0;
}

}  // namespace terrode::diagnosis
