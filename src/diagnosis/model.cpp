#include "diagnosis/model.h"

#include <fmt/format.h>
#include <gsl/gsl_multimin.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>

#include "core/statistics.h"

namespace terrode::diagnosis {
namespace {

constexpr int kNodes = 6;  // in time, where an effect changes the soil along a run
constexpr double kLittleGain = 0.01;  // of chi-square: a fit that gains less has settled

double from_coordinate(double x, effects::Scale scale) {
  switch (scale) {
    case effects::Scale::log: return std::exp(x);
    case effects::Scale::inverse: return x <= 1e-12 ? effects::kInfinity : 1.0 / x;
    default: return x;
  }
}

// The parameter's value; a coordinate between the null and the nearest allowed value counts as the null.
double si_value(const FitParameter& p, double coordinate) {
  if (p.scale == effects::Scale::inverse && coordinate < p.least) return effects::kInfinity;
  return from_coordinate(coordinate, p.scale);
}

struct Readings {  // of one condition, at one or kNodes times
  std::vector<double> time;
  std::vector<effects::Reading> at;
};

// Deviation of y about its own quadratic trend in x, times sqrt of the degrees of freedom lost.
double deviation_about_trend(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<Eigen::Index>(x.size());
  if (n < 5) return 0.0;
  Eigen::MatrixXd a(n, 3);
  Eigen::VectorXd b(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = x[static_cast<std::size_t>(i)];
    a.row(i) << 1, u, u * u;
    b(i) = y[static_cast<std::size_t>(i)];
  }
  const Eigen::VectorXd r = b - a * (a.transpose() * a).ldlt().solve(a.transpose() * b);
  return std::sqrt(r.squaredNorm() / static_cast<double>(n - 3));
}

// Rim path of a locked wheel is its travel.
double rim_speed(const Condition& c, double radius) {
  return c.angular_velocity > 0 ? c.angular_velocity * radius : c.forward_velocity;
}


// Chebyshev nodes on [0, end].
double node_time(int i, int nodes, double end) {
  return end * 0.5 * (1.0 - std::cos(std::numbers::pi * (i + 0.5) / nodes));
}

effects::Reading interpolate(const Readings& r, double t) {
  if (r.at.size() == 1) return r.at.front();
  effects::Reading out;
  for (std::size_t i = 0; i < r.at.size(); ++i) {
    double w = 1;
    for (std::size_t j = 0; j < r.at.size(); ++j)
      if (j != i) w *= (t - r.time[j]) / (r.time[i] - r.time[j]);
    out.drawbar_pull += w * r.at[i].drawbar_pull;
    out.driving_torque += w * r.at[i].driving_torque;
    out.sinkage += w * r.at[i].sinkage;
  }
  return out;
}

}  // namespace

// Steady states at one set of soil parameters and effects; what only the start-up changes can reuse them.
struct Model::SteadyCache {
  std::vector<Readings> readings;
};

double to_coordinate(double p, effects::Scale scale) {
  switch (scale) {
    case effects::Scale::log: return std::log(p);
    case effects::Scale::inverse: return std::isinf(p) ? 0.0 : 1.0 / p;
    default: return p;
  }
}

int free_shape_count() { return 6; }
const char* free_shape_text(int shape) {
  constexpr const char* texts[] = {"constant", "s", "|s|", "tanh(|s|/0.1)", "tanh(s/0.1)", "s^2"};
  return texts[shape];
}
double free_shape_value(int shape, double slip) {
  const double s = std::clamp(slip, -3.0, 3.0);
  switch (shape) {
    case 0: return 1.0;
    case 1: return s;
    case 2: return std::abs(s);
    case 3: return std::tanh(std::abs(s) / 0.1);
    case 4: return std::tanh(s / 0.1);
    default: return s * s;
  }
}

std::string Hypothesis::label() const {
  std::string out;
  for (const Member& m : effects) out += (out.empty() ? "" : " + ") + m.id;
  if (free_channel >= 0)
    out += fmt::format("{}{} ~ {} (W/W0)^{}", out.empty() ? "" : " + ", channel_name(free_channel), free_shape_text(free_shape), free_power);
  return out.empty() ? "plain" : out;
}

double usual_start_up(double radius) { return std::max(0.035, 0.3 * radius); }

Model::Model(const Campaign& campaign) : campaign_(&campaign) {
  std::vector<double> loads;
  for (const Condition& c : campaign.conditions) loads.push_back(c.normal_load);
  reference_load_ = median(loads);
  curve_noise_.assign(campaign.curves.size(), 0.01);
  for (std::size_t i = 0; i < campaign.curves.size(); ++i) {
    const Curve& c = campaign.curves[i];
    std::vector<double> x, y;
    const double top = *std::max_element(c.y.begin(), c.y.end());
    for (std::size_t k = 0; k < c.x.size(); ++k) {
      if (c.shear ? k < c.x.size() / 3 : c.y[k] <= 0.02 * top) continue;
      x.push_back(c.shear ? c.x[k] : std::log(c.x[k]));
      y.push_back(c.shear ? c.y[k] / top : std::log(c.y[k]));
    }
    curve_noise_[i] = std::max(0.01, deviation_about_trend(x, y));
  }
  const double w = reference_load_, r = campaign.wheel.radius;
  noise_.sample = {0.02 * w, 0.02 * w * r, 0.002 * r};
  noise_.floor = {0.002 * w, 0.002 * w * r, 0.0};
  // Without series or replicates, tables are taken to be good to a few percent of the load, or to the deviations that
  // most of their rows give.
  bool any_series = false;
  for (const RunData& run : campaign.runs) any_series = any_series || !run.steady;
  if (!any_series) {
    noise_.sample = {0, 0, 0};
    noise_.floor = {0.02 * w, 0.02 * w * r, 0.004 * r};
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      std::vector<double> given;
      for (const RunData& run : campaign.runs)
        if (run.table_std[ch] > 0) given.push_back(run.table_std[ch]);
      if (2 * given.size() >= campaign.runs.size()) noise_.floor[ch] = median(given);
    }
  }
}

