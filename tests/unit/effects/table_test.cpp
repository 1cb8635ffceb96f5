// Every effect, held against what it says of itself. One table names them all: an effect without a line fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "bekker/bulldozing.h"
#include "core/random.h"
#include "effects/steady_reading.h"

namespace terrode::effects {
namespace {

using Wanted = std::map<std::string, std::map<std::string, double>>;

constexpr double kSmallShare = 0.22;     // of the largest change: below it a channel counts as unchanged (Fingerprint)
constexpr double kNullRoundoff = 1e-7;   // relative: law evaluated at its null value against no law, two solutions
constexpr double kDerivative = 0.05;     // one-sided difference quotients over steps h and h/2, relative
constexpr double kNoDerivative = 1e-4; // of what a typical strength would do: derivatives that vanish
constexpr double kUnchanged = 1e-6;      // relative: what does not depend on a condition, two solutions of the wheel

bekker::Soil reference_soil() {
  bekker::Soil s;
  s.shear_modulus = 0.008;
  return s;
}

bekker::Operating reference(double load = 115.0) {
  bekker::Operating o;
  o.slip = 0.3;
  o.normal_load = load;
  o.position = 0.2;
  o.time = 5.0;
  o.pass = 3;
  o.wheel_angle = 3.0;
  o.travel_length = 0.7;
  return o;
}

// A steady wheel with one effect that need not be switched on in the sense of EffectSet: its law is always called.
class Single {
 public:
  Single(const EffectType& type, const std::map<std::string, double>& given, const bekker::Soil& soil = reference_soil(),
         double tolerance = 1e-12) {
    std::vector<double> values;
    for (const Parameter& p : type.info->parameters) {
      const auto found = given.find(std::string(p.name));
      values.push_back(found == given.end() ? p.typical : found->second);
    }
    effect_ = type.make(std::move(values));
    if (effect_->hooks()) modifiers_.push_back(effect_.get());
    bekker::SteadyOptions options;
    options.tolerance = tolerance;
    wheel_.emplace(bekker::WheelSize{0.13, 0.16}, soil, bekker::ContactAngles{}, bekker::PointLaw{nullptr, nullptr, modifiers_}, options);
  }
  Reading at(const bekker::Operating& o) const {
    const bekker::SteadyState s = wheel_->solve(o);
    Reading r{s.drawbar_pull, s.driving_torque, s.sinkage, s.normal_load};
    Sample sample;
    sample.context = wheel_->context(o);
    sample.context.sinkage = s.sinkage;
    sample.time = o.time;
    sample.position = o.position;
    sample.wheel_angle = o.wheel_angle;
    SensorState settled;
    effect_->quasi_static(sample, r);
    effect_->measure(sample, r, settled);
    return r;
  }
  Reading mean(bekker::Operating o) const {
    o.phase_average = true;
    return at(o);
  }

 private:
  std::unique_ptr<Effect> effect_;
  std::vector<const bekker::StressModifier*> modifiers_;
  std::optional<bekker::SteadyWheel> wheel_;
};

Reading plain_at(const bekker::Operating& o, const bekker::Soil& soil = reference_soil(), double tolerance = 1e-12) {
  bekker::SteadyOptions options;
  options.tolerance = tolerance;
  const bekker::SteadyWheel wheel({0.13, 0.16}, soil, {}, {}, options);
  return reading_at(wheel, EffectSet(), o);
}

// Changes relative to W, W r and z.
std::array<double, 3> relative(const Reading& a, const Reading& base, double load) {
  return {(a.drawbar_pull - base.drawbar_pull) / load, (a.driving_torque - base.driving_torque) / (load * 0.13),
          (a.sinkage - base.sinkage) / base.sinkage};
}

double largest(const std::array<double, 3>& d) { return std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])}); }

const Parameter& strength_of(const EffectType& t) {
  for (const Parameter& p : t.info->parameters)
    if (p.strength) return p;
  throw RunError("an effect without a strength");
}

// A limit that each effect must reach, with the reason; evaluated by the check named for it.
struct Line {
  const char* id;
  const char* limit;
  std::function<void(const EffectType&)> check;
};

Reading with(const EffectType& t, const std::map<std::string, double>& p, const std::function<void(bekker::Operating&)>& change = {}) {
  bekker::Operating o = reference();
  if (change) change(o);
  return Single(t, p).mean(o);
}
Reading without(const std::function<void(bekker::Operating&)>& change = {}, const bekker::Soil& soil = reference_soil()) {
  bekker::Operating o = reference();
  if (change) change(o);
  o.phase_average = true;
  return plain_at(o, soil);
}
Reading instant(const EffectType& t, const std::map<std::string, double>& p, double angle, double time, double position) {
  bekker::Operating o = reference();
  o.wheel_angle = angle;
  o.time = time;
  o.position = position;
  return Single(t, p).at(o);
}
void same(const Reading& a, const Reading& b, double tolerance = 1e-8) {
  EXPECT_NEAR(a.drawbar_pull, b.drawbar_pull, tolerance * 115);
  EXPECT_NEAR(a.driving_torque, b.driving_torque, tolerance * 15);
  EXPECT_NEAR(a.sinkage, b.sinkage, tolerance * 0.01);
}

