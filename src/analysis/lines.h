// Spectral lines of runs: which there are, and what they are locked to.
//
// A line is a peak that stands out from a smooth background (red noise) with a controlled probability of a false alarm.
// The same line is looked for in other runs along four axes: time (a line fixed in Hz: rig resonance, mains), wheel turns
// (fixed order: grousers, eccentricity, gear), metres travelled (fixed per metre: bed), metres slipped, the integral of
// |r omega - v| (fixed per metre of slip: failure of the soil in blocks). The axis in which runs of different speed and
// slip share the line decides what it is locked to.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "analysis/spectrum.h"
#include "core/problem.h"
#include "recording/recording.h"

namespace terrode::analysis {

enum class Axis { time, wheel, travel, slip_travel };
inline constexpr std::size_t kAxes = 4;

// What a line is locked to, as `terrode oscillation --json` writes it.
enum class Lock { time, wheel, travel, slip_travel, undecided };
std::string lock_name(Lock lock);

struct LineOptions {
  double false_alarm = 0.01;             // probability that a channel of one run without lines shows one
  double nw = 3.0;                       // half bandwidth of the spectrum, in 1/length
  std::size_t tapers = 5;
  double lowest = 0.0;                   // Hz; 0: from the half bandwidth
  double highest = 0.0;                  // Hz; 0: up to 0.9 of half the sampling rate, or less where a filter has left nothing
  std::size_t max_lines = 12;            // of one channel of one run
  double smallest_share = 1e-3;          // of the variance: fainter peaks are what filters and rounding leave, not lines
  int trend = 1;                         // degree of the polynomial that is removed first
  std::optional<double> begin, end;      // s: the window; without it the steady part of the run
  double wheel_radius = 0.0;             // m; 0: no slip travel
  std::optional<int> grouser_count;      // lugs that are known: a line at this order of a single run is theirs