Eigen::VectorXd Model::base_of(const bekker::Soil& s, const bekker::ContactAngles& a) const {
  Eigen::VectorXd b(kBaseCount);
  b << std::log(s.k), s.n, s.cohesion, s.friction_angle, std::log(s.shear_modulus), a.a0, a.a1, std::log(0.02), 1.0, 0.15, 0.1;
  return b;
}

bekker::Soil Model::soil_of(const Eigen::VectorXd& b) const {
  bekker::Soil s = campaign_->believed;
  s.k = std::exp(b(kLnK));
  s.n = b(kN);
  s.cohesion = b(kCohesion);
  s.friction_angle = b(kPhi);
  s.shear_modulus = std::exp(b(kLnShear));
  return s;
}

bekker::ContactAngles Model::angles_of(const Eigen::VectorXd& b) const {
  return {b(kA0), b(kA1), campaign_->believed_angles.theta_r};
}

std::vector<FitParameter> Model::parameters_of(const Hypothesis& h) const {
  std::vector<FitParameter> out;
  for (std::size_t e = 0; e < h.effects.size(); ++e) {
    const effects::EffectType* type = effects::find_effect(h.effects[e].id);
    std::vector<double> typical;
    for (const effects::Parameter& p : type->info->parameters) typical.push_back(p.typical);
    const auto effect = type->make(std::move(typical));
    const bool of_reading = effect->hooks() == 0 || effect->settles();
    for (const effects::Parameter& p : type->info->parameters) {
      if (p.scale == effects::Scale::choice || !p.fitted) continue;
      FitParameter f{e, std::string(p.name), p.scale, 0, 0, 0, 0, 0, p.strength, 0, of_reading};
      const double lo = to_coordinate(p.lower, p.scale), hi = to_coordinate(p.upper, p.scale);
      f.lower = std::min(lo, hi);
      f.upper = std::max(lo, hi);
      if (p.scale == effects::Scale::log) {
        // exp() may round a bound out of range.
        f.lower += 1e-9;
        f.upper -= 1e-9;
      }
      f.least = f.lower;
      if (p.strength) {
        f.null_value = p.scale == effects::Scale::log ? 0.0 : to_coordinate(p.null_value, p.scale);
        if (p.scale == effects::Scale::inverse) f.lower = 0.0;  // below 1/upper it counts as the null
        f.prior_mean = f.null_value;
        f.prior_deviation = 2.0 * p.prior_scale;
      } else {
        f.null_value = 0;
        f.prior_mean = to_coordinate(p.typical, p.scale);
        f.prior_deviation = p.scale == effects::Scale::log ? 1.0 : 2.0 * p.prior_scale;
      }
      out.push_back(f);
    }
    for (const effects::Beside& b : type->info->search.beside)
      out.push_back({e, std::string(b.name), effects::Scale::linear, 0, b.lower, b.upper, b.prior_mean, b.prior_deviation, false, b.lower, true});
  }
  return out;
}

std::map<std::string, std::map<std::string, double>> Model::effects_of(const Hypothesis& h, const Fit& fit) const {
  std::map<std::string, std::map<std::string, double>> out;
  for (const Hypothesis::Member& m : h.effects) out[m.id] = m.start;
  // (all parameters, those of the recording too: a fit goes on from them)
  for (std::size_t i = 0; i < fit.parameters.size(); ++i)
    out[h.effects[fit.parameters[i].effect].id][fit.parameters[i].name] = si_value(fit.parameters[i], fit.extra[i]);
  return out;
}