const std::vector<Line>& table() {
  static const double pi = std::numbers::pi;
  static const std::vector<Line> lines = {
      {"slip_offset", "a wheel at s + ds",
       [](const EffectType& t) { same(with(t, {{"ds", 0.1}}), without([](auto& o) { o.slip = 0.4; })); }},
      {"guide_friction", "a wheel under W - F",
       [](const EffectType& t) { same(with(t, {{"force", 15}}), without([](auto& o) { o.normal_load = 100; })); }},
      {"wheel_flexibility", "stiffer than any wheel: none; the softer, the less it sinks",
       [](const EffectType& t) {
         same(with(t, {{"stiffness", 1e9}}), without(), 1e-4);
         EXPECT_LT(with(t, {{"stiffness", 5e4}}).sinkage, with(t, {{"stiffness", 5e5}}).sinkage);
       }},
      {"rear_contact", "contact symmetric about the lowest point at lambda = 1: more support, less sinkage than at 0.5",
       [](const EffectType& t) { EXPECT_LT(with(t, {{"lambda", 1.0}}).sinkage, with(t, {{"lambda", 0.5}}).sinkage); }},
      {"unloading", "equal to rear contact by the rebound of its equation",
       [](const EffectType& t) {
         const double k0 = 2e7;
         const Reading r = with(t, {{"k0", k0}});
         const double arc = std::acos(1 - r.sinkage / 0.13) * 0.13;
         const double lambda = 1.5 * 115 / (0.16 * arc) / k0 / r.sinkage;
         same(r, with(*find_effect("rear_contact"), {{"lambda", lambda}}));
       }},
      {"slip_sinkage", "at s = 0.3 a soil of exponent n + 0.3 n1; nothing at s = 0",
       [](const EffectType& t) {
         bekker::Soil soil = reference_soil();
         soil.n += 0.3 * 0.5;
         same(with(t, {{"n1", 0.5}}), without({}, soil));
         const auto zero = [](auto& o) { o.slip = 0; };
         same(with(t, {{"n1", 0.5}}, zero), without(zero));
       }},
      {"multi_pass", "nothing on the first pass; k (1 + gain) after many",
       [](const EffectType& t) {
         const auto first = [](auto& o) { o.pass = 1; };
         same(with(t, {}, first), without(first));
         bekker::Soil soil = reference_soil();
         soil.k *= 1.8;
         const auto many = [](auto& o) { o.pass = 100; };
         same(with(t, {{"gain", 0.8}}, many), without(many, soil));
       }},
      {"plate_scale", "a soil of another k",
       [](const EffectType& t) {
         bekker::Soil soil = reference_soil();
         soil.k *= 0.7;
         same(with(t, {{"factor", 0.7}}), without({}, soil));
       }},
      {"gravity", "a soil of k g/9.81",
       [](const EffectType& t) {
         bekker::Soil soil = reference_soil();
         soil.k *= 3.71 / 9.81;
         same(with(t, {{"g", 3.71}}), without({}, soil));
       }},
      {"density_gradient", "a soil of k (1 + g x); nothing at x = 0",
       [](const EffectType& t) {
         bekker::Soil soil = reference_soil();
         soil.k *= 1.2;
         same(with(t, {{"g", 1.0}}), without({}, soil));
         same(with(t, {}, [](auto& o) { o.position = 0; }), without());
         soil.k *= std::exp(-0.2) / 1.2;
         same(with(t, {{"g", -1.0}, {"form", 1}}), without({}, soil));
       }},
      {"wall_effect", "symmetric about the middle of the bin; k (1 + gain) at a wall far from the other",
       [](const EffectType& t) {
         same(with(t, {}, [](auto& o) { o.position = 0.1; }), with(t, {}, [](auto& o) { o.position = 0.6; }));
         bekker::Soil soil = reference_soil();
         soil.k *= 1.5;
         const auto wall = [](auto& o) { o.position = 0, o.travel_length = 10; };
         same(with(t, {{"gain", 0.5}}, wall), without({}, soil));
       }},
      {"run_in", "half the strength and 1.5 k at the start; gone after many lengths",
       [](const EffectType& t) {
         bekker::Soil soil = reference_soil();
         soil.k *= 1.5;
         soil.cohesion *= 0.5;
         soil.friction_angle = std::atan(0.5 * std::tan(soil.friction_angle));
         same(instant(t, {}, 0.0, 0, 0), without({}, soil));
         same(instant(t, {}, 100.0, 0, 0), without());
       }},
      {"hard_layer", "below the layer's depth nothing: a wheel that does not reach it",
       [](const EffectType& t) {
         same(with(t, {{"depth", 0.05}}), without());
         EXPECT_LT(with(t, {{"stiffening", 50}, {"depth", 0.006}}).sinkage, without().sinkage);
       }},
      {"crust", "carries the wheel alone when strong: sinkage below its depth",
       [](const EffectType& t) { EXPECT_LT(with(t, {{"strength", 1e6}, {"depth", 0.005}}).sinkage, 0.005); }},
      {"penetration_rate", "sinkage falls with speed",
       [](const EffectType& t) {
         EXPECT_LT(with(t, {}, [](auto& o) { o.angular_velocity = 3; }).sinkage,
                   with(t, {}, [](auto& o) { o.angular_velocity = 0.03; }).sinkage);
       }},
      {"peak_shear", "Kr tau_max at large displacement (s = 1); more than that at s = 0.1",
       [](const EffectType& t) {
         const auto spin = [](auto& o) { o.slip = 1; };
         const auto slow = [](auto& o) { o.slip = 0.1; };
         const std::map<std::string, double> p = {{"Kr", 0.7}, {"Kw", 0.002}};
         EXPECT_LT(with(t, p, spin).driving_torque, 0.8 * without(spin).driving_torque);
         EXPECT_GT(with(t, p, slow).driving_torque, without(slow).driving_torque);
         const std::map<std::string, double> hump = {{"Kr", 0.7}, {"Kw", 0.0002}, {"form", 1}};
         EXPECT_NEAR(with(t, hump, spin).driving_torque, without(spin).driving_torque, 0.02 * without(spin).driving_torque);
         EXPECT_GT(with(t, {{"Kr", 0.7}, {"Kw", 0.002}, {"form", 1}}, slow).driving_torque, 1.1 * without(slow).driving_torque);
       }},
      {"pressure_dependent_K", "lost where shear is fully mobilised, most felt at low slip",
       [](const EffectType& t) {
         const auto slow = [](auto& o) { o.slip = 0.05; };
         const auto fast = [](auto& o) { o.slip = 1.0; };
         EXPECT_LT(with(t, {}, slow).driving_torque / without(slow).driving_torque,
                   with(t, {}, fast).driving_torque / without(fast).driving_torque);
       }},
      {"curved_failure_envelope", "pull over load falls with load more than without",
       [](const EffectType& t) {
         const auto heavy = [](auto& o) { o.normal_load = 400; };
         EXPECT_LT(with(t, {}, heavy).driving_torque - without(heavy).driving_torque, 4 * (with(t, {}).driving_torque - without().driving_torque));
       }},
      {"shear_rate", "nothing at rest",
       [](const EffectType& t) {
         const auto still = [](auto& o) { o.angular_velocity = 0; };
         same(with(t, {}, still), without(still));
         EXPECT_GT(with(t, {}, [](auto& o) { o.angular_velocity = 3; }).driving_torque, with(t, {}).driving_torque);
       }},
      {"interface_friction", "no more than sigma tan(delta): torque under r W tan(delta) 1.2; above phi nothing",
       [](const EffectType& t) {
         EXPECT_LT(with(t, {{"delta", 0.1}}).driving_torque, 1.2 * 0.13 * 115 * std::tan(0.1));
         same(with(t, {{"delta", 1.2}, {"adhesion", 500}}), without(), 1e-4);
       }},
      {"side_friction", "linear in its factor while small",
       [](const EffectType& t) {
         const double base = without().driving_torque;
         const double one = with(t, {{"factor", 1}}).driving_torque - base, four = with(t, {{"factor", 4}}).driving_torque - base;
         EXPECT_NEAR(four / one, 4.0, 0.05);
       }},
      {"skew", "pull falls, and more at twice the angle",
       [](const EffectType& t) {
         const double base = without().drawbar_pull;
         EXPECT_LT(with(t, {{"angle", 0.2}}).drawbar_pull, with(t, {{"angle", 0.1}}).drawbar_pull);
         EXPECT_LT(with(t, {{"angle", 0.1}}).drawbar_pull, base);
       }},
      {"periodic_failure", "a slip path of one wavelength brings the same shear back",
       [](const EffectType& t) {
         const double turn = 0.02 / (0.13 * (0.15 + 0.85 * 0.3));
         const std::map<std::string, double> p = {{"amplitude", 0.2}, {"wavelength", 0.02}};
         same(instant(t, p, 1.0, 0, 0), instant(t, p, 1.0 + turn, 0, 0), 1e-7);
         EXPECT_GT(std::abs(instant(t, p, 1.0, 0, 0).drawbar_pull - instant(t, p, 1.0 + turn / 2, 0, 0).drawbar_pull), 0.1);
       }},
      {"grousers", "no thrust at zero slip, dDP r = dT, a period of one lug",
       [](const EffectType& t) {
         const auto zero = [](auto& o) { o.slip = 0; };
         same(with(t, {}, zero), without(zero));
         const Reading a = with(t, {}), b = without();
         EXPECT_NEAR((a.drawbar_pull - b.drawbar_pull) * 0.13, a.driving_torque - b.driving_torque, 1e-8);
         same(instant(t, {}, 1.0, 0, 0), instant(t, {}, 1.0 + 2 * pi / 24, 0, 0));
         // Form 1: torque grown by h/(2 r) times what of the lugs is engaged at this slip.
         const auto spin = [](auto& o) { o.slip = 1; };
         const double share = 0.5 * 0.01 / 0.13 * (1 - std::exp(-1 / 0.1));
         EXPECT_NEAR(with(t, {{"height", 0.01}, {"form", 1}}, spin).driving_torque, (1 + share) * without(spin).driving_torque,
                     1e-3 * without(spin).driving_torque);
       }},
      {"bulldozing", "the passive force of a wedge as deep and wide as the wheel",
       [](const EffectType& t) {
         const Reading a = with(t, {{"factor", 2}}), b = without();
         const bekker::Soil s = reference_soil();
         const double n = std::pow(std::tan(pi / 4 + s.friction_angle / 2), 2), z = b.sinkage;
         EXPECT_NEAR(b.drawbar_pull - a.drawbar_pull, 2 * 0.16 * (s.unit_weight() * z * z * n / 2 + 2 * s.cohesion * z * std::sqrt(n)), 1e-8);
         EXPECT_NEAR(a.driving_torque, b.driving_torque, 1e-9);
         const Reading hegedus = with(t, {{"factor", 2}, {"form", 1}});
         EXPECT_NEAR(b.drawbar_pull - hegedus.drawbar_pull,
                     2 * 0.16 * bekker::bulldozing_resistance(s.cohesion, std::tan(s.friction_angle), s.unit_weight(), z), 1e-8);
       }},
      {"bed_drift", "sinkage linear in x",
       [](const EffectType& t) { EXPECT_NEAR(with(t, {{"slope", 0.01}}).sinkage - without().sinkage, 0.01 * 0.2, 1e-12); }},
      {"undulation", "the measured sinkage follows the bed, the pull its slope",
       [](const EffectType& t) {
         const std::map<std::string, double> p = {{"amplitude", 0.002}, {"wavelength", 0.2}};
         const Reading base = without(), crest = instant(t, p, 3, 5, 0.05), climb = instant(t, p, 3, 5, 0.2);
         EXPECT_NEAR(crest.sinkage, base.sinkage - 0.002, 1e-12);
         EXPECT_NEAR(crest.drawbar_pull, base.drawbar_pull, 1e-9);
         const double rise = 0.002 * 2 * pi / 0.2;
         EXPECT_NEAR(climb.drawbar_pull, base.drawbar_pull * (1 - base.drawbar_pull * rise / 115) - 115 * rise, 1e-9);
       }},
      {"eccentricity", "the work of lifting the load comes from the drive: T dpsi = W dh",
       [](const EffectType& t) {
         const double h = 1e-3;
         const Reading base = without(), a = instant(t, {}, 1.0 - h, 5, 0.2), b = instant(t, {}, 1.0 + h, 5, 0.2), m = instant(t, {}, 1.0, 5, 0.2);
         const double lift = -(b.sinkage - a.sinkage) / (2 * h);
         EXPECT_NEAR(m.driving_torque - base.driving_torque, 115 * lift - 0.001 * std::cos(1.0) * base.drawbar_pull, 1e-6);
       }},
      {"slope", "straight up: the whole load",
       [](const EffectType& t) { EXPECT_NEAR(with(t, {{"angle", 0.5}}).drawbar_pull, without().drawbar_pull - 115 * std::sin(0.5), 1e-9); }},
      {"crosstalk", "in proportion to the load",
       [](const EffectType& t) { EXPECT_NEAR(with(t, {{"fraction", 0.1}}).drawbar_pull, without().drawbar_pull + 11.5, 1e-9); }},
      {"drawbar_bias", "the same at every load",
       [](const EffectType& t) { EXPECT_NEAR(with(t, {{"offset", -7}}).drawbar_pull, without().drawbar_pull - 7, 1e-9); }},
      {"torque_bias", "the same at every load",
       [](const EffectType& t) { EXPECT_NEAR(with(t, {{"offset", 2}}).driving_torque, without().driving_torque + 2, 1e-9); }},
      {"drive_friction", "none for a locked wheel",
       [](const EffectType& t) {
         const auto locked = [](auto& o) { o.slip = -std::numeric_limits<double>::infinity(), o.forward_velocity = 0.04; };
         EXPECT_NEAR(with(t, {{"torque", 2}}).driving_torque, without().driving_torque + 2, 1e-9);
         same(with(t, {{"torque", 2}}, locked), without(locked));
       }},
      {"sensor_gain", "each channel by itself",
       [](const EffectType& t) {
         const Reading base = without();
         EXPECT_NEAR(with(t, {{"gain", 0.1}, {"channel", 0}}).drawbar_pull, 1.1 * base.drawbar_pull, 1e-9);
         EXPECT_NEAR(with(t, {{"gain", 0.1}, {"channel", 1}}).driving_torque, 1.1 * base.driving_torque, 1e-9);
         EXPECT_NEAR(with(t, {{"gain", 0.1}, {"channel", 2}}).sinkage, 1.1 * base.sinkage, 1e-12);
       }},
      {"sensor_drift", "rate times time, in N, N m and mm",
       [](const EffectType& t) {
         const Reading base = without();
         EXPECT_NEAR(with(t, {{"rate", 0.4}, {"channel", 0}}).drawbar_pull, base.drawbar_pull + 2, 1e-9);
         EXPECT_NEAR(with(t, {{"rate", 0.4}, {"channel", 1}}).driving_torque, base.driving_torque + 2, 1e-9);
         EXPECT_NEAR(with(t, {{"rate", 0.4}, {"channel", 2}}).sinkage, base.sinkage + 0.002, 1e-12);
       }},
      {"sensor_lag", "a step is answered with 1 - exp(-t/tau); a slow signal is delayed by tau",
       [](const EffectType& t) {
         const std::unique_ptr<Effect> e = t.make({0.2, 0});
         SensorState state;
         Sample s;
         Reading r;
         e->measure(s, r, state);
         s.time_step = 0.01;
         for (int i = 1; i <= 40; ++i) {
           r.drawbar_pull = 10;
           e->measure(s, r, state);
           EXPECT_NEAR(r.drawbar_pull, 10 * (1 - std::exp(-0.01 * i / 0.2)), 1e-9);
         }
       }},
      {"sinkage_datum", "the same at every load",
       [](const EffectType& t) { EXPECT_NEAR(with(t, {{"offset", 0.004}}).sinkage, without().sinkage + 0.004, 1e-12); }},
      {"carriage_resonance", "a sine of its amplitude and frequency",
       [](const EffectType& t) {
         EXPECT_NEAR(instant(t, {{"amplitude", 3}, {"frequency", 5}}, 0, 0.05, 0).drawbar_pull, without().drawbar_pull + 3, 1e-9);
         EXPECT_NEAR(instant(t, {{"amplitude", 3}, {"frequency", 5}}, 0, 0.1, 0).drawbar_pull, without().drawbar_pull, 1e-9);
       }},
      {"node_ripple", "the pull is the load times the slope of the axle's path",
       [](const EffectType& t) {
         const double h = 1e-6;
         const double slope = (instant(t, {}, 0, 0, 0.003 + h).sinkage - instant(t, {}, 0, 0, 0.003 - h).sinkage) / (2 * h);
         EXPECT_NEAR(instant(t, {}, 0, 0, 0.003).drawbar_pull - without().drawbar_pull, 115 * slope, 1e-4);
       }},
      {"undamped_bed", "a sine of its frequency in sinkage, forces unchanged",
       [](const EffectType& t) {
         const Reading base = without(), r = instant(t, {{"frequency", 5}}, 0, 0.05, 0);
         EXPECT_NEAR(r.sinkage, 1.02 * base.sinkage, 1e-9);
         EXPECT_NEAR(r.drawbar_pull, base.drawbar_pull, 1e-9);
       }},
  };
  return lines;
}