  Problems validate() const;
};

// One line of one channel in one run. Frequency in Hz; the other three axes are 0 where the velocity that they need is
// not known (order, per_metre) or nothing slips (per_slip_metre).
struct SpectralLine {
  double frequency = 0.0;
  double frequency_std = 0.0;    // Hz; Cramer-Rao for a sinusoid, a third of the bandwidth for a broader peak
  double order = 0.0;            // per wheel turn
  double per_metre = 0.0;        // per metre of travel
  double per_slip_metre = 0.0;   // per metre of slip travel
  double amplitude = 0.0;        // of the sinusoid; of a broader peak sqrt(2 variance in it)
  double phase = 0.0;            // rad, of cos(2 pi f (t - begin) + phase)
  double share_of_variance = 0.0;
  double excess = 0.0;           // density over background at the peak
  double false_alarm = 1.0;      // probability that noise shows such a peak anywhere in this channel
  double significance = 0.0;     // the same as deviations of a normal variable, one-sided
  bool sinusoidal = false;       // by the harmonic F-test at 1 %: narrower than the bandwidth
  int harmonic_of = -1;          // index of the line whose multiple this is; -1: none
  int harmonic = 1;              // which multiple
  Lock locked_to = Lock::undecided;
  double lock_evidence = 0.0;    // natural logarithm of the odds of this axis against the next best
  std::string driver;            // what this says in words: "grouser passing (24 per turn)"
};

// A channel of a run in the frequency domain.
struct ChannelSpectrum {
  std::string channel;
  double mean = 0.0, std = 0.0;        // over the window, trend included
  double begin = 0.0, end = 0.0;       // s, the window
  double rate = 0.0;                   // samples per s
  double interpolated = 0.0;           // share of samples in gaps
  Spectrum spectrum;                   // in Hz
  std::vector<double> background;      // of the same bins
  std::vector<double> residual;        // density of the series less its sinusoidal lines, same bins
  double lowest = 0.0, highest = 0.0;  // Hz: where lines are looked for
  std::vector<SpectralLine> lines;     // most significant first
  // Axis units in a second (1, turns, metres, metres slipped), means over the window; 0: not known.
  double axis_rate[kAxes] = {1.0, 0.0, 0.0, 0.0};
  // How much more a line at a frequency would be concentrated along another axis, where speeds vary within the run:
  // spectra resampled to that axis. Empty where speeds are even.
  std::map<Axis, Spectrum> resampled;
};

// The lines of one channel. Throws InputError where the channel is missing; a channel that is too short (32 samples) or
// constant has no lines.
ChannelSpectrum channel_spectrum(const recording::Run& run, const std::string& channel, const LineOptions& options = {});

// Red-noise background of a density: an autoregressive model fitted to the spectrum with its peaks cut off, times a
// running median of what is left. `samples` is the length of the series.
std::vector<double> red_noise_background(const Spectrum& spectrum, double step, std::size_t samples, double lowest, double highest);

// A line followed through runs.
struct LineTrack {
  std::string channel;
  Lock locked_to = Lock::undecided;
  double value = 0.0;               // coordinate on its axis: Hz, per turn, per metre, per metre slipped
  double value_std = 0.0;
  // Of slip_travel: rate = value (|r omega - v| + slip_offset r omega), for a rate that rises with slip but does not
  // start from zero.
  double slip_offset = 0.0;
  double evidence = 0.0;            // log odds against the next best axis
  double evidence_by_axis[kAxes] = {0, 0, 0, 0};
  struct Point {
    std::size_t run = 0;            // index into the spectra given
    int line = -1;                  // index of the line in it; -1: seen only where expected
    double frequency = 0.0, amplitude = 0.0;
  };
  std::vector<Point> points;
  // f = by_time + by_wheel r omega + by_slip |r omega - v| fitted to the points where runs differ enough.
  bool has_fit = false;
  double by_time = 0.0, by_wheel = 0.0, by_slip = 0.0;        // Hz, per m of rim travel, per m of slip
  double by_time_std = 0.0, by_wheel_std = 0.0, by_slip_std = 0.0;
  std::string driver;
};

// Follows the lines of one channel through runs and decides what each is locked to; sets locked_to, lock_evidence and
// driver of the lines. An axis wins with odds of 100 to 1 over every other that predicts different frequencies; with
// one run of even speed nothing can be decided, unless a known grouser count names the line.
std::vector<LineTrack> follow_lines(std::vector<ChannelSpectrum>& runs, const LineOptions& options = {});

// All channels of all runs at once: spectra[channel][run]. Runs without the channel have an empty spectrum.
struct Oscillation {
  std::vector<std::string> channels;
  std::map<std::string, std::vector<ChannelSpectrum>> spectra;
  std::map<std::string, std::vector<LineTrack>> tracks;
};
// `channels` empty: those with a meaning of their own that the runs have, velocities left out. `threads`: 0 all cores.
Oscillation analyse_oscillation(const std::vector<recording::Run>& runs, std::vector<std::string> channels,
                                const LineOptions& options, int threads = 1);

// How two channels move together at a line: of the run's window used by `of`.
Coherence line_coherence(const recording::Run& run, const ChannelSpectrum& of, const std::string& other, double frequency,
                         const LineOptions& options = {});

// Damping ratio of a resonance near a frequency, by the pole of an autoregressive model (least squares, order by AICc) of
// the series brought to about eight samples a period. Works for a response to noise and for free decay. `damping` of a steady sinusoid is
// near 0. Nothing where no pole lies within a tenth of the frequency.
struct Resonance {
  double frequency = 0.0;   // Hz, undamped
  double damping = 0.0;     // ratio to critical
  double damping_std = 0.0; // sqrt(damping/(2 pi f T)), for a response to noise over the length T
};
std::optional<Resonance> resonance_near(const EvenSeries& series, double frequency);

// Natural frequency [Hz] of a mass [kg] on a contact of stiffness [N/m].
double contact_eigenfrequency(double stiffness, double mass);

}  // namespace terrode::analysis