Model::Vector Model::evaluate(const Hypothesis& h, const std::vector<FitParameter>& parameters, const Eigen::VectorXd& all,
                              const std::vector<char>& use, SteadyCache* cache) const {
  const Campaign& c = *campaign_;
  Vector out;
  const Eigen::VectorXd base = all.head(kBaseCount);
  const bekker::Soil soil = soil_of(base);
  const bekker::ContactAngles angles = angles_of(base);
  if (!soil.validate().empty() || !angles.validate().empty()) {
    out.ok = false;
    return out;
  }
  std::map<std::string, std::map<std::string, double>> wanted;
  for (const Hypothesis::Member& m : h.effects) wanted[m.id] = m.start;
  for (std::size_t i = 0; i < parameters.size(); ++i)
    wanted[h.effects[parameters[i].effect].id][parameters[i].name] =
        si_value(parameters[i], all(kBaseCount + static_cast<Eigen::Index>(i)));
  std::map<std::string, std::vector<double>> beside;  // of the recording, by effect
  for (auto& [id, values] : wanted)
    for (const effects::Beside& b : effects::find_effect(id)->info->search.beside) {
      const auto found = values.find(std::string(b.name));
      beside[id].push_back(found == values.end() ? b.prior_mean : found->second);
      if (found != values.end()) values.erase(found);
    }
  effects::EffectSet set;
  try {
    set = effects::EffectSet(wanted);
  } catch (const InputError&) {  // a step out of a parameter's bounds
    out.ok = false;
    return out;
  }
  bool along = false;
  double lag[kChannels] = {0, 0, 0};
  std::vector<const bekker::StressModifier*> modifiers;
  std::vector<std::pair<const effects::Effect*, const std::vector<double>*>> settling;
  for (const auto& e : set.effects()) {
    const effects::Fingerprint& mark = e->info().fingerprint;
    if (e->info().id == "sensor_lag") lag[static_cast<int>(e->values()[1])] += e->values()[0];
    if (e->settles()) {
      settling.emplace_back(e.get(), &beside[std::string(e->info().id)]);
    } else if (e->hooks()) {
      modifiers.push_back(e.get());
      along = along || mark.with_position || mark.with_time;
    }
  }
  bekker::PointLaw law;
  law.modifiers = modifiers;
  std::vector<char> needed(c.conditions.size(), 0);
  std::vector<double> end(c.conditions.size(), 0.0);
  for (std::size_t r = 0; r < c.runs.size(); ++r)
    if (use.empty() || use[r]) {
      const auto k = static_cast<std::size_t>(c.runs[r].condition);
      needed[k] = 1;
      if (!c.runs[r].bins.empty()) end[k] = std::max(end[k], c.runs[r].bins.back().time);
    }
  std::vector<Readings> own(cache ? 0 : c.conditions.size());
  std::vector<Readings>& readings = cache ? cache->readings : own;
  const bool known = cache && !cache->readings.empty();
  if (cache && !known) readings.resize(c.conditions.size());
  if (!known) try {
    const bekker::SteadyWheel wheel(c.wheel, soil, angles, law, {bekker::SkidShear::as_printed, 1e-8});
    for (std::size_t k = 0; k < c.conditions.size(); ++k) {
      if (!needed[k]) continue;
      const Condition& q = c.conditions[k];
      const int nodes = along && end[k] > 0 ? kNodes : 1;
      for (int i = 0; i < nodes; ++i) {
        bekker::Operating op;
        op.slip = q.slip;
        op.normal_load = q.normal_load;
        op.angular_velocity = q.angular_velocity;
        op.forward_velocity = q.forward_velocity;
        op.pass = q.pass;
        op.time = nodes > 1 ? node_time(i, nodes, end[k]) : 0.5 * end[k];
        op.position = q.forward_velocity * op.time;
        op.travel_length = c.travel_length;
        op.wheel_angle = 0.0;  // ripples are looked for elsewhere and stay at their zero crossing here
        const bekker::SteadyState s = wheel.solve(op);
        readings[k].time.push_back(op.time);
        readings[k].at.push_back({s.drawbar_pull, s.driving_torque, s.sinkage, q.normal_load});
      }
    }
  } catch (const std::exception&) {
    out.ok = false;
    return out;
  }
  const double length = std::exp(base(kLnRunIn));
  const double amplitude = h.free_channel >= 0 ? all(all.size() - 1) : 0.0;
  std::array<effects::SensorState, 16> states;
  out.runs.resize(c.runs.size());
  for (std::size_t r = 0; r < c.runs.size(); ++r) {
    if (!use.empty() && !use[r]) continue;
    const RunData& run = c.runs[r];
    const auto k = static_cast<std::size_t>(run.condition);
    const Condition& q = c.conditions[k];
    const double speed = rim_speed(q, c.wheel.radius);
    effects::Sample sample;
    sample.context.slip = q.slip;
    sample.context.normal_load = q.normal_load;
    sample.context.angular_velocity = q.angular_velocity;
    sample.context.forward_velocity = q.forward_velocity;
    sample.context.radius = c.wheel.radius;
    sample.context.width = c.wheel.width;
    sample.context.pass = q.pass;
    double free_term = 0;
    if (h.free_channel >= 0)
      free_term = amplitude * free_shape_value(h.free_shape, q.slip) * std::pow(q.normal_load / reference_load_, h.free_power);
    for (std::size_t b = 0; b < run.bins.size(); ++b) {
      const Bin& bin = run.bins[b];
      effects::Reading y = interpolate(readings[k], bin.time);
      if (!run.steady) {
        const double slow = std::isfinite(q.slip) ? std::abs(q.slip) : 1.0;
        const double start[kChannels] = {base(kForceStart), base(kForceStart), base(kSinkStart) + base(kSinkSlip) * slow};
        double* value[kChannels] = {&y.drawbar_pull, &y.driving_torque, &y.sinkage};
        // Mean over the bin of the start-up's remainder, through the channel's lag where it has one.
        const double t0 = length / std::max(1e-9, speed), u = 0.5 * bin.width / t0;
        const double prompt = std::exp(-bin.time / t0) * (u > 1e-6 ? std::sinh(std::min(u, 500.0)) / u : 1.0);
        for (int ch = 0; ch < kChannels; ++ch) {
          double rest = prompt;
          if (lag[ch] > 0) {
            rest = 0;
            const double tau = std::abs(lag[ch] - t0) < 1e-6 * t0 ? t0 * 1.00001 : lag[ch];
            for (int i = 0; i < 4; ++i) {
              const double t = std::max(0.0, bin.time + bin.width * (0.25 * i - 0.375));
              rest += 0.25 * (t0 * std::exp(-t / t0) - tau * std::exp(-t / tau)) / (t0 - tau);
            }
          }
          *value[ch] *= 1.0 - start[ch] * rest;
        }
        for (const auto& [effect, numbers] : settling) effect->settle(bin.time * speed, *numbers, y);
      }
      y.normal_load = q.normal_load;
      sample.time = bin.time;
      sample.position = q.forward_velocity * bin.time;
      sample.context.position = sample.position;
      sample.context.time = bin.time;
      sample.context.sinkage = y.sinkage;
      if (!set.empty()) {
        set.quasi_static(sample, y);
        states.fill({});
        set.measure(sample, y, std::span(states).first(set.size()));
      }
      const double values[kChannels] = {y.drawbar_pull, y.driving_torque, y.sinkage};
      for (int ch = 0; ch < kChannels; ++ch)
        if (run.has[static_cast<std::size_t>(ch)])
          out.runs[r][static_cast<std::size_t>(ch)].push_back(values[ch] + (ch == h.free_channel ? free_term : 0.0));
    }
  }
  // Soil tests.
  std::vector<const bekker::StressModifier*> in_tests;
  for (const auto& e : set.effects())
    if (e->hooks() && e->info().search.in_soil_tests) in_tests.push_back(e.get());
  const bekker::LocalSoil local(soil);
  bekker::Context context;
  context.radius = c.wheel.radius;
  context.width = c.wheel.width;
  context.unit_weight = soil.unit_weight();
  out.curves.resize(c.curves.size());
  for (std::size_t i = 0; i < c.curves.size(); ++i) {
    const Curve& curve = c.curves[i];
    for (const double x : curve.x) {
      bekker::Point p;
      bekker::LocalSoil s = local;
      double value;
      if (curve.shear) {
        p.shear_displacement = x;
        p.slide_speed = curve.rate;
        for (const auto* m : in_tests)
          if (m->hooks() & bekker::StressModifier::kSoil) m->soil(context, s);
        value = (s.cohesion + curve.normal_stress * s.tan_phi) * bekker::janosi_mobilised(s, x);
        for (const auto* m : in_tests)
          if (m->hooks() & bekker::StressModifier::kShear) value = m->shear(context, p, s, curve.normal_stress, value);
      } else {
        p.sinkage = x;
        p.penetration_speed = curve.rate;
        for (const auto* m : in_tests)
          if (m->hooks() & bekker::StressModifier::kSoil) m->soil(context, s);
        value = bekker::power_law_pressure(s, x);
        for (const auto* m : in_tests)
          if (m->hooks() & bekker::StressModifier::kPressure) value = m->pressure(context, p, s, value);
      }
      out.curves[i].push_back(value);
    }
  }
  return out;
}