TEST(EveryEffect, HasALineInTheTable) {
  for (const EffectType& t : all_effects())
    EXPECT_EQ(std::count_if(table().begin(), table().end(), [&](const Line& l) { return t.info->id == l.id; }), 1) << t.info->id;
  for (const Line& l : table()) EXPECT_NE(find_effect(l.id), nullptr) << l.id;
}

TEST(EveryEffect, ReachesItsLimits) {
  for (const Line& line : table()) {
    SCOPED_TRACE(std::string(line.id) + ": " + line.limit);
    line.check(*find_effect(line.id));
  }
}

TEST(EveryEffect, IsDescribedInFull) {
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    const Info& i = *t.info;
    for (const std::string_view text : {i.id, i.name, i.physics, i.equation, i.source, i.hook, i.fingerprint.text, i.separated_by})
      EXPECT_FALSE(text.empty());
    EXPECT_FALSE(i.parameters.empty());
    bool strength = false;
    for (const Parameter& p : i.parameters) {
      strength = strength || p.strength;
      EXPECT_TRUE(p.lower < p.upper) << p.name;
      EXPECT_TRUE(p.typical >= p.lower && p.typical <= p.upper) << p.name;
      EXPECT_GT(p.prior_scale, 0) << p.name;
      EXPECT_FALSE(p.meaning.empty()) << p.name;
      if (p.strength) {
        EXPECT_NE(p.typical, p.null_value) << p.name;
      }
      if (p.scale == Scale::log) {
        EXPECT_GT(p.lower, 0) << p.name;
      }
    }
    EXPECT_TRUE(strength);
    for (const std::string_view other : i.confused_with) {
      EXPECT_NE(find_effect(std::string(other)), nullptr) << other;
      EXPECT_NE(other, i.id);
    }
  }
}

