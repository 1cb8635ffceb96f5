// Spectra of processes whose spectra are known.
#include "analysis/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/problem.h"
#include "core/random.h"

namespace terrode::analysis {
namespace {

constexpr double kPi = std::numbers::pi;

EvenSeries white(std::size_t n, double step, std::uint64_t seed) {
  Random random(seed);
  EvenSeries s;
  s.step = step;
  s.x.resize(n);
  for (double& x : s.x) x = random.normal();
  return s;
}

double integral(const Spectrum& s) {
  double sum = 0.0;
  const double df = s.frequency[1] - s.frequency[0];
  for (std::size_t i = 0; i < s.density.size(); ++i) sum += s.density[i] * df;
  return sum;
}

TEST(Dpss, AreOrthonormalAndConcentrated) {
  const Tapers t = dpss(256, 4.0, 7);
  ASSERT_EQ(t.h.size(), 7u);
  for (std::size_t a = 0; a < 7; ++a)
    for (std::size_t b = 0; b < 7; ++b) {
      double dot = 0.0;
      for (std::size_t i = 0; i < 256; ++i) dot += t.h[a][i] * t.h[b][i];
      EXPECT_NEAR(dot, a == b ? 1.0 : 0.0, 1e-9) << a << " " << b;
    }
  // Eigenvalues of the concentration problem for NW = 4: nearly 1, then falling.
  EXPECT_GT(t.concentration[0], 1.0 - 1e-6);
  EXPECT_NEAR(t.concentration[5], 0.9938, 2e-3);
  EXPECT_NEAR(t.concentration[6], 0.9366, 2e-3);
  for (std::size_t k = 1; k < 7; ++k) EXPECT_LE(t.concentration[k], t.concentration[k - 1] + 1e-9);
  EXPECT_EQ(dpss(50000, 3.0, 5).h.size(), 5u);
  EXPECT_THROW(dpss(3, 3.0, 5), InputError);
}

TEST(Multitaper, OfWhiteNoiseIsFlatWithTheStatedScatter) {
  const EvenSeries s = white(4096, 0.01, 7);
  const Spectrum m = multitaper(s);
  EXPECT_NEAR(integral(m), 1.0, 0.1);
  const double level = 2.0 * s.step;
  double mean = 0.0;
  std::size_t inside = 0, count = 0;
  for (std::size_t i = 100; i + 100 < m.density.size(); ++i, ++count) {
    mean += m.density[i];
    const auto [lo, hi] = m.confidence(i);
    if (lo * m.density[i] < level && level < hi * m.density[i]) ++inside;
  }
  EXPECT_NEAR(mean / static_cast<double>(count), level, 0.1 * level);
  EXPECT_NEAR(static_cast<double>(inside) / static_cast<double>(count), 0.95, 0.03);
}

TEST(Multitaper, FindsAmplitudeFrequencyAndFOfASinusoid) {
  EvenSeries s = white(2000, 0.01, 8);
  for (std::size_t i = 0; i < s.x.size(); ++i) s.x[i] += 0.5 * std::cos(2 * kPi * 3.3 * s.step * static_cast<double>(i) + 0.7);
  const Spectrum m = multitaper(s);
  const auto at = static_cast<std::size_t>(std::max_element(m.f_statistic.begin(), m.f_statistic.end()) - m.f_statistic.begin());
  EXPECT_NEAR(m.frequency[at], 3.3, 0.02);
  EXPECT_GT(m.f_statistic[at], 20.0);
  EXPECT_NEAR(std::abs(m.line[at]), 0.5, 0.1);
  const Sinusoid f = refine_sinusoid(s, 3.0, 3.6);
  // Cramer-Rao: sqrt(24 sigma^2/(A^2 N^3))/(2 pi step) = 0.0017 Hz; three of them.
  EXPECT_NEAR(f.frequency, 3.3, 0.006);
  EXPECT_NEAR(f.amplitude, 0.5, 0.1);
  EXPECT_NEAR(f.phase, 0.7, 0.4);
}

TEST(Multitaper, KeepsAStrongLineFromLeaking) {
  EvenSeries s = white(2000, 0.01, 9);
  for (std::size_t i = 0; i < s.x.size(); ++i) s.x[i] = 1e-3 * s.x[i] + 100.0 * std::sin(2 * kPi * 5.0 * s.step * static_cast<double>(i));
  const Spectrum m = multitaper(s);
  for (std::size_t i = 0; i < m.frequency.size(); ++i)
    if (m.frequency[i] > 20.0 && m.frequency[i] < 49.0) { ASSERT_LT(m.density[i], 100.0 * 2.0 * s.step * 1e-6) << m.frequency[i]; }
}

TEST(Welch, AgreesWithTheVariance) {
  const Spectrum w = welch(white(4096, 0.01, 10), 15);
  EXPECT_NEAR(integral(w), 1.0, 0.1);
  EXPECT_GT(w.degrees_of_freedom[5], 25.0);
  EXPECT_LT(w.degrees_of_freedom[5], 30.0);
}

TEST(LombScargle, FindsALineInUnevenTimes) {
  Random random(11);
  std::vector<double> t, x, f;
  double now = 0.0;
  for (int i = 0; i < 400; ++i) {
    now += 0.02 + 0.1 * random.uniform();
    t.push_back(now);
    x.push_back(random.normal() + std::sin(2 * kPi * 6.0 * now));  // far above half the mean sampling rate of 14 Hz
  }
  for (int i = 1; i < 2000; ++i) f.push_back(0.005 * i);
  const auto p = lomb_scargle(t, x, f);
  const auto at = static_cast<std::size_t>(std::max_element(p.begin(), p.end()) - p.begin());
  EXPECT_NEAR(f[at], 6.0, 0.02);
  EXPECT_GT(p[at], 50.0);
}

TEST(CoherenceAt, KnowsLeadGainAndChance) {
  EvenSeries a = white(1000, 0.04, 12), b = white(1000, 0.04, 13);
  EXPECT_LT(coherence_at(a, b, 2.0).coherence, 0.8);
  EXPECT_GT(coherence_at(a, b, 2.0).p, 1e-3);
  for (std::size_t i = 0; i < a.x.size(); ++i) {
    const double w = 2 * kPi * 2.0 * a.step * static_cast<double>(i);
    a.x[i] += 3.0 * std::cos(w);
    b.x[i] += 1.5 * std::cos(w + 0.5 * kPi);
  }
  const Coherence c = coherence_at(a, b, 2.0);
  EXPECT_GT(c.coherence, 0.95);
  EXPECT_LT(c.p, 1e-4);
  EXPECT_NEAR(c.phase, 0.5 * kPi, 0.1) << "b leads";
  EXPECT_NEAR(c.gain, 0.5, 0.05);
}

TEST(TimeFrequencyPicture, ShowsAChirp) {
  EvenSeries s;
  s.step = 0.01;
  for (int i = 0; i < 4000; ++i) {
    const double t = s.step * i;
    s.x.push_back(std::sin(2 * kPi * (2.0 * t + 0.1 * t * t)));  // 2 Hz rising by 0.2 Hz a second
  }
  const TimeFrequency tf = time_frequency(s, 5.0, 20.0);
  for (const std::size_t k : {std::size_t{2}, tf.time.size() - 3}) {
    double best = 0.0, at = 0.0;
    for (std::size_t f = 0; f < tf.frequency.size(); ++f)
      if (tf.density[f * tf.time.size() + k] > best) {
        best = tf.density[f * tf.time.size() + k];
        at = tf.frequency[f];
      }
    EXPECT_NEAR(at, 2.0 + 0.2 * tf.time[k], 0.5) << "within the bandwidth of the window";
  }
}

TEST(EvenSeriesOf, BridgesJitterAndGaps) {
  Random random(14);
  std::vector<double> t, x;
  for (int i = 0; i < 1000; ++i) {
    if (i > 300 && i < 320) continue;
    t.push_back(0.01 * (i + 0.2 * (random.uniform() - 0.5)));
    x.push_back(i == 500 ? std::nan("") : std::sin(t.back()));
  }
  const EvenSeries s = even_series(t, x);
  EXPECT_NEAR(s.step, 0.01, 5e-4);
  EXPECT_NEAR(s.interpolated, 0.02, 0.005);
  for (std::size_t i = 0; i < s.x.size(); i += 37) EXPECT_NEAR(s.x[i], std::sin(s.t0 + s.step * static_cast<double>(i)), 6e-3);
  // A gap of half the series: the longer piece remains.
  std::vector<double> t2, x2;
  for (int i = 0; i < 300; ++i) {
    t2.push_back(i < 100 ? 0.01 * i : 0.01 * i + 3.0);
    x2.push_back(1.0);
  }
  const EvenSeries longer = even_series(t2, x2);
  EXPECT_NEAR(longer.t0, 4.0, 1e-9);
  EXPECT_EQ(longer.x.size(), 200u);
}

TEST(RemoveTrend, LeavesNoPolynomial) {
  std::vector<double> x;
  for (int i = 0; i < 100; ++i) x.push_back(3.0 - 0.2 * i + 0.01 * i * i);
  remove_trend(x, 2);
  for (const double v : x) EXPECT_NEAR(v, 0.0, 1e-9);
}

}  // namespace
}  // namespace terrode::analysis