void Model::factorise(const Eigen::VectorXd& base) {
  const Campaign& c = *campaign_;
  const Hypothesis plain;
  const Vector v0 = evaluate(plain, {}, base, {});
  Eigen::VectorXd bk = base, bp = base;
  constexpr double kStepK = 0.01, kStepPhi = 0.002;
  bk(kLnK) += kStepK;
  bp(kPhi) += kStepPhi;
  const Vector vk = evaluate(plain, {}, bk, {}), vp = evaluate(plain, {}, bp, {});
  if (!v0.ok || !vk.ok || !vp.ok) throw RunError("diagnose: the plain model has no solution at the soil's parameters; check the soil and the loads");
  run_factor_.clear();
  channel_factor_.clear();
  for (std::size_t r = 0; r < c.runs.size(); ++r) {
    const RunData& run = c.runs[r];
    const Condition& q = c.conditions[static_cast<std::size_t>(run.condition)];
    const double t0 = std::exp(base(kLnRunIn)) / std::max(1e-9, rim_speed(q, c.wheel.radius));
    Eigen::Index n = 0;
    for (int ch = 0; ch < kChannels; ++ch)
      if (run.has[static_cast<std::size_t>(ch)]) n += static_cast<Eigen::Index>(run.bins.size());
    Eigen::VectorXd jk(n), jp(n);
    Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(n, n);
    Eigen::Index at = 0;
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      if (!run.has[ch]) continue;
      const auto m = static_cast<Eigen::Index>(run.bins.size());
      Eigen::VectorXd common = Eigen::VectorXd::Zero(n), early = Eigen::VectorXd::Zero(n);
      for (Eigen::Index b = 0; b < m; ++b) {
        const auto i = static_cast<std::size_t>(b);
        jk(at + b) = (vk.runs[r][ch][i] - v0.runs[r][ch][i]) / kStepK;
        jp(at + b) = (vp.runs[r][ch][i] - v0.runs[r][ch][i]) / kStepPhi;
        common(at + b) = 1.0;
        // How a run starts says little: whatever decays with the start-up's own length has a free amplitude.
        const double scale = ch == 0 ? q.normal_load : ch == 1 ? q.normal_load * c.wheel.radius : 3.0 * std::abs(v0.runs[r][2].back());
        if (!run.steady) early(at + b) = 0.1 * scale * std::exp(-run.bins[i].time / t0);
        double var = std::pow(noise_.sample[ch], 2) / run.bins[i].samples;
        var += std::pow(0.1 * early(at + b), 2);
        cov(at + b, at + b) += std::max(var, 1e-24);
      }
      if (noise_.eccentricity > 0 && !run.steady) {
        const double lever = noise_.eccentricity * (ch == 2 ? 1.0 : ch == 1 ? q.normal_load : q.normal_load / c.wheel.radius);
        for (const bool quarter : {false, true}) {
          Eigen::VectorXd turn = Eigen::VectorXd::Zero(n);
          for (Eigen::Index b = 0; b < m; ++b) {
            const double psi = q.angular_velocity * run.bins[static_cast<std::size_t>(b)].time;
            turn(at + b) = lever / std::numbers::sqrt2 * (quarter ? std::sin(psi) : std::cos(psi));
          }
          cov += turn * turn.transpose();
        }
      }
      double between = std::pow(noise_.floor[ch], 2);
      if (ch == 2) between += std::pow(noise_.datum, 2);
      cov += between * common * common.transpose() + early * early.transpose();
      at += m;
    }
    cov += std::pow(noise_.ln_k, 2) * jk * jk.transpose() + std::pow(noise_.phi, 2) * jp * jp.transpose();
    run_factor_.push_back(Eigen::LLT<Eigen::MatrixXd>(cov).matrixL());
    std::array<Eigen::MatrixXd, kChannels> alone;
    at = 0;
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      if (!run.has[ch]) continue;
      const auto m = static_cast<Eigen::Index>(run.bins.size());
      alone[ch] = Eigen::LLT<Eigen::MatrixXd>(cov.block(at, at, m, m)).matrixL();
      at += m;
    }
    channel_factor_.push_back(std::move(alone));
  }
  curve_factor_.clear();
  for (std::size_t i = 0; i < c.curves.size(); ++i) {
    const Curve& curve = c.curves[i];
    const auto n = static_cast<Eigen::Index>(curve.x.size());
    Eigen::VectorXd common = Eigen::VectorXd::Zero(n);
    const double top = *std::max_element(curve.y.begin(), curve.y.end());
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto j = static_cast<std::size_t>(k);
      common(k) = curve.shear ? (vp.curves[i][j] - v0.curves[i][j]) / kStepPhi / top * noise_.phi : noise_.ln_k;
    }
    Eigen::MatrixXd cov = common * common.transpose();
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto j = static_cast<std::size_t>(k);
      // A plate's first touch and a shear box's play: low readings are worth less than high ones in relative terms.
      const double relative = curve.shear ? curve_noise_[i] : curve_noise_[i] + 0.01 * top / std::max(curve.y[j], 0.01 * top);
      cov(k, k) += relative * relative;
    }
    curve_factor_.push_back(Eigen::LLT<Eigen::MatrixXd>(cov).matrixL());
  }
}