// Switched off, an effect leaves every bit; its law evaluated at the null value gives the plain numbers.
TEST(EveryEffect, AtItsNullValueLeavesTheModelAsItWas) {
  const Reading base = plain_at(reference());
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    const Parameter& p = strength_of(t);
    const EffectSet off(Wanted{{std::string(t.info->id), {{std::string(p.name), p.null_value}}}});
    ASSERT_TRUE(off.empty());
    const bekker::SteadyOptions options{.tolerance = 1e-12};
    const bekker::SteadyWheel wheel({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, off.modifiers()}, options);
    const Reading bitwise = reading_at(wheel, off, reference());
    EXPECT_EQ(bitwise.drawbar_pull, base.drawbar_pull);
    EXPECT_EQ(bitwise.driving_torque, base.driving_torque);
    EXPECT_EQ(bitwise.sinkage, base.sinkage);
    // Close to the null value the law comes close: at the null value itself a wavelength of 0 has no ripple to evaluate.
    const double near = std::isinf(p.null_value) ? 1e30 : p.null_value + 1e-17 * (p.typical - p.null_value);
    const auto d = relative(Single(t, {{std::string(p.name), near}}).at(reference()), base, 115.0);
    EXPECT_LT(largest(d), kNullRoundoff);
  }
}

TEST(EveryEffect, ChangesTheMeansWithTheSignsItDeclares) {
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    const Fingerprint& f = t.info->fingerprint;
    const std::array<int, 3> declared = {f.pull, f.torque, f.sinkage};
    for (const double load : {115.0, 57.5, 230.0}) {
      bekker::Operating o = reference(load);
      o.phase_average = true;
      const auto d = relative(Single(t, {}).at(o), plain_at(o), load);
      for (std::size_t c = 0; c < 3; ++c) {
        if (declared[c] != 0) {
          EXPECT_GT(d[c] * declared[c], 0) << "channel " << c << " at " << load << " N: " << d[0] << " " << d[1] << " " << d[2];
        }
        if (load != 115.0) continue;
        if (declared[c] != 0) {
          EXPECT_GE(std::abs(d[c]), kSmallShare * largest(d)) << "channel " << c << ": " << d[0] << " " << d[1] << " " << d[2];
        } else {
          // An effect that leaves all means leaves them to the rounding of two ways of integrating.
          EXPECT_LE(std::abs(d[c]), std::max(kSmallShare * largest(d), kNullRoundoff)) << "channel " << c << ": " << d[0] << " " << d[1] << " " << d[2];
        }
      }
    }
  }
}

