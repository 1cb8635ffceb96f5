#include "diagnosis/diagnose.h"

#include <fmt/format.h>
#include <gsl/gsl_cdf.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "core/linear_algebra.h"
#include "core/parallel.h"
#include "core/random.h"
#include "diagnosis/held_out.h"
#include "diagnosis/hypotheses.h"
#include "diagnosis/locate.h"
#include "diagnosis/quality.h"
#include "diagnosis/reference.h"
#include "diagnosis/ripple_findings.h"
#include "diagnosis/words.h"

namespace terrode::diagnosis {
namespace {

// A law leaves over about a tenth of what it changes when nature follows another published form of it; squared. What a
// rig or a sensor does to a reading is known better.
constexpr double kFormError = 0.01, kReadingError = 0.002;
// What statics or a constant of a sensor can leave over, as a share of the chi-square that it gains: 2 % of what it changes.
constexpr double kExactError = 5e-4;
// Chi-square that nameless terms must gain beyond the gate, which is that of the listed effects.
constexpr double kNamelessMore = 8.0;
// Odds (nats) that a further effect must bring, for it is picked from many.
constexpr double kFurther = 6.0;
// As many more where it is of those that the first is confused with.
constexpr double kAlike = 12.0;
// Share of what a member explains that a rival in its place must explain: another published form of the true law does. Where
// the member stands so many gates beyond chance.
constexpr double kRival = 0.3, kFarBeyond = 2.0;
// Flattens the odds of rivals; found on campaigns with known causes (tools/make-campaigns).
constexpr double kTemperature = 1.5;
// Root mean square misfit of runs' means over their scatter that sound explanations stay below, and the square of what
// they reach by chance.
constexpr double kPoorFit = 1.45, kScatterOfFit = 1.7;
// What they reach where two or three repeats show half of the scatter.
constexpr double kPoorByChance = 1.8;
// Independent looks at that share which one channel gives.
constexpr double kLooks = 8.0;

// How often a set holds whose odds, as weighed, are p: logistic in the logarithm of the odds. Weighed odds near 0.9 hold too
// seldom, for what a set is cut off at is chosen after the fact; fitted on campaigns of `tools/make-campaigns`.
constexpr double kHeldShift = -3.4, kHeldSlope = 1.3;
// The most that is stated: of 191 statements at 0.98 and above in two banks 184 held.
constexpr double kMostHeld = 0.97;
// The most that is stated where the scatter is assumed and not measured.
constexpr double kWithoutRepeats = 0.9;
double probability_held(double p) {
  const double odds = std::clamp(p, 1e-9, 1.0 - 1e-9);
  return std::min(kMostHeld, 1.0 / (1.0 + std::exp(-kHeldShift - kHeldSlope * std::log(odds / (1.0 - odds)))));
}

}  // namespace

// The steps, one function each, share what they know through this.
class Diagnoser {
 public:
  Diagnoser(const recording::Recording& recording, const Options& options)
      : recording_(recording), options_(options), relative_(campaign_of(recording, options)), campaign_(relative_.campaign), model_(campaign_) {}

  Diagnosis run() {
    out_.title = campaign_.title;
    out_.remarks = campaign_.remarks;
    for (const std::string& r : recording_.remarks) out_.remarks.push_back(r);
    out_.wheel = campaign_.wheel;
    out_.conditions = campaign_.conditions;
    step(0.02, "noise and plain fit");
    for (const std::string& c : contradictions(campaign_)) {
      suspicious_ = c;
      out_.remarks.push_back(c);
    }
    plain_.fit = fit_plain(model_, options_.threads);
    note_belief();
    step(0.12, "ripples");
    ripples_ = find_ripples(campaign_, std::exp(plain_.fit.base(kLnRunIn)));
    // What the reference shows as strongly is not what sets the two apart.
    std::erase_if(ripples_.lines, [&](const RippleLine& l) { return shown_by_reference(l, relative_); });
    for (const RippleLine& l : ripples_.lines)
      if (l.lock == Lock::wheel && l.order == 1 && l.channel_score[2] > 50) {
        model_.allow_eccentricity(l.amplitude[2], plain_.fit.base);
        plain_.fit = model_.fit({}, plain_.fit.base);
        note_belief();
      }
    step(0.15, "every effect by itself");
    try_singles();
    gate();
    step(0.55, "pairs");
    if (something_off_) combine();
    step(0.75, "held-out blocks");
    decide();
    step(1.0, "done");
    return std::move(out_);
  }

 private:
  static Relative campaign_of(const recording::Recording& recording, const Options& options) {
    if (!options.reference) return {reduce(recording), {}, 0.0};
    options.progress.report(0.0, "reference");
    return relative_to(reduce(recording), reduce(*options.reference), options.threads);
  }

  void step(double fraction, const std::string& what) {
    options_.progress.report(fraction, what);
    if (options_.progress.stop_requested()) throw Interrupted("diagnose: stopped; nothing was written");
  }

  // The plain model at what the laboratory believes.
  void note_belief() {
    const Hypothesis none;
    const Eigen::VectorXd believed = model_.base_of(campaign_.believed, campaign_.believed_angles);
    std::vector<bool> fixed(kBaseCount, false);
    for (int i = 0; i <= kA1; ++i) fixed[static_cast<std::size_t>(i)] = true;
    believed_ = {none, model_.fit(none, believed, fixed)};
    out_.noise = model_.noise();
  }

  // Every run settles within a fraction of a contact length; that is no run-in.
  bool only_usual_start_up(const Tried& t) const {
    if (!std::isfinite(t.fit.chi2)) return false;
    for (const FitParameter& p : t.fit.parameters) {
      if (!p.strength || effects::find_effect(t.hypothesis.effects[p.effect].id)->info->search.beside.empty()) continue;
      const std::size_t k = static_cast<std::size_t>(&p - t.fit.parameters.data());
      if (t.fit.extra[k] < 1.3 * usual_start_up(campaign_.wheel.radius)) return true;
    }
    return false;
  }