namespace {

// Measured less predicted along a curve, as relative as its noise is.
Eigen::VectorXd curve_deviation(const Curve& curve, const std::vector<double>& predicted) {
  const double top = *std::max_element(curve.y.begin(), curve.y.end());
  Eigen::VectorXd d(static_cast<Eigen::Index>(curve.x.size()));
  for (std::size_t k = 0; k < curve.x.size(); ++k) {
    const double p = predicted[k];
    d(static_cast<Eigen::Index>(k)) = curve.shear ? (curve.y[k] - p) / top : (curve.y[k] - p) / std::max(p, 0.01 * top);
  }
  return d;
}

}  // namespace

void Model::allow_eccentricity(double offset, const Eigen::VectorXd& base) {
  noise_.eccentricity = offset;
  factorise(base);
}

Eigen::VectorXd Model::whiten(const Vector& v, const std::vector<char>& use) const {
  const Campaign& c = *campaign_;
  std::vector<double> out;
  for (std::size_t r = 0; r < c.runs.size(); ++r) {
    if (!use.empty() && !use[r]) continue;
    const RunData& run = c.runs[r];
    Eigen::VectorXd d(run_factor_[r].rows());
    Eigen::Index at = 0;
    for (std::size_t ch = 0; ch < kChannels; ++ch)
      for (std::size_t b = 0; b < run.mean[ch].size(); ++b) d(at++) = run.mean[ch][b] - v.runs[r][ch][b];
    run_factor_[r].triangularView<Eigen::Lower>().solveInPlace(d);
    out.insert(out.end(), d.data(), d.data() + d.size());
  }
  for (std::size_t i = 0; i < c.curves.size(); ++i) {
    Eigen::VectorXd d = curve_deviation(c.curves[i], v.curves[i]);
    curve_factor_[i].triangularView<Eigen::Lower>().solveInPlace(d);
    out.insert(out.end(), d.data(), d.data() + d.size());
  }
  return Eigen::Map<Eigen::VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
}

std::array<double, kChannels + 1> Model::misfit_of(const Vector& v) const {
  const Campaign& c = *campaign_;
  std::array<double, kChannels + 1> out{};
  for (std::size_t r = 0; r < c.runs.size(); ++r)
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      const std::vector<double>& y = c.runs[r].mean[ch];
      if (y.empty()) continue;
      Eigen::VectorXd d(static_cast<Eigen::Index>(y.size()));
      for (std::size_t b = 0; b < y.size(); ++b) d(static_cast<Eigen::Index>(b)) = y[b] - v.runs[r][ch][b];
      channel_factor_[r][ch].triangularView<Eigen::Lower>().solveInPlace(d);
      out[ch] += d.squaredNorm();
    }
  for (std::size_t i = 0; i < c.curves.size(); ++i) {
    Eigen::VectorXd d = curve_deviation(c.curves[i], v.curves[i]);
    curve_factor_[i].triangularView<Eigen::Lower>().solveInPlace(d);
    out[kChannels] += d.squaredNorm();
  }
  return out;
}

void Model::priors(const std::vector<FitParameter>& parameters, Eigen::VectorXd& mean, Eigen::VectorXd& deviation) const {
  const Eigen::VectorXd b = base_of(campaign_->believed, campaign_->believed_angles);
  mean.head(kBaseCount) = b;
  // What is known of soils before any data: wide around the belief, for which the tests speak; the contact angles, which
  // no soil test gives, from the literature (a0 0.2 to 0.45 with negative outliers, a1 0.1 to 0.9 in published fits).
  deviation.head(kBaseCount) << 1.5, 0.4, 600.0, 0.12, 1.5, 0.15, 0.3, 0.3, 0.1, 0.15, 0.15;
  if (campaign_->known_soil) {
    // As means of a few beds of one soil differ: k and cohesion by a twentieth, friction angle by half a degree.
    deviation.head(kA1 + 1) << 0.05, 0.02, 0.05 * b(kCohesion) + 5.0, 0.01, 0.15, 0.02, 0.03;
  } else {
    mean(kA0) = 0.2;
    mean(kA1) = 0.4;
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    mean(kBaseCount + static_cast<Eigen::Index>(i)) = parameters[i].prior_mean;
    deviation(kBaseCount + static_cast<Eigen::Index>(i)) = parameters[i].prior_deviation;
  }
}