TEST(EveryEffect, DependsOnWhatItDeclares) {
  const Reading base = plain_at(reference());
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    const Fingerprint& f = t.info->fingerprint;
    const Single effect(t, {});
    const auto varies = [&](const std::function<void(bekker::Operating&)>& change) {
      bekker::Operating o = reference();
      change(o);
      // The plain wheel knows none of these conditions; what differs is the effect.
      return largest(relative(effect.at(o), effect.at(reference()), 115.0)) > kUnchanged * (1 + largest(relative(effect.at(o), base, 115.0)));
    };
    EXPECT_EQ(varies([](auto& o) { o.angular_velocity *= 5; }), f.with_speed);
    EXPECT_EQ(varies([](auto& o) { o.pass = 1; }), f.with_pass);
    EXPECT_EQ(varies([](auto& o) { o.position = 0.043; }), f.with_position);
    EXPECT_EQ(varies([](auto& o) { o.wheel_angle = 0.37; }), f.with_angle);
    // "With time" may mean the path since the run's start, which the wheel's angle carries.
    const bool time = varies([](auto& o) { o.time = 1.237; });
    if (time) {
      EXPECT_TRUE(f.with_time);
    }
    if (f.with_time) {
      EXPECT_TRUE(time || f.with_angle);
    }
    const EffectSet set(Wanted{{std::string(t.info->id), {}}});
    EXPECT_EQ(set.soil_varies(), !set.modifiers().empty() && (f.with_position || f.with_time || f.with_angle));
  }
}