  Tried best_of(const std::vector<Hypothesis>& starts, const Eigen::VectorXd& base, int iterations = 20) const {
    Tried best;
    best.fit.chi2 = std::numeric_limits<double>::infinity();
    // A start-up that the plain model stretched to its limit was made to explain something else.
    Eigen::VectorXd from = base;
    const Eigen::VectorXd usual = model_.base_of(campaign_.believed, campaign_.believed_angles);
    if (base(kLnRunIn) > std::log(0.9 * usual_start_up(campaign_.wheel.radius))) from.segment(kLnRunIn, kBaseCount - kLnRunIn) = usual.segment(kLnRunIn, kBaseCount - kLnRunIn);
    std::vector<std::pair<const Hypothesis*, const Eigen::VectorXd*>> list;
    for (const Hypothesis& h : starts) {
      list.emplace_back(&h, &from);
      // What changes along a run, or limits the shear, bends the plain model's fit far away from the soil.
      if (h.effects.size() != 1) continue;
      const effects::Info& info = *effects::find_effect(h.effects.front().id)->info;
      constexpr double far = 0.05;  // rad
      const bool bent = campaign_.complete_belief && std::abs(base(kPhi) - usual(kPhi)) > far;
      if (info.fingerprint.with_position || info.fingerprint.with_time || (info.cls == effects::Class::shear && bent)) list.emplace_back(&h, &usual);
    }
    for (const auto& [hypothesis, start] : list) {
      const Hypothesis& h = *hypothesis;
      Tried t{h, model_.fit(h, *start, {}, {}, iterations)};
      if (only_usual_start_up(t)) t.fit.chi2 = t.fit.penalty = std::numeric_limits<double>::infinity();
      if (!std::isfinite(best.fit.chi2) || (std::isfinite(t.fit.chi2) && cost(t.fit) < cost(best.fit))) best = std::move(t);
    }
    return best;
  }

  // First-order gain of a start at a fit, whose hypothesis it extends.
  double promise(const Hypothesis& start, const Projected& at, const Tried& from) const {
    Fit f = from.fit;
    f.parameters = model_.parameters_of(start);
    for (std::size_t k = from.fit.parameters.size(); k < f.parameters.size(); ++k)
      f.extra.push_back(first_coordinate(f.parameters[k], start.effects[f.parameters[k].effect]));
    return at.score(start, f);
  }

  // Of many starts those whose first-order gain is highest: a fit finds its way from the nearest.
  std::vector<Hypothesis> most_promising(const std::vector<Hypothesis>& starts, const Projected& at, const Tried& from, std::size_t most) const {
    if (starts.size() <= most) return starts;
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t i = 0; i < starts.size(); ++i) order.emplace_back(-promise(starts[i], at, from), i);
    std::sort(order.begin(), order.end());
    std::vector<Hypothesis> out;
    for (std::size_t i = 0; i < most; ++i) out.push_back(starts[order[i].second]);
    return out;
  }