Fit Model::fit(const Hypothesis& h, const Eigen::VectorXd& start, const std::vector<bool>& fixed, const std::vector<char>& use,
               int iterations) const {
  Fit out;
  out.parameters = parameters_of(h);
  const auto ne = static_cast<Eigen::Index>(out.parameters.size()) + (h.free_channel >= 0 ? 1 : 0);
  const Eigen::Index n = kBaseCount + ne;
  Eigen::VectorXd x(n), mean = Eigen::VectorXd::Zero(n), deviation = Eigen::VectorXd::Ones(n);
  x.head(kBaseCount) = start;
  priors(out.parameters, mean, deviation);
  Eigen::VectorXd step = Eigen::VectorXd::Constant(n, 1e-4);
  step(kCohesion) = 0.5;
  step(kPhi) = 1e-5;
  step(kN) = 1e-5;
  for (std::size_t i = 0; i < out.parameters.size(); ++i) {
    const FitParameter& p = out.parameters[i];
    const auto& given = h.effects[p.effect].start;
    const auto found = given.find(p.name);
    const auto k = kBaseCount + static_cast<Eigen::Index>(i);
    x(k) = found != given.end() ? to_coordinate(found->second, p.scale) : p.prior_mean;
    step(k) = 1e-3 * p.prior_deviation;
  }
  if (h.free_channel >= 0) {
    const double scale = h.free_channel == 0 ? reference_load_ : h.free_channel == 1 ? reference_load_ * campaign_->wheel.radius : campaign_->wheel.radius;
    x(n - 1) = 0;
    mean(n - 1) = 0;
    deviation(n - 1) = 0.1 * scale;
    step(n - 1) = 1e-4 * scale;
  }
  std::vector<Eigen::Index> active;
  for (Eigen::Index i = 0; i < n; ++i)
    if (i >= kBaseCount || fixed.empty() || !fixed[static_cast<std::size_t>(i)]) active.push_back(i);
  const auto clip = [&](Eigen::VectorXd& p) {
    p(kCohesion) = std::clamp(p(kCohesion), 0.0, 1e5);
    p(kPhi) = std::clamp(p(kPhi), 0.05, 1.2);
    p(kN) = std::clamp(p(kN), 0.1, 3.0);
    p(kA0) = std::clamp(p(kA0), 0.0, 1.0);
    p(kA1) = std::clamp(p(kA1), -0.9, 1.9);
    p(kLnRunIn) = std::clamp(p(kLnRunIn), std::log(1e-4), std::log(usual_start_up(campaign_->wheel.radius)));
    for (std::size_t i = 0; i < out.parameters.size(); ++i) {
      double& v = p(kBaseCount + static_cast<Eigen::Index>(i));
      v = std::clamp(v, out.parameters[i].lower, out.parameters[i].upper);
    }
  };
  clip(x);
  const auto cost = [&](const Eigen::VectorXd& p, Eigen::VectorXd& r) {
    const Vector v = evaluate(h, out.parameters, p, use);
    if (!v.ok) return std::numeric_limits<double>::infinity();
    r = whiten(v, use);
    double c = r.squaredNorm();
    for (const Eigen::Index i : active) c += std::pow((p(i) - mean(i)) / deviation(i), 2);
    return std::isfinite(c) ? c : std::numeric_limits<double>::infinity();
  };
  Eigen::VectorXd r, trial_r;
  double best = cost(x, r);
  if (!std::isfinite(best)) {
    out.base = x.head(kBaseCount);
    out.extra.assign(x.data() + kBaseCount, x.data() + n);
    out.chi2 = out.penalty = std::numeric_limits<double>::infinity();
    return out;
  }
  const auto na = static_cast<Eigen::Index>(active.size());
  Eigen::MatrixXd hessian(na, na), j(r.size(), na);
  double lambda = 1e-3;
  // Between full Jacobians, Broyden's update along the step just made serves while it predicts the gain.
  bool fresh = false, usable = false;
  for (int it = 0, full = 0; full <= iterations && it < 4 * iterations; ++it) {
    SteadyCache cache;
    fresh = !usable;
    full += fresh;
    if (fresh) evaluate(h, out.parameters, x, use, &cache);
    for (Eigen::Index a = 0; fresh && a < na; ++a) {
      const Eigen::Index i = active[static_cast<std::size_t>(a)];
      Eigen::VectorXd p = x;
      double h_step = step(i);
      // Away from a bound, so that a strength at its null value is felt.
      if (i >= kBaseCount && i - kBaseCount < static_cast<Eigen::Index>(out.parameters.size()) &&
          p(i) + h_step > out.parameters[static_cast<std::size_t>(i - kBaseCount)].upper)
        h_step = -h_step;
      p(i) += h_step;
      const bool start_up = i >= kLnRunIn && i < kBaseCount;
      const bool free_term = h.free_channel >= 0 && i == n - 1;
      const bool of_reading = i >= kBaseCount && !free_term && out.parameters[static_cast<std::size_t>(i - kBaseCount)].of_reading;
      const Vector v = evaluate(h, out.parameters, p, use, start_up || free_term || of_reading ? &cache : nullptr);
      if (v.ok) {
        j.col(a) = (whiten(v, use) - r) / h_step;
      } else {
        j.col(a).setZero();
      }
    }
    Eigen::VectorXd gradient = j.transpose() * r;
    hessian = j.transpose() * j;
    for (Eigen::Index a = 0; a < na; ++a) {
      const Eigen::Index i = active[static_cast<std::size_t>(a)];
      const double w = 1.0 / (deviation(i) * deviation(i));
      hessian(a, a) += w;
      gradient(a) += w * (x(i) - mean(i));
    }
    bool improved = false, quiet = false;
    for (int tries = 0; tries < (fresh ? 8 : 2) && !improved; ++tries) {
      Eigen::MatrixXd damped = hessian;
      damped.diagonal() *= 1.0 + lambda;
      const Eigen::VectorXd move = -damped.ldlt().solve(gradient);
      Eigen::VectorXd p = x;
      for (Eigen::Index a = 0; a < na; ++a) p(active[static_cast<std::size_t>(a)]) += move(a);
      clip(p);
      const double c = cost(p, trial_r);
      if (c < best) {
        const double gain = best - c;
        Eigen::VectorXd moved(na), scaled(na);
        for (Eigen::Index a = 0; a < na; ++a) {
          const Eigen::Index i = active[static_cast<std::size_t>(a)];
          moved(a) = p(i) - x(i);
          scaled(a) = moved(a) / (deviation(i) * deviation(i));
        }
        const double promised = -(2.0 * gradient.dot(moved) + moved.dot(hessian * moved));
        j += (trial_r - r - j * moved) * scaled.transpose() / std::max(1e-300, scaled.dot(moved));
        usable = gain > 0.5 * promised && gain < 1.5 * promised;
        x = p;
        r = trial_r;
        best = c;
        lambda = std::max(1e-9, lambda * 0.2);
        improved = true;
        quiet = gain < kLittleGain;
      } else {
        lambda *= 6.0;
      }
    }
    if (fresh && (!improved || quiet)) {
      out.converged = true;
      break;
    }
    if (!improved || quiet) usable = false;
  }
  out.base = x.head(kBaseCount);
  out.extra.assign(x.data() + kBaseCount, x.data() + n);
  out.data = static_cast<int>(r.size());
  for (Eigen::Index a = 0; a < na; ++a) out.acting += j.col(a).norm() * deviation(active[static_cast<std::size_t>(a)]) > 1e-6;
  out.chi2 = r.squaredNorm();
  out.penalty = best - out.chi2;
  const Eigen::LDLT<Eigen::MatrixXd> factor(hessian);
  double log_det = 0;
  for (Eigen::Index a = 0; a < na; ++a) log_det += std::log(std::max(1e-300, factor.vectorD()(a)));
  double log_prior = 0;
  for (const Eigen::Index i : active) log_prior -= std::log(deviation(i));
  out.occam = log_prior - 0.5 * log_det;
  if (use.empty()) {
    const Vector v = evaluate(h, out.parameters, x, use);
    if (v.ok) out.misfit = misfit_of(v);
  }
  out.covariance = Eigen::MatrixXd::Zero(n, n);
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(na, na));
  for (Eigen::Index a = 0; a < na; ++a)
    for (Eigen::Index b = 0; b < na; ++b) out.covariance(active[static_cast<std::size_t>(a)], active[static_cast<std::size_t>(b)]) = inverse(a, b);
  return out;
}