TEST(EveryEffect, HasASmoothOneSidedDerivativeAtItsNullValue) {
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    const Parameter& p = strength_of(t);
    const bekker::Operating o = reference();
    const Reading base = plain_at(o);
    // Contact behind the lowest point grows as acos(1 - x), with the square root of its strength: smooth in that.
    const double power = t.info->id == "rear_contact" || t.info->id == "unloading" ? 2.0 : 1.0;
    const auto slope = [&](double share) {
      // A strength whose null is at infinity is varied as its inverse.
      const double s = std::pow(share, power);
      const double value = p.scale == Scale::inverse ? p.typical / s : p.null_value + s * (p.typical - p.null_value);
      auto d = relative(Single(t, {{std::string(p.name), value}}).at(o), base, 115.0);
      for (double& x : d) x /= share;
      return d;
    };
    const auto a = slope(2e-4), b = slope(1e-4);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], kDerivative * largest(b) + kNoDerivative) << "channel " << c;
  }
}

// The load that solve() carries against Simpson's rule on 40,000 even intervals of the stresses it states, whose error at
// a corner of the law is below 1e-9; singles, and laws with corners together.
TEST(EveryEffect, IntegralsKeepTheirTolerance) {
  constexpr double kIntegral = 1e-8;  // of the load: ten times the solver's tolerance, for touching corners
  std::vector<Wanted> sets = {{{"penetration_rate", {}}, {"hard_layer", {}}, {"interface_friction", {}}},
                              {{"hard_layer", {{"depth", 0.002}, {"stiffening", 5}}}, {"interface_friction", {{"delta", 0.25}, {"adhesion", 200}}}},
                              {{"rear_contact", {}}, {"bulldozing", {}}, {"curved_failure_envelope", {}}}};
  for (const EffectType& t : all_effects()) sets.push_back({{std::string(t.info->id), {}}});
  for (const Wanted& wanted : sets) {
    const EffectSet set(wanted);
    if (set.modifiers().empty()) continue;
    const bekker::SteadyWheel wheel({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, set.modifiers()});
    for (const double slip : {-0.4, 0.07, 0.25, 0.6})
      for (const double load : {60.0, 180.0}) {
        bekker::Operating o = reference(load);
        o.slip = slip;
        o.phase_average = true;
        const bekker::SteadyState s = wheel.solve(o);
        std::vector<bekker::ProfilePoint> profile(40001);
        wheel.profile(o, s, profile);
        double sum = 0.0;
        for (std::size_t i = 0; i < profile.size(); ++i) {
          const bekker::ProfilePoint& p = profile[i];
          const double weight = i == 0 || i + 1 == profile.size() ? 1.0 : i % 2 ? 4.0 : 2.0;
          sum += weight * (p.sigma * std::cos(p.theta) + p.tau * std::sin(p.theta));
        }
        const double radius = s.sinkage / (1.0 - std::cos(s.entry_angle));
        const double length = (s.entry_angle - s.exit_angle) / static_cast<double>(profile.size() - 1);
        const double wanted_load = set.effects().front()->info().id == "guide_friction" ? s.normal_load : load;
        EXPECT_NEAR(radius * 0.16 * sum * length / 3.0, wanted_load, kIntegral * load) << wanted.begin()->first << " at slip " << slip << ", " << load << " N";
      }
  }
}

