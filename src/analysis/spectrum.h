// Spectra of evenly sampled series: multitaper and Welch with confidence, coherence, time-frequency; Lomb-Scargle for
// uneven times. Densities are one-sided: their integral from 0 to half the sampling rate is the variance.
#pragma once

#include <complex>
#include <cstddef>
#include <numbers>
#include <span>
#include <string>
#include <vector>

namespace terrode::analysis {

inline constexpr double kTwoPi = 2.0 * std::numbers::pi;

// Even samples of a series: x_i at t0 + i step. The axis may be time [s], wheel turns, or metres.
struct EvenSeries {
  double t0 = 0.0, step = 1.0;
  std::vector<double> x;
  double interpolated = 0.0;  // share of samples that lie in a gap

  double length() const { return step * static_cast<double>(x.size()); }
};

// Brings a series to even samples at its median spacing by linear interpolation; missing values (NaN) are bridged.
// Where a gap is longer than a tenth of the series, the longest piece without such a gap is taken.
EvenSeries even_series(std::span<const double> t, std::span<const double> x);

// Subtracts the least-squares polynomial of degree 0, 1 or 2.
void remove_trend(std::vector<double>& x, int degree);

// Discrete prolate spheroidal sequences (Slepian 1978) of time-bandwidth product nw, the k most concentrated, each with
// unit energy; by the tridiagonal matrix that commutes with the concentration problem.
struct Tapers {
  std::vector<std::vector<double>> h;
  std::vector<double> concentration;  // share of energy within +-nw/n
};
Tapers dpss(std::size_t n, double nw, std::size_t k);

struct MultitaperOptions {
  double nw = 3.0;           // half bandwidth W = nw / length
  std::size_t tapers = 5;    // at most 2 nw - 1
  std::size_t padding = 4;   // frequencies are this much finer than 1/length, at least
};

struct Spectrum {
  std::vector<double> frequency;           // cycles per unit of the axis: Hz, per turn, per metre
  std::vector<double> density;             // unit^2 per frequency
  std::vector<double> degrees_of_freedom;  // of the density: it scatters as chi^2/dof
  std::vector<double> f_statistic;         // Thomson's F for a sinusoid, 2 and 2K - 2 degrees of freedom; multitaper only
  std::vector<std::complex<double>> line;  // complex amplitude of that sinusoid; its modulus is the amplitude
  double half_bandwidth = 0.0;
  std::size_t tapers = 0;

  // Two-sided confidence limits of the density at bin i, as factors on it.
  std::pair<double, double> confidence(std::size_t i, double probability = 0.95) const;
};

// Multitaper spectrum with adaptive weights and the harmonic F-test (Thomson 1982). The mean of x should be removed.
Spectrum multitaper(const EvenSeries& series, const MultitaperOptions& options = {});

// Welch's averaged periodogram: Hann windows, half overlapping (Welch 1967).
Spectrum welch(const EvenSeries& series, std::size_t segments);

// Lomb-Scargle power of uneven samples at given frequencies, normalised so that noise gives exponentially distributed
// values of mean 1 (Scargle 1982).
std::vector<double> lomb_scargle(std::span<const double> t, std::span<const double> x, std::span<const double> frequency);

// Cross spectrum of two series sampled together, at one frequency.
struct Coherence {
  double coherence = 0.0;    // squared, 0 to 1
  double phase = 0.0;        // rad; positive: the second leads the first
  double gain = 0.0;         // amplitude of the second over that of the first
  double p = 1.0;            // probability of such a coherence between unrelated series
};
Coherence coherence_at(const EvenSeries& first, const EvenSeries& second, double frequency, const MultitaperOptions& options = {});

// Density by time and frequency: multitaper spectra of windows that slide by a quarter of their length.
struct TimeFrequency {
  std::vector<double> time, frequency;  // centres
  std::vector<double> density;          // frequency by frequency: density[f * time.size() + t]
};
TimeFrequency time_frequency(const EvenSeries& series, double window, double highest_frequency);

// Least-squares sinusoid of a known frequency with a free mean: x ~ mean + amplitude cos(2 pi f t + phase).
struct Sinusoid {
  double frequency = 0.0, amplitude = 0.0, phase = 0.0;
  double explained = 0.0;  // share of the sum of squares about the mean
};
Sinusoid fit_sinusoid(const EvenSeries& series, double frequency);

// The same with the frequency of best fit in [low, high].
Sinusoid refine_sinusoid(const EvenSeries& series, double low, double high);

}  // namespace terrode::analysis