static Eigen::VectorXd joined(const Fit& fit) {
  Eigen::VectorXd all(kBaseCount + static_cast<Eigen::Index>(fit.extra.size()));
  all.head(kBaseCount) = fit.base;
  for (std::size_t i = 0; i < fit.extra.size(); ++i) all(kBaseCount + static_cast<Eigen::Index>(i)) = fit.extra[i];
  return all;
}

Eigen::VectorXd Model::residuals(const Hypothesis& h, const Fit& fit, const std::vector<char>& use) const {
  const Vector v = evaluate(h, fit.parameters, joined(fit), use);
  return v.ok ? whiten(v, use) : Eigen::VectorXd();
}

Eigen::MatrixXd Model::jacobian(const Hypothesis& h, const Fit& fit, const std::vector<char>& use) const {
  const Eigen::VectorXd x = joined(fit);
  const Eigen::VectorXd r = whiten(evaluate(h, fit.parameters, x, use), use);
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(r.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Eigen::VectorXd p = x;
    double step = i == kCohesion ? 0.5 : 1e-4;
    const auto k = static_cast<std::size_t>(std::max<Eigen::Index>(0, i - kBaseCount));
    if (i >= kBaseCount && k < fit.parameters.size()) {
      step = 1e-3 * fit.parameters[k].prior_deviation;
      if (p(i) + step > fit.parameters[k].upper) step = -step;
    }
    p(i) += step;
    const Vector v = evaluate(h, fit.parameters, p, use);
    if (v.ok) j.col(i) = (whiten(v, use) - r) / step;
  }
  return j;
}

std::vector<std::array<std::vector<double>, kChannels>> Model::predict(const Hypothesis& h, const Fit& fit) const {
  Vector v = evaluate(h, fit.parameters, joined(fit), {});
  if (!v.ok) throw RunError("diagnose: the fitted model has no solution at a condition of the recording");
  return std::move(v.runs);
}

std::vector<std::vector<double>> Model::predict_curves(const Hypothesis& h, const Fit& fit) const {
  Vector v = evaluate(h, fit.parameters, joined(fit), {});
  if (!v.ok) throw RunError("diagnose: the fitted model has no solution at a condition of the recording");
  return std::move(v.curves);
}

double Model::run_mean_deviation(int run, int channel) const {
  const RunData& data = campaign_->runs[static_cast<std::size_t>(run)];
  const Eigen::MatrixXd& l = run_factor_[static_cast<std::size_t>(run)];
  Eigen::VectorXd w = Eigen::VectorXd::Zero(l.rows());
  Eigen::Index at = 0;
  for (int c = 0; c < kChannels; ++c) {
    const auto m = static_cast<Eigen::Index>(data.mean[static_cast<std::size_t>(c)].size());
    if (c == channel) {
      double total = 0;
      for (Eigen::Index b = 0; b < m; ++b) {
        const Bin& bin = data.bins[static_cast<std::size_t>(b)];
        if (!data.steady && bin.time < 0.3 * data.bins.back().time) continue;
        w(at + b) = bin.samples;
        total += bin.samples;
      }
      if (total > 0) w.segment(at, m) /= total;
    }
    at += m;
  }
  return (l.transpose() * w).norm();
}