// Every three effects together against the solution at a thousandth of the tolerance, which passes through finer rules:
// also where corners of the laws only just touch, as those of peak_shear and interface_friction do at high slip.
TEST(EveryThreeEffects, KeepTheToleranceOfTheSteadyWheel) {
  constexpr double kClose = 1e-8;  // of load, load times radius and sinkage: ten times the tolerance, for touching corners
  std::vector<std::string> ids;
  for (const EffectType& t : all_effects())
    if (!EffectSet(Wanted{{std::string(t.info->id), {}}}).modifiers().empty()) ids.emplace_back(t.info->id);
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t j = i + 1; j < ids.size(); ++j)
      for (std::size_t k = j + 1; k < ids.size(); ++k) {
        const EffectSet set(Wanted{{ids[i], {}}, {ids[j], {}}, {ids[k], {}}});
        const bekker::SteadyWheel wheel({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, set.modifiers()});
        const bekker::SteadyWheel finer({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, set.modifiers()}, {.tolerance = 1e-12});
        for (const double slip : {-0.35, 0.18, 0.82}) {
          bekker::Operating o = reference(115.0 + 94.0 * slip);
          o.slip = slip;
          o.phase_average = true;
          const bekker::SteadyState a = wheel.solve(o), b = finer.solve(o);
          EXPECT_NEAR(a.drawbar_pull, b.drawbar_pull, kClose * o.normal_load) << ids[i] << ", " << ids[j] << ", " << ids[k] << " at slip " << slip;
          EXPECT_NEAR(a.driving_torque, b.driving_torque, kClose * o.normal_load * 0.13) << ids[i] << ", " << ids[j] << ", " << ids[k];
          EXPECT_NEAR(a.sinkage, b.sinkage, kClose * b.sinkage) << ids[i] << ", " << ids[j] << ", " << ids[k] << " at slip " << slip;
        }
      }
}

// Random soils and wheels, parameters at their bounds and anywhere between: finite, or an error that says why.
TEST(EveryEffect, StaysFiniteAtExtremeParameters) {
  Random random(20261);
  int solved = 0, refused = 0;
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    for (int trial = 0; trial < 60; ++trial) {
      bekker::Soil soil;
      soil.k = std::exp(random.uniform(std::log(2e4), std::log(2e6)));
      soil.n = random.uniform(0.4, 1.6);
      soil.cohesion = trial % 3 ? random.uniform(0, 3000) : 0.0;
      soil.friction_angle = random.uniform(0.2, 0.8);
      soil.shear_modulus = std::exp(random.uniform(std::log(5e-4), std::log(0.03)));
      std::map<std::string, double> values;
      for (const Parameter& p : t.info->parameters) {
        const double at = trial % 4 == 0 ? 0.0 : trial % 4 == 1 ? 1.0 : random.uniform(0.0, 1.0);
        double v = p.scale == Scale::inverse || p.scale == Scale::log
                       ? std::exp(std::log(std::max(p.lower, 1e-12)) + at * (std::log(p.upper) - std::log(std::max(p.lower, 1e-12))))
                       : p.lower + at * (p.upper - p.lower);
        v = p.scale == Scale::choice ? std::round(v) : std::clamp(v, p.lower, p.upper);
        values[std::string(p.name)] = v;
      }
      const EffectSet set(Wanted{{std::string(t.info->id), values}});
      const bekker::SteadyWheel wheel({random.uniform(0.05, 0.3), random.uniform(0.03, 0.3)}, soil, {}, {nullptr, nullptr, set.modifiers()},
                                      {.tolerance = 1e-6});
      bekker::Operating o = reference(random.uniform(20, 500));
      o.slip = std::array<double, 7>{-std::numeric_limits<double>::infinity(), -2, -0.3, 0, 0.02, 0.4, 1}[static_cast<std::size_t>(trial % 7)];
      o.angular_velocity = std::array<double, 3>{0.0, 0.3, 5.0}[static_cast<std::size_t>(trial % 3)];
      o.forward_velocity = 0.04;
      o.position = trial % 5 ? random.uniform(0, 0.7) : 0.0;
      o.wheel_angle = trial % 5 ? random.uniform(0, 20) : 0.0;
      o.time = trial % 5 ? random.uniform(0, 20) : 0.0;
      try {
        for (const bool mean : {false, true}) {
          o.phase_average = mean;
          const Reading r = reading_at(wheel, set, o);
          EXPECT_TRUE(std::isfinite(r.drawbar_pull) && std::isfinite(r.driving_torque) && std::isfinite(r.sinkage) && std::isfinite(r.normal_load))
              << "trial " << trial << ", slip " << o.slip;
        }
        ++solved;
      } catch (const RunError& e) {
        // The soil does not carry the load, or the guide carries all of it: said, not computed.
        const std::string what = e.what();
        EXPECT_TRUE(what.find("does not carry") != std::string::npos || what.find("carries the whole load") != std::string::npos)
            << "trial " << trial << ": " << what;
        ++refused;
      }
    }
  }
  EXPECT_GT(solved, 3 * refused);
}

TEST(EffectSet, ComposesInTheOrderOfTheListWhateverTheOrderGiven) {
  // Gain before drift in the list: the drift is not scaled.
  const EffectSet set(Wanted{{"sensor_drift", {{"rate", 0.4}}}, {"sensor_gain", {{"gain", 0.5}}}});
  const bekker::SteadyWheel wheel({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, set.modifiers()});
  EXPECT_NEAR(steady_reading(wheel, set, reference()).drawbar_pull, 1.5 * plain_at(reference()).drawbar_pull + 2.0, 1e-6);
  // Slip offset acts before what depends on slip: the soil digs by the slip that it sees.
  const EffectSet two(Wanted{{"slip_sinkage", {{"n1", 0.5}}}, {"slip_offset", {{"ds", 0.1}}}});
  const bekker::SteadyWheel both({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, two.modifiers()});
  bekker::Operating o = reference();
  o.slip = 0.4;
  same(steady_reading(both, two, reference()), Single(*find_effect("slip_sinkage"), {{"n1", 0.5}}).mean(o), 1e-6);
}

