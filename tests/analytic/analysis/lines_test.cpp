// Lines of known origin in synthetic runs: found where they are, and locked to what made them.
#include "analysis/lines.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "core/random.h"

namespace terrode::analysis {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kRadius = 0.13;  // m

struct Made {
  double omega = 0.3, slip = 0.2;   // rad/s, -
  double length = 20.0, rate = 50.0;
  double noise = 0.3;               // deviation of red noise in N
  double sway = 0.0;                // share by which the wheel's rate varies within the run
  std::uint64_t seed = 1;
};

// A run whose drawbar pull is red noise and the sum of `signal(t, turns, travel, slipped)`.
recording::Run make_run(const Made& m, const std::function<double(double, double, double, double)>& signal) {
  recording::Run run;
  run.id = "r" + std::to_string(m.seed);
  run.condition.slip = m.slip;
  run.condition.angular_velocity = m.omega;
  run.condition.forward_velocity = m.omega * kRadius * (1.0 - m.slip);
  Random random(m.seed);
  recording::Channel drawbar{"drawbar_pull", "N", {}}, omega{"angular_velocity", "rad/s", {}}, speed{"forward_velocity", "m/s", {}};
  double turns = 0.0, travel = 0.0, slipped = 0.0, red = 0.0;
  const auto n = static_cast<std::size_t>(m.length * m.rate);
  for (std::size_t i = 0; i < n; ++i) {
    const double t = static_cast<double>(i) / m.rate;
    const double w = m.omega * (1.0 + m.sway * std::sin(kTurn * t / m.length));
    const double v = w * kRadius * (1.0 - m.slip);
    run.time.push_back(t);
    red = 0.7 * red + std::sqrt(1.0 - 0.49) * random.normal();
    drawbar.values.push_back(10.0 + m.noise * red + signal(t, turns, travel, slipped));
    omega.values.push_back(w);
    speed.values.push_back(v);
    turns += w / m.rate / kTurn;
    travel += v / m.rate;
    slipped += std::abs(kRadius * w - v) / m.rate;
  }
  run.channels = {drawbar, omega, speed};
  return run;
}

LineOptions options() {
  LineOptions o;
  o.wheel_radius = kRadius;
  return o;
}

std::vector<recording::Run> make_runs(const std::function<double(double, double, double, double)>& signal) {
  std::vector<recording::Run> runs;
  std::uint64_t seed = 10;
  for (const double omega : {0.25, 0.3, 0.4})
    for (const double slip : {0.1, 0.3, 0.6}) {
      Made m;
      m.omega = omega;
      m.slip = slip;
      m.seed = ++seed;
      runs.push_back(make_run(m, signal));
    }
  return runs;
}

const LineTrack* strongest(const Oscillation& o) {
  const LineTrack* best = nullptr;
  for (const LineTrack& t : o.tracks.at("drawbar_pull"))
    if (!best || t.points.size() > best->points.size()) best = &t;
  return best;
}

TEST(Lines, FalseAlarmsStayWithinWhatIsAllowed) {
  constexpr int kSeries = 300;
  for (const double phi : {0.0, 0.8, 0.95})
    for (const std::size_t n : {std::size_t{200}, std::size_t{400}}) {
      int alarms = 0;
      for (int k = 0; k < kSeries; ++k) {
        Random random(1000 + static_cast<std::uint64_t>(k));
        recording::Run run;
        recording::Channel c{"drawbar_pull", "N", {}};
        double x = random.normal();
        for (std::size_t i = 0; i < n; ++i) {
          run.time.push_back(0.04 * static_cast<double>(i));
          c.values.push_back(x);
          x = phi * x + std::sqrt(1.0 - phi * phi) * random.normal();
        }
        run.channels = {c};
        LineOptions o;
        o.begin = 0.0;
        if (!channel_spectrum(run, "drawbar_pull", o).lines.empty()) ++alarms;
      }
      // One in a hundred is allowed; 300 series show at most 9 with probability 0.999. The background is estimated from
      // the same series, which costs up to as much again.
      EXPECT_LE(alarms, 12) << phi << " " << n;
    }
}

TEST(Lines, FindsFrequencyAmplitudeAndShare) {
  Made m;
  m.seed = 5;
  const auto run = make_run(m, [](double t, double, double, double) { return 0.4 * std::cos(kTurn * 2.345 * t + 0.5); });
  LineOptions o = options();
  o.begin = 0.0;
  const ChannelSpectrum c = channel_spectrum(run, "drawbar_pull", o);
  ASSERT_EQ(c.lines.size(), 1u);
  const SpectralLine& l = c.lines[0];
  EXPECT_NEAR(l.frequency, 2.345, 4.0 * l.frequency_std);
  EXPECT_LT(l.frequency_std, 0.01);
  EXPECT_NEAR(l.amplitude, 0.4, 0.08);
  EXPECT_NEAR(l.phase, 0.5, 0.4);
  EXPECT_NEAR(l.share_of_variance, 0.08 / (0.08 + 0.09), 0.1);
  EXPECT_TRUE(l.sinusoidal);
  EXPECT_GT(l.significance, 3.0);
  EXPECT_NEAR(l.order, 2.345 / (0.3 / kTurn), 0.3);
  EXPECT_EQ(l.locked_to, Lock::undecided);
  EXPECT_NEAR(c.mean, 10.0, 0.1);
}

TEST(Lines, FindsAWeakLineBesideAStrongOneAndNamesHarmonics) {
  Made m;
  m.seed = 6;
  const auto run = make_run(m, [](double t, double, double, double) {
    return 20.0 * std::sin(kTurn * 1.5 * t) + 0.5 * std::sin(kTurn * 3.0 * t) + 0.4 * std::sin(kTurn * 5.21 * t);
  });
  LineOptions faint = options();
  faint.smallest_share = 0.0;
  const ChannelSpectrum c = channel_spectrum(run, "drawbar_pull", faint);
  ASSERT_EQ(c.lines.size(), 3u);
  EXPECT_NEAR(c.lines[0].frequency, 1.5, 0.001);
  for (std::size_t i = 1; i < 3; ++i) {
    const bool second = std::abs(c.lines[i].frequency - 3.0) < 0.05;
    EXPECT_EQ(c.lines[i].harmonic_of, second ? 0 : -1);
    EXPECT_EQ(c.lines[i].harmonic, second ? 2 : 1);
  }
}

// A strong line that wavers in frequency is broader than the resolution: what its bins hold must not become the background.
TEST(Lines, AStrongBroadLineStaysOutOfItsOwnBackground) {
  constexpr int kSeries = 60;
  int found = 0;
  for (int k = 0; k < kSeries; ++k) {
    Random random(5000 + static_cast<std::uint64_t>(k));
    recording::Run run;
    recording::Channel c{"drawbar_pull", "N", {}};
    double phase = 0.0, wander = 0.0;
    for (std::size_t i = 0; i < 400; ++i) {
      run.time.push_back(0.05 * static_cast<double>(i));
      wander = 0.98 * wander + 0.1 * random.normal();  // 0.13 Hz; the bandwidth is 0.15 Hz
      phase += kTurn * 0.05 * (3.0 + 0.25 * wander);
      c.values.push_back(2.0 * std::sin(phase) + 0.5 * random.normal());
    }
    run.channels = {c};
    LineOptions o;
    o.begin = 0.0;
    for (const SpectralLine& l : channel_spectrum(run, "drawbar_pull", o).lines)
      if (std::abs(l.frequency - 3.0) < 0.75) {
        ++found;
        break;
      }
  }
  EXPECT_GE(found, kSeries - 1);
}

struct Origin {
  Lock lock;
  double value;
  std::function<double(double, double, double, double)> signal;
};

TEST(Lines, AreLockedToWhatMadeThem) {
  const Origin origins[] = {
      {Lock::time, 1.7, [](double t, double, double, double) { return 0.5 * std::sin(kTurn * 1.7 * t); }},
      {Lock::wheel, 24.0, [](double, double u, double, double) { return 0.5 * std::sin(kTurn * 24.0 * u); }},
      {Lock::travel, 45.0, [](double, double, double x, double) { return 0.5 * std::sin(kTurn * 45.0 * x); }},
      {Lock::slip_travel, 80.0, [](double, double, double, double j) { return 0.5 * std::sin(kTurn * 80.0 * j); }},
  };
  for (const Origin& o : origins) {
    const Oscillation result = analyse_oscillation(make_runs(o.signal), {}, options());
    ASSERT_EQ(result.channels.size(), 1u);
    const LineTrack* t = strongest(result);
    ASSERT_NE(t, nullptr) << lock_name(o.lock);
    EXPECT_EQ(lock_name(t->locked_to), lock_name(o.lock));
    EXPECT_NEAR(t->value, o.value, 0.01 * o.value) << lock_name(o.lock);
    EXPECT_GT(t->evidence, 4.6);
  }
}

TEST(Lines, ARateThatRisesWithSlipFromAFloorIsSlipTravel) {
  // f = 12.5 r omega + 70 |r omega - v|
  const auto signal = [](double, double u, double, double j) { return 0.6 * std::sin(kTurn * (12.5 * kRadius * kTurn * u + 70.0 * j)); };
  const LineTrack* t = nullptr;
  const Oscillation o = analyse_oscillation(make_runs(signal), {}, options());
  t = strongest(o);
  ASSERT_NE(t, nullptr);
  EXPECT_EQ(lock_name(t->locked_to), "slip_travel");
  EXPECT_NEAR(t->value, 70.0, 1.5);
  EXPECT_NEAR(t->slip_offset * t->value, 12.5, 0.8);
}

TEST(Lines, ClaimNothingThatTheRunsCannotTell) {
  const auto grousers = [](double, double u, double, double) { return 0.5 * std::sin(kTurn * 24.0 * u); };
  Made a, b;
  a.seed = 21;
  b.seed = 22;
  const auto alone = analyse_oscillation({make_run(a, grousers)}, {}, options());
  EXPECT_EQ(strongest(alone)->locked_to, Lock::undecided);
  // Two runs at one speed and one slip: every axis holds the line.
  const auto same = analyse_oscillation({make_run(a, grousers), make_run(b, grousers)}, {}, options());
  EXPECT_EQ(strongest(same)->locked_to, Lock::undecided);
  EXPECT_NE(strongest(same)->driver.find("time or"), std::string::npos);
  // Another slip at the same wheel rate rules out travel and slip, not time.
  b.slip = 0.6;
  const auto slips = analyse_oscillation({make_run(a, grousers), make_run(b, grousers)}, {}, options());
  EXPECT_EQ(strongest(slips)->locked_to, Lock::undecided);
  EXPECT_EQ(strongest(slips)->driver.find("travel"), std::string::npos) << strongest(slips)->driver;
  // A known number of lugs names the line even in one run.
  LineOptions known = options();
  known.grouser_count = 24;
  const auto named = analyse_oscillation({make_run(a, grousers)}, {}, known);
  EXPECT_EQ(strongest(named)->locked_to, Lock::wheel);
  EXPECT_NE(strongest(named)->driver.find("grouser passing (24"), std::string::npos);
}

TEST(Lines, SpeedThatVariesWithinOneRunDecides) {
  Made m;
  m.sway = 0.3;
  m.length = 40.0;
  m.noise = 0.1;
  m.seed = 31;
  const auto wheel = make_run(m, [](double, double u, double, double) { return 0.5 * std::sin(kTurn * 24.0 * u); });
  LineOptions o = options();
  o.begin = 0.0;
  const auto osc = analyse_oscillation({wheel}, {}, o);
  const auto& spectrum = osc.spectra.at("drawbar_pull")[0];
  ASSERT_FALSE(spectrum.lines.empty());
  ASSERT_TRUE(spectrum.resampled.contains(Axis::wheel));
  double here = 0.0, there = 0.0;
  for (const double d : spectrum.spectrum.density) here = std::max(here, d);
  for (const double d : spectrum.resampled.at(Axis::wheel).density) there = std::max(there, d / spectrum.axis_rate[1]);
  EXPECT_GT(there, 3.0 * here) << "the line is smeared in time and sharp per turn";
}

TEST(Resonances, DampingOfADrivenAndOfAFreeOscillator) {
  const double f0 = 4.0, zeta = 0.03, dt = 0.005;
  const double w = kTurn * f0, wd = w * std::sqrt(1 - zeta * zeta), decay = std::exp(-zeta * w * dt);
  Random random(41);
  EvenSeries driven, free;
  driven.step = free.step = dt;
  double a = 0.0, b = 0.0;
  for (int i = 0; i < 24000; ++i) {
    const double x = 2.0 * decay * std::cos(wd * dt) * a - decay * decay * b + random.normal();
    b = a;
    a = x;
    driven.x.push_back(x);
  }
  const auto r = resonance_near(driven, 4.1);
  ASSERT_TRUE(r);
  EXPECT_NEAR(r->frequency, f0, 0.1);
  EXPECT_NEAR(r->damping, zeta, 4.0 * r->damping_std);
  EXPECT_LT(r->damping_std, 0.01);
  for (int i = 0; i < 2000; ++i) free.x.push_back(std::exp(-zeta * w * dt * i) * std::cos(wd * dt * i) + 1e-4 * random.normal());
  const auto q = resonance_near(free, 4.0);
  ASSERT_TRUE(q);
  EXPECT_NEAR(q->damping, zeta, 0.01);
  EXPECT_FALSE(resonance_near(driven, 9.0));
}

TEST(Resonances, AMassOnAContactRingsAtItsEigenfrequency) {
  // Undamped: m z'' = -k (z - z0), integrated by leapfrog; what the spectrum shows is sqrt(k/m)/2 pi within 5 %.
  const double k = 4.2e4, mass = 11.7, dt = 1e-3;
  recording::Run run;
  recording::Channel c{"normal_load", "N", {}};
  double z = 0.0, v = 0.0;
  for (int i = 0; i < 4000; ++i) {
    run.time.push_back(dt * i);
    c.values.push_back(k * z);
    v += dt * (9.81 - k * z / mass);
    z += dt * v;
  }
  run.channels = {c};
  LineOptions o;
  o.begin = 0.0;
  const ChannelSpectrum s = channel_spectrum(run, "normal_load", o);
  ASSERT_FALSE(s.lines.empty());
  EXPECT_NEAR(s.lines[0].frequency, contact_eigenfrequency(k, mass), 0.05 * contact_eigenfrequency(k, mass));
  EXPECT_TRUE(s.lines[0].sinusoidal);
}

TEST(Lines, RefuseWrongInput) {
  recording::Run run;
  run.time = {0, 1, 2};
  run.channels = {{"drawbar_pull", "N", {1, 2, 3}}};
  EXPECT_THROW(channel_spectrum(run, "sinkage"), InputError);
  EXPECT_TRUE(channel_spectrum(run, "drawbar_pull").lines.empty()) << "too short";
  LineOptions o;
  o.false_alarm = 2.0;
  EXPECT_THROW(channel_spectrum(run, "drawbar_pull", o), InputError);
}

}  // namespace
}  // namespace terrode::analysis