  // Nameless terms on top of a fit: linear in their amplitude, so the six of highest first-order gain are worth a fit.
  std::vector<Hypothesis> promising_terms(const Projected& at, const Tried& from) const {
    const std::vector<Hypothesis> all = nameless(campaign_);
    std::vector<double> score(all.size());
    parallel_for(all.size(), options_.threads, [&](std::size_t i) {
      Fit f = from.fit;
      f.extra.push_back(1e-3);
      score[i] = at.score(joined(from.hypothesis, all[i]), f);
    });
    std::vector<std::size_t> order(all.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return score[a] > score[b]; });
    if (order.size() > 6) order.resize(6);
    std::vector<Hypothesis> out;
    for (const std::size_t i : order) out.push_back(all[i]);
    return out;
  }

  void try_singles() {
    starts_ = listed(model_, options_, ripples_);
    const std::size_t named = starts_.size();
    const Projected plain(model_, plain_);
    for (const Hypothesis& h : promising_terms(plain, plain_)) starts_.push_back({h});
    singles_.resize(starts_.size());
    parallel_for(starts_.size(), options_.threads, [&](std::size_t i) {
      singles_[i] = best_of(i < named ? most_promising(starts_[i], plain, plain_, 3) : starts_[i], plain_.fit.base);
    });
    named_ = named;
    lowest_ = plain_.fit.misfit;
    lowest_penalty_ = plain_.fit.penalty;
    note(singles_);
  }

  // Largest score over all effects, against its distribution where nothing is missing: directions of the effects after
  // those of the plain model are taken out, drawn jointly (max-T).
  void gate() {
    const Projected plain(model_, plain_);
    std::vector<Eigen::VectorXd> directions;
    for (std::size_t i = 0; i < named_; ++i) {
      const Hypothesis& h = starts_[i].front();
      const Hypothesis::Member& member = h.effects.front();
      Fit f = plain_.fit;
      f.parameters = model_.parameters_of(h);
      std::size_t strength = f.parameters.size();
      for (std::size_t k = 0; k < f.parameters.size(); ++k) {
        if (f.parameters[k].strength) strength = k;
        f.extra.push_back(first_coordinate(f.parameters[k], member));
      }
      if (strength == f.parameters.size()) continue;
      const FitParameter& p = f.parameters[strength];
      const double size = f.extra[strength] - p.null_value;
      const Eigen::VectorXd g = plain.direction(h, f, 1e-6);
      if (size == 0 || !g.size()) continue;
      const double length = g.norm();
      // A strength below its null value points the other way.
      directions.push_back(g / (size > 0 ? length : -length));
      std::string unit;
      for (const effects::Parameter& q : effects::find_effect(member.id)->info->parameters)
        if (q.strength) unit = q.unit;
      detect_.push_back({member.id + "." + p.name, std::abs(size) / length, p.scale, unit});
    }
    const auto n = static_cast<Eigen::Index>(directions.size());
    Eigen::MatrixXd c(n, n);
    for (Eigen::Index a = 0; a < n; ++a)
      for (Eigen::Index b = 0; b < n; ++b) c(a, b) = directions[static_cast<std::size_t>(a)].dot(directions[static_cast<std::size_t>(b)]);
    c.diagonal().array() += 1e-9;
    const Eigen::MatrixXd l = cholesky(c).lower;
    Random random(options_.seed);
    std::vector<double> top;
    for (int i = 0; i < 4000; ++i) {
      Eigen::VectorXd z(n);
      for (Eigen::Index k = 0; k < n; ++k) z(k) = random.normal();
      top.push_back(n ? (l * z).array().square().maxCoeff() : 0.0);
    }
    std::sort(top.begin(), top.end());
    // Shapes that are fitted too make a candidate a little more than its one direction.
    out_.gate = 1.25 * top[static_cast<std::size_t>(0.99 * static_cast<double>(top.size()))] + 3.0;
    double best = 0;
    for (std::size_t i = 0; i < named_; ++i) best = std::max(best, gain(singles_[i].fit));
    for (std::size_t i = named_; i < singles_.size(); ++i) best_free_ = std::max(best_free_, gain(singles_[i].fit));
    out_.gate_statistic = best;
    something_off_ = best > out_.gate || best_free_ > out_.gate + kNamelessMore || leaves_much(plain_);
  }

  // Chi-square that a fit gains over the plain one, in units of its own overdispersion.
  double gain(const Fit& f) const {
    return std::isfinite(f.chi2) ? (cost(plain_.fit) - cost(f)) / overdispersion(f) : -1.0;
  }

  // What has been seen to be possible, channel by channel: the lowest misfit of any explanation.
  void note(const Fit& f) {
    if (!std::isfinite(f.chi2)) return;
    for (std::size_t i = 0; i < lowest_.size(); ++i) lowest_[i] = std::min(lowest_[i], f.misfit[i]);
    lowest_penalty_ = std::min(lowest_penalty_, f.penalty);
  }
  void note(const std::vector<Tried>& list) {
    for (const Tried& t : list) note(t.fit);
  }

  // Log of the odds that the data give an explanation. Laws are published in several forms and none is exact: what a
  // law leaves over counts against a deviation that grows with what the law changes (kFormError of its chi-square), and
  // since that deviation is not known better than from a few independent looks, its tail is that of Student's t.
  double support(const Tried& t) const {
    const Fit& f = t.fit;
    if (!std::isfinite(f.chi2)) return -std::numeric_limits<double>::infinity();
    double out = f.occam;
    bool exact = t.hypothesis.free_channel < 0;
    for (const Hypothesis::Member& m : t.hypothesis.effects) exact = exact && effects::find_effect(m.id)->info->cls == effects::Class::rig;
    const double form_error = exact ? kReadingError : kFormError;
    for (std::size_t i = 0; i < lowest_.size(); ++i) {
      const double change = std::max(0.0, plain_.fit.misfit[i] - lowest_[i]);
      out -= 0.5 * kLooks * std::log1p(std::max(0.0, f.misfit[i] - lowest_[i]) / (kLooks + form_error * change));
    }
    return out - 0.5 * kLooks * std::log1p(std::max(0.0, f.penalty - lowest_penalty_) / kLooks);
  }

  // True where the member added last is taken for one of the others easily: it may be what their law's form leaves over.
  static bool alike(const Hypothesis& h) {
    const auto takes = [](const std::string& a, const std::string& b) {
      const auto& list = effects::find_effect(a)->info->confused_with;
      return std::find(list.begin(), list.end(), b) != list.end();
    };
    const std::string& last = h.effects.back().id;
    return std::any_of(h.effects.begin(), h.effects.end() - 1, [&](const auto& e) { return takes(e.id, last) || takes(last, e.id); });
  }

  // Grows the best explanation by one effect at a time while the evidence asks for it, looking at several beginnings.
  void combine() {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < named_; ++i) order.push_back(i);
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return support(singles_[a]) > support(singles_[b]); });
    best_ = singles_[order.front()];
    slots_ = {order.front()};
    for (int depth = 0; depth < 2; ++depth) {
      // Is there anything left to explain? The score of every other effect at the best fit tells, before any is fitted.
      std::vector<std::pair<double, std::vector<std::size_t>>> promising;
      std::vector<std::vector<std::size_t>> beginnings = {slots_};
      if (depth == 0)
        for (std::size_t k = 1; k < std::min<std::size_t>(5, order.size()); ++k)
          if (singles_[order[k]].hypothesis.effects.front().id != singles_[order[0]].hypothesis.effects.front().id) beginnings.push_back({order[k]});
      std::vector<std::vector<std::pair<double, std::vector<std::size_t>>>> found(beginnings.size());
      parallel_for(beginnings.size(), options_.threads, [&](std::size_t b) {
        const Tried& from = depth == 0 ? singles_[beginnings[b].front()] : best_;
        for (const auto& [score, i] : scores(from)) {
          std::vector<std::size_t> slots = beginnings[b];
          slots.push_back(i);
          found[b].emplace_back(score - cost(from.fit), std::move(slots));
        }
      });
      std::set<std::vector<std::size_t>> seen;
      for (auto& list : found)
        for (auto& [score, slots] : list) {
          std::vector<std::size_t> key = slots;
          std::sort(key.begin(), key.end());
          if (seen.insert(key).second) promising.emplace_back(score, slots);
        }
      std::sort(promising.begin(), promising.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
      if (promising.size() > 14) promising.resize(14);
      std::vector<Tried> tried(promising.size());
      parallel_for(promising.size(), options_.threads, [&](std::size_t k) { tried[k] = fit_slots(promising[k].second); });
      note(tried);
      weighed_.insert(weighed_.end(), tried.begin(), tried.end());
      const auto worth = [&](std::size_t k) { return support(tried[k]) - (alike(tried[k].hypothesis) ? kAlike : 0.0); };
      std::size_t top = tried.size();
      for (std::size_t k = 0; k < tried.size(); ++k) {
        if (!std::isfinite(tried[k].fit.chi2)) continue;
        if (top == tried.size() || worth(k) > worth(top)) top = k;
      }
      if (top == tried.size()) break;
      const double more = worth(top) - support(best_);
      const double chi = (cost(best_.fit) - cost(tried[top].fit)) / overdispersion(tried[top].fit);
      // A further effect must pay more than the first, for it has more company to be picked from, and it must help on
      // conditions that took no part in the fit: small change to a form that does not quite fit helps there little.
      out_.growth.push_back({tried[top].hypothesis.label(), more, lack_of_fit(best_), lack_of_fit(tried[top])});
      if (more < kFurther || chi < out_.gate + 6.0) break;
      // What by its nature moves no mean (a sensor that lags) is held against the whole series.
      const effects::Fingerprint& mark = effects::find_effect(tried[top].hypothesis.effects.back().id)->info->fingerprint;
      const bool of_series = mark.pull == 0 && mark.torque == 0 && mark.sinkage == 0;
      const HeldOut held = held_out(model_, best_, tried[top], of_series, options_.threads);
      const auto& [without, with] = held.error;
      // No channel may pay for another: what mends one and spoils the next is not the cause.
      const std::array<double, kChannels> floor = scatter_of_means();
      double improvement = 0, least = 0;
      for (std::size_t ch = 0; ch < kChannels; ++ch) {
        if (!(without[ch] > 0 && with[ch] > 0)) continue;
        improvement += std::log(without[ch] / with[ch]);
        least = std::min(least, std::log((without[ch] + floor[ch]) / (with[ch] + floor[ch])));
      }
      const bool helps = of_series ? held.series > out_.gate * overdispersion(tried[top].fit) : improvement >= (depth == 0 ? 0.15 : 0.25);
      if (!helps || least < -0.15) break;
      best_ = tried[top];
      slots_ = promising[top].second;
    }
  }

  // Expected deviation of the runs' means, root mean square by channel; 0 where not measured.
  std::array<double, kChannels> scatter_of_means() const {
    std::array<double, kChannels> out{};
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      double sum = 0, n = 0;
      for (std::size_t r = 0; r < campaign_.runs.size(); ++r)
        if (campaign_.runs[r].has[ch]) {
          sum += std::pow(model_.run_mean_deviation(static_cast<int>(r), static_cast<int>(ch)), 2);
          ++n;
        }
      if (n > 0) out[ch] = std::sqrt(sum / n);
    }
    return out;
  }

  // Root mean square of what a model leaves of the runs' means over what their scatter leaves, by channel; 0 where not measured.
  std::array<double, kChannels> lack_of_fit(const Tried& t) const {
    std::array<double, kChannels> out{};
    const auto predicted = model_.predict(t.hypothesis, t.fit);
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      double left = 0, scatter = 0;
      for (std::size_t r = 0; r < campaign_.runs.size(); ++r) {
        if (!campaign_.runs[r].has[ch]) continue;
        const auto m = settled_means(campaign_.runs[r], predicted[r], ch);
        left += std::pow(m[0] - m[1], 2);
        scatter += std::pow(model_.run_mean_deviation(static_cast<int>(r), static_cast<int>(ch)), 2);
      }
      if (scatter > 0) out[ch] = std::sqrt(left / scatter);
    }
    return out;
  }

  // True when an explanation leaves more than scatter in a channel, and there and over all channels more than another form
  // of its laws would: a quarter of the misfit.
  bool leaves_much(const Tried& t) const {
    const auto before = lack_of_fit(plain_), after = lack_of_fit(t);
    double all_before = 0, all_after = 0;
    bool poor = false;
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      const double b = std::max(0.0, before[ch] * before[ch] - 1.0), a = after[ch] * after[ch];
      all_before += b;
      all_after += std::max(0.0, a - 1.0);
      poor = poor || (after[ch] > kPoorFit && a - kScatterOfFit > 0.0625 * b);
    }
    return poor && all_after > 0.0625 * all_before;
  }

  // The strengths that a fit has pushed to the limit of what is published for their law, as `effect.parameter`: the data want
  // more of it than any soil or rig has shown.
  static std::vector<std::string> stretched(const Tried& t) {
    std::vector<std::string> out;
    for (std::size_t k = 0; k < t.fit.parameters.size(); ++k) {
      const FitParameter& p = t.fit.parameters[k];
      const double near = 1e-3 * (p.upper - p.lower);
      const auto at = [&](double limit) { return std::abs(limit - p.null_value) > near && std::abs(t.fit.extra[k] - limit) < near; };
      if (p.strength && (at(p.lower) || at(p.upper))) out.push_back(t.hypothesis.effects[p.effect].id + "." + p.name);
    }
    return out;
  }

  // The channel of which most is left, over its scatter.
  std::pair<double, int> worst_lack(const Tried& t) const {
    const auto left = lack_of_fit(t);
    const auto worst = std::max_element(left.begin(), left.end());
    return {*worst, static_cast<int>(worst - left.begin())};
  }

  // What each further effect would gain at a fit, to first order: the highest eight.
  std::vector<std::pair<double, std::size_t>> scores(const Tried& from) const {
    const Projected at(model_, from);
    std::vector<std::pair<double, std::size_t>> out;
    for (std::size_t i = 0; i < named_; ++i) {
      const std::string& id = starts_[i].front().effects.front().id;
      if (contains(from.hypothesis, id)) continue;
      double best = 0;
      for (const Hypothesis& start : starts_[i]) best = std::max(best, promise(joined(from.hypothesis, start), at, from));
      out.emplace_back(best, i);
    }
    std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    if (out.size() > 8) out.resize(8);
    return out;
  }

  // The best explanation so far, or the single that `slots` begin with, and one effect more.
  Tried fit_slots(const std::vector<std::size_t>& slots) const {
    const bool on_best = std::equal(slots.begin(), slots.end() - 1, slots_.begin(), slots_.end());
    const Tried& from = on_best ? best_ : singles_[slots.front()];
    const Hypothesis h = continued(model_, from);
    std::vector<Hypothesis> starts;
    for (const Hypothesis& s : starts_[slots.back()]) starts.push_back(joined(h, s));
    if (starts.size() > 1) starts = most_promising(starts, Projected(model_, from), from, on_best ? 2 : 1);
    return best_of(starts, from.fit.base);
  }

  // Every other effect in the place of one member of the best explanation: the probability of each, given the others.
  Finding weigh(std::size_t slot) {
    const std::string own = best_.hypothesis.effects[slot].id;
    std::vector<std::size_t> rivals;
    for (std::size_t i = 0; i < named_; ++i) {
      const std::string& id = starts_[i].front().effects.front().id;
      bool taken = false;
      for (std::size_t m = 0; m < best_.hypothesis.effects.size(); ++m) taken = taken || (m != slot && best_.hypothesis.effects[m].id == id);
      if (!taken) rivals.push_back(i);
    }
    std::vector<Tried> tried(rivals.size());
    Tried without = plain_;  // the explanation with this slot empty
    if (best_.hypothesis.effects.size() == 1) {
      for (std::size_t k = 0; k < rivals.size(); ++k) tried[k] = singles_[rivals[k]];
    } else {
      Hypothesis others = continued(model_, best_);
      others.effects.erase(others.effects.begin() + static_cast<std::ptrdiff_t>(slot));
      // Only rivals that come near by themselves or by first-order score with the others are worth a fit.
      Tried reduced{others, model_.fit(others, best_.fit.base)};
      std::set<std::size_t> worth;
      without = reduced;
      for (const auto& [score, i] : scores(reduced)) worth.insert(i);
      const Projected at(model_, reduced);
      parallel_for(rivals.size(), options_.threads, [&](std::size_t k) {
        tried[k].fit.chi2 = std::numeric_limits<double>::infinity();
        if (starts_[rivals[k]].front().effects.front().id == own) {
          tried[k] = best_;
        } else if (worth.contains(rivals[k])) {
          std::vector<Hypothesis> starts;
          for (const Hypothesis& s : starts_[rivals[k]]) starts.push_back(joined(others, s));
          starts = most_promising(starts, at, reduced, 2);
          // In the place of the member it stands for: the members after it keep theirs.
          for (Hypothesis& h : starts) std::rotate(h.effects.begin() + static_cast<std::ptrdiff_t>(slot), h.effects.end() - 1, h.effects.end());
          tried[k] = best_of(starts, reduced.fit.base);
        }
      });
    }
    note(tried);
    for (const Tried& t : tried)
      if (best_.hypothesis.effects.size() > 1) weighed_.push_back(t);
    // Without repeats the scatter is assumed, and the odds are worth half.
    const double temperature = kTemperature * (model_.noise().from_replicates ? 1.0 : 2.0);
    std::map<std::string, double> weight;
    const double whole = cost(without.fit) - cost(best_.fit);
    double top = -std::numeric_limits<double>::infinity();
    for (const Tried& t : tried) top = std::max(top, support(t));
    for (std::size_t k = 0; k < tried.size(); ++k) {
      if (!std::isfinite(tried[k].fit.chi2)) continue;
      const std::string& id = starts_[rivals[k]].front().effects.front().id;
      // What explains hardly more than nothing in its place, or far less than the member does, is no rival; there are many
      // of those, and each would take a small share of the odds.
      const double explained = cost(without.fit) - cost(tried[k].fit);
      const double gate = out_.gate * overdispersion(tried[k].fit);
      if (id != own && (explained < 0.25 * gate || (whole > kFarBeyond * gate && explained < kRival * whole))) continue;
      weight[id] = std::max(weight[id], std::exp((support(tried[k]) - top) / temperature));
    }
    double sum = 0;
    for (const auto& [id, w] : weight) sum += w;
    std::vector<std::pair<double, std::string>> ranked;
    for (const auto& [id, w] : weight) ranked.emplace_back(w / sum, id);
    std::sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.first > b.first || (a.first == b.first && a.second < b.second); });
    Finding out;
    double total = 0;
    for (const auto& [w, id] : ranked) {
      if (probability_held(total) >= 0.9 || out.ids.size() > 4) break;
      total += w;
      out.ids.push_back(id);
      out.share[id] = w;
    }
    out.probability = probability_held(total);
    if (!model_.noise().from_replicates) out.probability = std::min(out.probability, kWithoutRepeats);
    // The likeliest class leads: two names of one thing share its odds, and a rival must not lead for that.
    std::map<effects::Class, double> of_class;
    const auto class_of = [](const std::string& id) { return effects::find_effect(id)->info->cls; };
    for (const std::string& id : out.ids) of_class[class_of(id)] += out.share[id];
    std::stable_sort(out.ids.begin(), out.ids.end(), [&](const std::string& a, const std::string& b) { return of_class[class_of(a)] > of_class[class_of(b)]; });
    if (out.ids.front() != own) {
      std::size_t first = tried.size();
      for (std::size_t k = 0; k < tried.size(); ++k)
        if (starts_[rivals[k]].front().effects.front().id == out.ids.front() && (first == tried.size() || support(tried[k]) > support(tried[first]))) first = k;
      best_ = tried[first];
    }
    return out;
  }

  void describe(Finding& f, std::size_t slot) const {
    const effects::Info& info = *effects::find_effect(f.ids.front())->info;
    f.cls = effects::class_name(info.cls);
    f.equation = info.equation;
    f.source = info.source;
    const auto values = model_.effects_of(best_.hypothesis, best_.fit);
    const auto found = values.find(f.ids.front());
    for (const effects::Parameter& p : info.parameters) {
      Estimate e;
      e.unit = p.unit;
      e.value = p.typical;
      if (found != values.end() && found->second.contains(std::string(p.name))) e.value = found->second.at(std::string(p.name));
      for (std::size_t k = 0; k < best_.fit.parameters.size(); ++k) {
        const FitParameter& q = best_.fit.parameters[k];
        if (q.effect != slot || q.name != p.name) continue;
        const auto i = kBaseCount + static_cast<Eigen::Index>(k);
        const double d = std::sqrt(std::max(0.0, best_.fit.covariance(i, i)) * overdispersion(best_.fit));
        e.deviation = q.scale == effects::Scale::log ? d * e.value : q.scale == effects::Scale::inverse ? (std::isfinite(e.value) ? d * e.value * e.value : 0) : d;
      }
      if (std::isfinite(e.value)) f.parameters[std::string(p.name)] = e;
    }
    std::string name(info.name);
    f.statement = f.ids.size() == 1
                      ? fmt::format("{}: {}; {}.", name, strength_text(f.parameters), info.fingerprint.text)
                      : fmt::format("{}: this recording cannot tell {} apart; as {}: {}.", name, plural(f.ids), f.ids.front(), strength_text(f.parameters));
  }

  // What switching one member off changes, root mean square over runs.
  std::array<double, kChannels> change_of(std::size_t slot) const {
    Hypothesis without = best_.hypothesis;
    Fit f = best_.fit;
    f.extra.clear();
    f.parameters.clear();
    without.effects.erase(without.effects.begin() + static_cast<std::ptrdiff_t>(slot));
    for (std::size_t k = 0; k < best_.fit.parameters.size(); ++k)
      if (best_.fit.parameters[k].effect != slot) f.extra.push_back(best_.fit.extra[k]);
    if (best_.hypothesis.free_channel >= 0) f.extra.push_back(best_.fit.extra.back());
    f.parameters = model_.parameters_of(without);
    std::array<double, kChannels> out{};
    try {
      const auto on = model_.predict(best_.hypothesis, best_.fit), off = model_.predict(without, f);
      for (std::size_t ch = 0; ch < kChannels; ++ch) {
        double s = 0;
        int n = 0;
        for (std::size_t r = 0; r < campaign_.runs.size(); ++r)
          if (campaign_.runs[r].has[ch]) {
            s += std::pow(settled_means(campaign_.runs[r], on[r], ch)[1] - settled_means(campaign_.runs[r], off[r], ch)[1], 2);
            ++n;
          }
        out[ch] = n ? std::sqrt(s / n) : 0;
      }
    } catch (const RunError&) {
    }
    return out;
  }

  void decide() {
    const bool belief_fails = belief_fails_now();
    out_.ripples = ripples_.lines;
    ripple_ = findings_of(ripples_, campaign_, options_);
    const bool ripple_effect = !ripple_.findings.empty();
    const bool enough = campaign_.conditions.size() >= 4;
    Tried after = something_off_ ? best_ : plain_;
    bool unknown = false;
    if (something_off_) {
      unknown = nameless_wins(after);
      if (!unknown && gain(best_.fit) <= out_.gate) something_off_ = false;
    }
    std::vector<Finding> found, wide;
    if (something_off_ && !unknown && enough) {
      for (std::size_t slot = 0; slot < best_.hypothesis.effects.size(); ++slot) found.push_back(weigh(slot));
      // What these data leave open is said, and stands in no model.
      const auto open = [](const Finding& f) { return f.ids.size() > 4 || f.probability < 0.9; };
      std::vector<std::size_t> members;
      for (std::size_t slot = 0; slot < found.size(); ++slot)
        if (open(found[slot])) members.push_back(slot);
      std::copy_if(found.begin(), found.end(), std::back_inserter(wide), open);
      std::erase_if(found, open);
      if (!wide.empty() && (!found.empty() || ripple_effect)) leave_out(members);
      after = best_;
      for (std::size_t slot = 0; slot < found.size(); ++slot) {
        describe(found[slot], slot);
        found[slot].change = change_of(slot);
      }
    }
    after_ = after;
    if (something_off_) out_.located = located(model_, plain_);
    candidates();
    compare_runs();
    if (something_off_ || ripple_effect) hold_out();
    soil_changes();
    detectable();
    if (ripple_effect) merge_ripple(found);
    const bool named = !found.empty();
    if (!suspicious_.empty()) {
      out_.verdict = "undecided";
      out_.statement = fmt::format("The recording contradicts itself before any physics: {}. No cause is named until that is settled.", suspicious_);
    } else if (!enough && (something_off_ || belief_fails)) {
      out_.verdict = "undecided";
      out_.statement = fmt::format("Simulation and recording differ, but {} conditions cannot tell causes from soil parameters.", campaign_.conditions.size());
      out_.next_experiments.push_back({"at least eight slips from -0.3 to 0.7, three loads, two speeds and two repeats of each", {}});
    } else if (unknown) {
      out_.verdict = "unknown";
      out_.unexplained = true;
      out_.unexplained_form = free_form_;
      out_.statement = fmt::format("Something acts that no listed effect explains: {}.", free_form_);
      if (ripple_effect) out_.effects = found;
    } else if (named) {
      out_.effects = found;
      bool instrument = true;
      for (const Finding& f : found) instrument = instrument && (f.cls == "rig" || f.ids.front() == "slip_offset");
      out_.verdict = instrument ? "instrument" : "missing_physics";
      std::string what;
      for (const Finding& f : found) what += (what.empty() ? "" : " and ") + plural(f.ids);
      out_.statement = fmt::format("The recording shows {}, which the {} lacks{}. {}", what, options_.reference ? "reference" : "plain model", instrument ? "; it is the rig or a sensor, not the soil" : "", found.front().statement);
    } else if (!wide.empty()) {
      out_.verdict = "undecided";
      out_.statement = fmt::format("Something is off, but these data cannot single out a cause; the likeliest are {}.", plural(wide.front().ids));
      experiments(wide);
    } else if (enough && leaves_much(plain_)) {
      out_.verdict = "undecided";
      const auto [left, channel] = worst_lack(plain_);
      out_.statement = fmt::format("Something is off, but no listed effect stands out: the plain model leaves {:.2g} times the scatter of the runs in {}.", left, channel_name(channel));
    } else if (belief_fails) {
      out_.verdict = "parameters";
      out_.statement = (options_.reference ? "The soil differs from the reference's, and nothing else beyond scatter: "
                                           : "The plain model explains the recording within its scatter once its soil parameters are corrected: ") +
                       worst_parameters() + ".";
    } else if (!enough && campaign_.conditions.size() < 2) {
      out_.verdict = "undecided";
      out_.statement = "One condition cannot tell the soil's parameters from any cause.";
      out_.next_experiments.push_back({"at least eight slips from -0.3 to 0.7, three loads, two speeds and two repeats of each", {}});
    } else {
      out_.verdict = "no_mismatch";
      out_.statement = fmt::format("{} (false alarms at most {:.0f} % over all effects).",
                                   options_.reference ? "Nothing sets the recording apart from the reference beyond the scatter of both"
                                                      : "The model with the believed parameters explains the recording within its own scatter",
                                   100 * out_.false_alarm_rate);
    }
    if (named) {
      for (const std::string& strength : stretched(best_))
        out_.remarks.push_back(fmt::format("{} has reached the limit of its range: something stronger than what is published of it, or another cause, acts", strength));
      for (const Finding& f : wide)
        out_.remarks.push_back(fmt::format("something further acts that these data cannot single out; the likeliest are {}", plural(f.ids)));
      wide.insert(wide.begin(), found.begin(), found.end());
      experiments(wide);
    }
    if (out_.verdict == "missing_physics" || out_.verdict == "instrument")
      if (!model_.noise().from_replicates) out_.remarks.push_back("no replicates: the scatter is assumed, not measured, and every claim is weaker for it");
    finish();
  }

  // Takes these members (in rising order) out of the best explanation; what remains is fitted anew.
  void leave_out(const std::vector<std::size_t>& members) {
    Hypothesis h = continued(model_, best_);
    for (auto m = members.rbegin(); m != members.rend(); ++m) h.effects.erase(h.effects.begin() + static_cast<std::ptrdiff_t>(*m));
    best_ = h.effects.empty() ? plain_ : Tried{h, model_.fit(h, best_.fit.base)};
  }

  bool belief_fails_now() const {
    if (!campaign_.complete_belief) return false;
    const double phi = something_off_ ? overdispersion(best_.fit) : overdispersion(plain_.fit);
    const double excess = (believed_.fit.chi2 - plain_.fit.chi2) / phi;
    // The scatter itself is known from so many repeats only.
    const double repeats = std::max(10.0, static_cast<double>(campaign_.runs.size()) - static_cast<double>(campaign_.conditions.size()));
    return !(excess < 7.0 * gsl_cdf_fdist_Pinv(0.9995, 7, repeats));
  }

  // Chi-square beyond its gate that one effect more, or a nameless term, gains over the best explanation. What changes along
  // the runs alone (a bed that drifts) is another cause beside it and no sign that its means have another.
  double further_gain(const Fit& with_term) const {
    const auto over = [&](const Fit& f) { return (cost(best_.fit) - cost(f)) / overdispersion(f) - out_.gate; };
    double out = over(with_term) - kNamelessMore;
    for (const Tried& t : weighed_) {
      const std::vector<Hypothesis::Member>& members = t.hypothesis.effects;
      if (members.size() != best_.hypothesis.effects.size() + 1 || !std::isfinite(t.fit.chi2)) continue;
      const auto further = [&](const auto& m) { return !contains(best_.hypothesis, m.id); };
      if (std::count_if(members.begin(), members.end(), further) != 1) continue;
      const effects::Fingerprint& mark = effects::find_effect(std::find_if(members.begin(), members.end(), further)->id)->info->fingerprint;
      if (!mark.with_time && !mark.with_position) out = std::max(out, over(t.fit));
    }
    return out;
  }

  // A nameless term wins when it explains clearly more than anything listed, alone or on top of it.
  bool nameless_wins(Tried& after) {
    std::size_t top = singles_.size();
    for (std::size_t i = named_; i < singles_.size(); ++i)
      if (std::isfinite(singles_[i].fit.chi2) && (top == singles_.size() || cost(singles_[i].fit) < cost(singles_[top].fit))) top = i;
    if (top == singles_.size()) return false;
    const Fit& best_free = singles_[top].fit;
    // Alone it must beat the listed explanation although that may have more members.
    const double whole = std::max(1.0, cost(plain_.fit) - std::min(cost(best_.fit), cost(best_free)));
    const double short_by = (cost(best_.fit) - cost(best_free)) / whole;
    const bool alone = support(singles_[top]) - support(best_) > kFurther && short_by > 0.04;
    // On top of it, what is left must be large: the listed effect then is not the cause, or not all of it.
    std::vector<Tried> on_top;
    const Hypothesis from = continued(model_, best_);
    const bool poor = leaves_much(best_);
    const std::vector<Hypothesis::Member>& members = best_.hypothesis.effects;
    const bool exact = std::all_of(members.begin(), members.end(), [](const auto& m) { return effects::find_effect(m.id)->info->search.exact; });
    if (poor || exact) {
      const std::vector<Hypothesis> list = promising_terms(Projected(model_, best_), best_);
      on_top.resize(list.size());
      parallel_for(list.size(), options_.threads, [&](std::size_t i) {
        Hypothesis h = joined(from, list[i]);
        on_top[i] = {h, model_.fit(h, best_.fit.base)};
      });
    }
    note(on_top);
    const Tried* more = nullptr;
    for (const Tried& t : on_top)
      if (std::isfinite(t.fit.chi2) && (!more || cost(t.fit) < cost(more->fit))) more = &t;
    const auto [left, channel] = worst_lack(best_);
    if (more) {
      // A law that has no other form leaves nothing over where it is the cause: what stands in its place is not listed.
      const bool imitation = exact && further_gain(more->fit) > kExactError * gain(best_.fit);
      // Few repeats can take the scatter too small by so much; what a term takes up then counts in that scatter. That excuses no
      // law at the limit of its range.
      const bool by_chance = left < kPoorByChance && stretched(best_).empty() && cost(best_.fit) - cost(more->fit) < out_.gate * std::max(left * left, overdispersion(more->fit));
      if (!imitation && (!poor || by_chance)) more = nullptr;
    }
    if (!alone && !more) {
      if (poor)
        out_.remarks.push_back(fmt::format("{} leaves {:.2g} times the scatter of the runs in {}, where no shape over slip and load helps: the scatter may be larger than the repeats show",
                                           best_.hypothesis.label(), left, channel_name(channel)));
      return false;
    }
    const Tried& t = alone ? singles_[top] : *more;
    const int ch = t.hypothesis.free_channel;
    free_form_ = fmt::format("{} changes by {:.3g} {} x {} x (normal_load/{:.4g} N)^{}{}", channel_name(ch), t.fit.extra.back(), channel_unit(ch),
                             free_shape_text(t.hypothesis.free_shape), model_.reference_load(), t.hypothesis.free_power,
                             alone ? "" : ", beyond what " + best_.hypothesis.label() + " explains");
    out_.unexplained_fraction = std::clamp((cost(best_.fit) - cost(t.fit)) / std::max(1.0, cost(plain_.fit) - cost(t.fit)), 0.0, 1.0);
    after = t;
    return true;
  }

  // A ripple and a change of means with one cause are one finding; a ripple by itself is a finding of its own.
  void merge_ripple(std::vector<Finding>& found) {
    for (Finding& r : ripple_.findings) {
      bool merged = false;
      for (Finding& f : found) {
        const bool same = std::find(f.ids.begin(), f.ids.end(), r.ids.front()) != f.ids.end();
        if (!same) continue;
        // The line decides among what the means leave open.
        if (f.ids.front() != r.ids.front()) {
          f.ids = r.ids;
          f.cls = r.cls;
          f.equation = r.equation;
          f.source = r.source;
          f.parameters = r.parameters;
        } else {
          f.ids = r.ids;
          for (const auto& [name, e] : r.parameters) f.parameters[name] = e;
        }
        f.probability = std::max(f.probability, r.probability);
        f.statement += " " + r.statement;
        merged = true;
        break;
      }
      if (!merged) found.insert(found.begin(), r);
    }
    for (Located& l : ripple_.places) out_.located.push_back(l);
    if (found.size() > 4) found.resize(4);
  }

  void candidates() {
    std::vector<Tried> all(singles_);
    all.insert(all.end(), weighed_.begin(), weighed_.end());
    for (const Tried& t : all) {
      if (!std::isfinite(t.fit.chi2)) continue;
      out_.candidates.push_back({t.hypothesis.label(), (support(t) - support(plain_)) / kTemperature, gain(t.fit), model_.effects_of(t.hypothesis, t.fit),
                                 t.fit.misfit, t.fit.penalty, t.fit.occam});
    }
    std::stable_sort(out_.candidates.begin(), out_.candidates.end(), [](const Candidate& a, const Candidate& b) { return a.log_evidence > b.log_evidence; });
  }

  void compare_runs() {
    const auto before = model_.predict(plain_.hypothesis, plain_.fit);
    const auto after = model_.predict(after_.hypothesis, after_.fit);
    std::array<double, kChannels> sb{}, sa{}, floor{};
    std::array<int, kChannels> n{};
    for (std::size_t r = 0; r < campaign_.runs.size(); ++r) {
      const RunData& run = campaign_.runs[r];
      RunComparison c;
      c.id = run.id;
      c.condition = campaign_.conditions[static_cast<std::size_t>(run.condition)];
      c.has = run.has;
      for (std::size_t ch = 0; ch < kChannels; ++ch) {
        if (!run.has[ch]) continue;
        const auto b = settled_means(run, before[r], ch), a = settled_means(run, after[r], ch);
        c.observed[ch] = b[0];
        c.before[ch] = b[1];
        c.after[ch] = a[1];
        c.deviation[ch] = model_.run_mean_deviation(static_cast<int>(r), static_cast<int>(ch));
        sb[ch] += std::pow(b[0] - b[1], 2);
        sa[ch] += std::pow(a[0] - a[1], 2);
        floor[ch] += std::pow(c.deviation[ch], 2);
        ++n[ch];
      }
      out_.runs.push_back(c);
    }
    for (std::size_t ch = 0; ch < kChannels; ++ch)
      if (n[ch]) {
        out_.fit[ch].present = true;
        out_.fit[ch].rmse_before = std::sqrt(sb[ch] / n[ch]);
        out_.fit[ch].rmse_after = std::sqrt(sa[ch] / n[ch]);
        out_.fit[ch].heldout_before = out_.fit[ch].rmse_before;
        out_.fit[ch].heldout_after = out_.fit[ch].rmse_after;
        out_.fit[ch].noise_floor = std::sqrt(floor[ch] / n[ch]);
      }
  }

  // Both models fitted without a block, compared on it.
  void hold_out() {
    const auto blocks = blocks_of(campaign_);
    const Hypothesis h = continued(model_, after_);
    std::vector<Fold> before(blocks.size()), after(blocks.size());
    parallel_for(blocks.size(), options_.threads, [&](std::size_t b) {
      before[b] = fold(model_, plain_, plain_.hypothesis, blocks[b].second, 12);
      after[b] = fold(model_, after_, h, blocks[b].second, 12);
    });
    std::array<double, 2 * kChannels> total{};
    std::array<int, kChannels> n{};
    double best_ratio = 0;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (!before[b].solved || !after[b].solved) continue;
      Block block;
      block.name = blocks[b].first;
      for (const char held : blocks[b].second) block.runs += held;
      double improvement = 0, weight = 0;
      for (std::size_t ch = 0; ch < kChannels; ++ch) {
        const int count = before[b].count[ch];
        if (!count) continue;
        block.before[ch] = std::sqrt(before[b].squares[ch] / count);
        block.after[ch] = std::sqrt(after[b].squares[ch] / count);
        total[ch] += before[b].squares[ch];
        total[kChannels + ch] += after[b].squares[ch];
        n[ch] += count;
        const double floor = std::max(1e-12, out_.fit[ch].noise_floor);
        improvement += std::log((block.before[ch] + floor) / (block.after[ch] + floor));
        ++weight;
      }
      if (weight > 0 && std::abs(improvement) > best_ratio) {
        best_ratio = std::abs(improvement);
        out_.replay = {};
        out_.replay.held_out = block.name;
        for (std::size_t r = 0; r < campaign_.runs.size(); ++r)
          if (blocks[b].second[r]) out_.replay.runs.push_back(r);
        out_.replay.soil_before = model_.soil_of(before[b].fit.base);
        out_.replay.soil_after = model_.soil_of(after[b].fit.base);
        out_.replay.angles_before = model_.angles_of(before[b].fit.base);
        out_.replay.angles_after = model_.angles_of(after[b].fit.base);
        out_.replay.effects = finite_effects(h, after[b].fit);
        out_.prediction_held = improvement > 0;
        out_.prediction = fmt::format("Fitted without {} ({} runs), the model with {} predicts those runs with a drawbar-pull error of {:.3g} N and a sinkage error of {:.3g} mm; without it {:.3g} N and {:.3g} mm.",
                                      block.name, block.runs, after_.hypothesis.label(), block.after[0], 1e3 * block.after[2], block.before[0], 1e3 * block.before[2]);
      }
      out_.blocks.push_back(std::move(block));
    }
    for (std::size_t ch = 0; ch < kChannels; ++ch)
      if (n[ch]) {
        out_.fit[ch].heldout_before = std::sqrt(total[ch] / n[ch]);
        out_.fit[ch].heldout_after = std::sqrt(total[kChannels + ch] / n[ch]);
      }
  }

  void soil_changes() {
    const bekker::Soil believed = campaign_.believed, refit = model_.soil_of(plain_.fit.base), fitted = model_.soil_of(after_.fit.base);
    const bekker::ContactAngles ra = model_.angles_of(plain_.fit.base), fa = model_.angles_of(after_.fit.base);
    const auto deviation = [&](Base i) { return std::sqrt(std::max(0.0, after_.fit.covariance(i, i)) * overdispersion(after_.fit)); };
    out_.parameters = {{"k", "Pa", believed.k, refit.k, fitted.k, deviation(kLnK) * fitted.k},
                       {"n", "-", believed.n, refit.n, fitted.n, deviation(kN)},
                       {"cohesion", "Pa", believed.cohesion, refit.cohesion, fitted.cohesion, deviation(kCohesion)},
                       {"friction_angle", "rad", believed.friction_angle, refit.friction_angle, fitted.friction_angle, deviation(kPhi)},
                       {"shear_modulus", "m", believed.shear_modulus, refit.shear_modulus, fitted.shear_modulus, deviation(kLnShear) * fitted.shear_modulus},
                       {"a0", "-", campaign_.believed_angles.a0, ra.a0, fa.a0, deviation(kA0)},
                       {"a1", "-", campaign_.believed_angles.a1, ra.a1, fa.a1, deviation(kA1)}};
    out_.soil = fitted;
    out_.angles = fa;
    out_.corrected_effects = finite_effects(after_.hypothesis, after_.fit);
  }

  // The effects of a fit that are switched on.
  std::map<std::string, std::map<std::string, double>> finite_effects(const Hypothesis& h, const Fit& f) const {
    auto out = model_.effects_of(h, f);
    for (auto& [id, values] : out)
      for (const effects::Beside& b : effects::find_effect(id)->info->search.beside) values.erase(std::string(b.name));
    std::erase_if(out, [](const auto& e) {
      return std::any_of(e.second.begin(), e.second.end(), [](const auto& v) { return !std::isfinite(v.second); });
    });
    return out;
  }

  std::string worst_parameters() const {
    std::vector<std::pair<double, std::string>> list;
    for (const ParameterChange& p : out_.parameters)
      if (p.deviation > 0) list.emplace_back(std::abs(p.fitted - p.believed) / p.deviation, fmt::format("{} {:.4g} instead of {:.4g} {}", p.name, p.fitted, p.believed, p.unit));
    std::sort(list.rbegin(), list.rend());
    std::string out;
    for (std::size_t i = 0; i < std::min<std::size_t>(2, list.size()); ++i) out += (i ? ", " : "") + list[i].second;
    return out;
  }

  void detectable() {
    const double limit = std::sqrt(out_.gate);
    for (const Detect& d : detect_)
      if (d.scale == effects::Scale::linear) out_.detectable[d.key] = {limit * d.deviation, d.deviation, d.unit};
  }

  void experiments(const std::vector<Finding>& found) {
    for (const Finding& f : found) {
      if (f.ids.size() < 2) continue;
      Experiment e;
      e.design = std::string(effects::find_effect(f.ids.front())->info->separated_by);
      for (const std::string& id : f.ids) e.separates.push_back({id});
      out_.next_experiments.push_back(std::move(e));
    }
  }

  void finish() {
    for (const Finding& f : out_.effects) {
      if (f.ids.empty() || out_.corrected_effects.contains(f.ids.front())) {
        // The count of lugs comes from the line.
        if (!f.ids.empty() && f.ids.front() == "grousers" && f.parameters.contains("count"))
          out_.corrected_effects["grousers"]["count"] = f.parameters.at("count").value;
        continue;
      }
      std::map<std::string, double> values;
      for (const auto& [name, e] : f.parameters) values[name] = e.value;
      if (!values.empty()) out_.corrected_effects[f.ids.front()] = values;
    }
    if (out_.verdict == "no_mismatch" || out_.verdict == "undecided") {
      out_.effects.clear();
      out_.corrected_effects.clear();
    }
    if (out_.verdict == "no_mismatch") {
      out_.located.clear();
    }
    if (out_.verdict == "no_mismatch" || out_.verdict == "parameters" || out_.verdict == "undecided" || out_.verdict == "unknown") {
      if (out_.verdict != "unknown" || out_.effects.empty()) out_.corrected_effects.clear();
    }
    if (out_.verdict == "unknown" || out_.verdict == "undecided") {
      out_.soil = model_.soil_of(plain_.fit.base);
      out_.angles = model_.angles_of(plain_.fit.base);
    }
  }

  std::array<double, kChannels + 1> lowest_{};
  double lowest_penalty_ = 0.0;
  struct Detect {
    std::string key;
    double deviation;
    effects::Scale scale;
    std::string unit;
  };

  const recording::Recording& recording_;
  const Options& options_;
  Relative relative_;
  const Campaign& campaign_;
  Model model_;
  Diagnosis out_;
  Tried plain_, believed_, best_, after_;
  RippleSearch ripples_;
  std::vector<std::vector<Hypothesis>> starts_;  // of each candidate: the listed first, then the nameless
  std::vector<Tried> singles_, weighed_;
  std::vector<std::size_t> slots_;
  std::size_t named_ = 0;
  std::vector<Detect> detect_;
  RippleFindings ripple_;
  double best_free_ = 0.0;
  bool something_off_ = false;
  std::string suspicious_, free_form_;
};

Diagnosis diagnose(const recording::Recording& recording, const Options& options) { return Diagnoser(recording, options).run(); }

}  // namespace terrode::diagnosis