void Model::estimate_noise(const Eigen::VectorXd& base) {
  const Campaign& c = *campaign_;
  // Within runs: deviation of late bins about a smooth trend.
  for (std::size_t ch = 0; ch < kChannels; ++ch) {
    std::vector<double> all;
    for (const RunData& run : c.runs) {
      if (run.steady || !run.has[ch]) continue;
      std::vector<double> x, y;
      double n = 0;
      for (std::size_t b = 0; b < run.bins.size(); ++b)
        if (run.bins[b].time > 0.3 * run.bins.back().time) {
          x.push_back(run.bins[b].time);
          y.push_back(run.mean[ch][b]);
          n += run.bins[b].samples;
        }
      if (x.size() >= 6) all.push_back(deviation_about_trend(x, y) * std::sqrt(n / static_cast<double>(x.size())));
    }
    if (!all.empty()) noise_.sample[ch] = std::max(median(all), 1e-12);
  }
  factorise(base);
  // Between runs: likelihood of the deviations of replicates from their condition's mean.
  struct Group {
    Eigen::MatrixXd deviations;  // runs x channels
    Eigen::VectorXd jk, jp, within;
  };
  std::vector<Group> groups;
  const Hypothesis plain;
  Eigen::VectorXd bk = base, bp = base;
  bk(kLnK) += 0.01;
  bp(kPhi) += 0.002;
  const Vector v0 = evaluate(plain, {}, base, {}), vk = evaluate(plain, {}, bk, {}), vp = evaluate(plain, {}, bp, {});
  for (std::size_t k = 0; k < c.conditions.size(); ++k) {
    std::vector<std::size_t> members;
    for (std::size_t r = 0; r < c.runs.size(); ++r)
      if (c.runs[r].condition == static_cast<int>(k)) members.push_back(r);
    if (members.size() < 2) continue;
    Group g;
    const auto n = static_cast<Eigen::Index>(members.size());
    g.deviations = Eigen::MatrixXd::Zero(n, kChannels);
    g.jk = g.jp = g.within = Eigen::VectorXd::Zero(kChannels);
    for (std::size_t ch = 0; ch < kChannels; ++ch) {
      const auto e = static_cast<Eigen::Index>(ch);
      bool whole = true;
      for (Eigen::Index i = 0; i < n; ++i) {
        const RunData& run = c.runs[members[static_cast<std::size_t>(i)]];
        if (!run.has[ch]) {
          whole = false;
          break;
        }
        double sum = 0, weight = 0, dk = 0, dp = 0;
        for (std::size_t b = 0; b < run.bins.size(); ++b) {
          if (!run.steady && run.bins[b].time < 0.3 * run.bins.back().time) continue;
          const double w = run.bins[b].samples;
          sum += w * run.mean[ch][b];
          dk += w * (vk.runs[members[static_cast<std::size_t>(i)]][ch][b] - v0.runs[members[static_cast<std::size_t>(i)]][ch][b]) / 0.01;
          dp += w * (vp.runs[members[static_cast<std::size_t>(i)]][ch][b] - v0.runs[members[static_cast<std::size_t>(i)]][ch][b]) / 0.002;
          weight += w;
        }
        g.deviations(i, e) = sum / weight;
        g.jk(e) = dk / weight;
        g.jp(e) = dp / weight;
        g.within(e) = std::pow(noise_.sample[ch], 2) / weight;
      }
      if (!whole) {
        g.deviations.col(e).setZero();
        g.jk(e) = g.jp(e) = 0;
        g.within(e) = 0;
      } else {
        g.deviations.col(e).array() -= g.deviations.col(e).mean();
      }
    }
    groups.push_back(std::move(g));
  }
  noise_.from_replicates = groups.size() >= 3;
  if (groups.empty()) return;
  struct Data {
    const std::vector<Group>* groups;
    const Noise* start;
  } data{&groups, &noise_};
  const auto minus_log_likelihood = [](const gsl_vector* v, void* p) {
    const Data& d = *static_cast<Data*>(p);
    const double base_values[5] = {d.start->ln_k, d.start->phi, d.start->datum, d.start->floor[0], d.start->floor[1]};
    constexpr double width[5] = {0.7, 0.7, 0.7, 1.0, 1.0};
    double s[5], out = 0;
    for (std::size_t i = 0; i < 5; ++i) {
      const double u = gsl_vector_get(v, i);
      s[i] = base_values[i] * std::exp(u);
      out += 0.5 * std::pow(u / width[i], 2);
    }
    for (const Group& g : *d.groups) {
      Eigen::MatrixXd cov = s[0] * s[0] * g.jk * g.jk.transpose() + s[1] * s[1] * g.jp * g.jp.transpose();
      cov.diagonal() += g.within;
      cov(0, 0) += s[3] * s[3];
      cov(1, 1) += s[4] * s[4];
      cov(2, 2) += s[2] * s[2];
      for (Eigen::Index e = 0; e < kChannels; ++e)
        if (g.within(e) == 0 && g.jk(e) == 0) cov(e, e) = 1.0;
      const Eigen::LLT<Eigen::MatrixXd> llt(cov);
      const Eigen::MatrixXd w = llt.matrixL().solve(g.deviations.transpose());
      const double freedom = static_cast<double>(g.deviations.rows() - 1);
      double log_det = 0;
      for (Eigen::Index e = 0; e < kChannels; ++e) log_det += 2 * std::log(llt.matrixL()(e, e));
      out += 0.5 * w.squaredNorm() + 0.5 * freedom * log_det;
    }
    return std::isfinite(out) ? out : 1e300;
  };
  const std::unique_ptr<gsl_multimin_fminimizer, void (*)(gsl_multimin_fminimizer*)> minimizer(
      gsl_multimin_fminimizer_alloc(gsl_multimin_fminimizer_nmsimplex2, 5), gsl_multimin_fminimizer_free);
  const std::unique_ptr<gsl_vector, void (*)(gsl_vector*)> x(gsl_vector_calloc(5), gsl_vector_free), steps(gsl_vector_alloc(5), gsl_vector_free);
  gsl_vector_set_all(steps.get(), 0.4);
  gsl_multimin_function f{minus_log_likelihood, 5, &data};
  gsl_multimin_fminimizer_set(minimizer.get(), &f, x.get(), steps.get());
  for (int i = 0; i < 400 && gsl_multimin_fminimizer_size(minimizer.get()) > 1e-3; ++i)
    if (gsl_multimin_fminimizer_iterate(minimizer.get())) break;
  const Noise old = noise_;
  noise_.ln_k = old.ln_k * std::exp(gsl_vector_get(minimizer->x, 0));
  noise_.phi = old.phi * std::exp(gsl_vector_get(minimizer->x, 1));
  noise_.datum = old.datum * std::exp(gsl_vector_get(minimizer->x, 2));
  noise_.floor[0] = old.floor[0] * std::exp(gsl_vector_get(minimizer->x, 3));
  noise_.floor[1] = old.floor[1] * std::exp(gsl_vector_get(minimizer->x, 4));
  factorise(base);
}

}  // namespace terrode::diagnosis