// Power into the wheel less power out is what the soil takes: compaction, sliding, soil pushed in front and sliding behind
// lugs, each from the stresses that the wheel states. None of it is negative.
TEST(EffectSet, EnergyAuditOfSoilAndWheelEffectsCloses) {
  constexpr double kAudit = 1e-7;  // of the load times the rim's speed: Simpson's rule on 20,000 intervals across corners
  for (const EffectType& t : all_effects()) {
    const EffectSet set(Wanted{{std::string(t.info->id), {}}});
    if (set.modifiers().empty()) continue;
    const bekker::SteadyWheel wheel({0.13, 0.16}, reference_soil(), {}, {nullptr, nullptr, set.modifiers()});
    for (const double slip : {0.1, 0.3, 0.7}) {
      SCOPED_TRACE(std::string(t.info->id) + " at slip " + std::to_string(slip));
      bekker::Operating o = reference();
      o.slip = slip;
      o.phase_average = true;
      const bekker::SteadyState s = wheel.solve(o);
      std::vector<bekker::ProfilePoint> profile(20001);
      wheel.profile(o, s, profile);
      const double rim = o.angular_velocity * 0.13;
      // The wheel's own speed: an offset of slip is one of the speed that is read.
      const double speed = rim * (1.0 - slip - (t.info->id == "slip_offset" ? set.effects().front()->values().front() : 0.0));
      double shear = 0.0, sliding = 0.0;
      for (std::size_t i = 0; i < profile.size(); ++i) {
        const double weight = i == 0 || i + 1 == profile.size() ? 1.0 : i % 2 ? 4.0 : 2.0;
        shear += weight * profile[i].tau;
        sliding += weight * profile[i].tau * (rim - speed * std::cos(profile[i].theta));
      }
      const double area = s.sinkage / (1.0 - std::cos(s.entry_angle)) * 0.16;
      const double length = (s.entry_angle - s.exit_angle) / static_cast<double>(profile.size() - 1) / 3.0;
      const double lugs = s.driving_torque / 0.13 - area * shear * length;
      const double in = s.driving_torque * o.angular_velocity - s.drawbar_pull * speed;
      const double compaction = s.compaction_resistance * speed, slide = area * sliding * length, pushed = s.drag * speed, behind = lugs * (rim - speed);
      EXPECT_NEAR(in, compaction + slide + pushed + behind, kAudit * o.normal_load * rim);
      EXPECT_GT(compaction, 0);
      EXPECT_GT(slide, 0);
      EXPECT_GE(pushed, 0);
      EXPECT_GE(behind, -kAudit * o.normal_load * rim);
    }
  }
}

// What acts in the rig says where its energy comes from, and over its period takes as much as it says; sensors take none.
TEST(EveryEffect, ClosesItsEnergyOrStatesTheSource) {
  const bekker::Operating o = reference();
  const Reading base = without();
  const double omega = o.angular_velocity, speed = 0.13 * omega * (1.0 - o.slip), power = o.normal_load * speed;
  for (const EffectType& t : all_effects()) {
    SCOPED_TRACE(std::string(t.info->id));
    const EffectSet set(Wanted{{std::string(t.info->id), {}}});
    const bool acts = !set.modifiers().empty() || set.has_bed(), shows = t.info->hook.starts_with("sensor");
    EXPECT_EQ(t.info->energy.empty(), acts || shows);
    if (acts || shows) continue;  // the audits of soil, wheel and bed; what is only shown does no work
    double taken = 0.0;
    constexpr int kInstants = 400;  // whole periods of turn, node and swing
    for (int i = 0; i < kInstants; ++i) {
      const double share = (i + 0.5) / kInstants;
      const Reading r = instant(t, {}, 2.0 * std::numbers::pi * share, 0.2 * share, 0.2 * share);
      taken += ((r.driving_torque - base.driving_torque) * omega - (r.drawbar_pull - base.drawbar_pull) * speed) / kInstants;
    }
    const double said = t.info->id == "slope" ? power * std::sin(0.0175) : t.info->id == "drive_friction" ? 0.3 * omega : 0.0;
    EXPECT_NEAR(taken, said, 1e-8 * power);
  }
}

// Without ground that varies, the bed gives or takes what the wheel's fall or rise does; the soil takes as much as before,
// more by what the inclined pull adds to the load, which the torque tells.
TEST(EffectSet, EnergyOfABedIsThatOfTheWheelsHeight) {
  for (const EffectType& t : all_effects()) {
    const EffectSet set(Wanted{{std::string(t.info->id), {}}});
    if (!set.has_bed()) continue;
    SCOPED_TRACE(std::string(t.info->id));
    bekker::Operating o = reference();
    const double h = 1e-6;
    const Reading at = instant(t, {}, 0, 0, o.position), ahead = instant(t, {}, 0, 0, o.position + h), behind = instant(t, {}, 0, 0, o.position - h);
    const double fall = (ahead.sinkage - behind.sinkage) / (2 * h);
    const Reading plain = without();
    const double omega = o.angular_velocity, speed = 0.13 * omega * (1.0 - o.slip), heavier = at.driving_torque / plain.driving_torque;
    const double taken = plain.driving_torque * omega - plain.drawbar_pull * speed;
    EXPECT_NEAR(at.driving_torque * omega - at.drawbar_pull * speed + o.normal_load * fall * speed, heavier * taken, 1e-5 * taken);
    EXPECT_NEAR(heavier - 1.0, plain.drawbar_pull * fall / o.normal_load, 1e-9);
  }
}

}  // namespace
}  // namespace terrode::effects
