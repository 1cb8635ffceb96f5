// Where a run becomes steady, its mean with an honest error, and whether it still drifts.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/problem.h"
#include "recording/recording.h"

namespace terrode::analysis {

struct SteadyOptions {
  double max_discard = 0.5;            // at most this share of the run is taken for its beginning
  double drift_level = 0.01;           // a trend with a smaller p-value counts as a drift
  double drift_tolerance = 0.05;       // a drift over the window below this share of the signal's size is let pass
  std::optional<double> period;        // s: the mean is taken over whole periods of this length, the last ones
  std::optional<double> begin, end;    // s: fixes the window instead of finding its beginning

  Problems validate() const;
};

// A channel over its steady window. Times in s, values in the channel's unit.
struct SteadyState {
  bool reached = false;
  std::string reason;              // why not: "drifts", "too short", "no samples"
  double begin_time = 0.0, end_time = 0.0;
  std::size_t begin = 0, end = 0;  // samples [begin, end) of the run
  std::size_t samples = 0;         // of them, those that are no gaps
  double mean = 0.0;
  double std = 0.0;                // deviation of single samples
  double sem = 0.0;                // standard error of the mean, autocorrelation counted
  double effective_samples = 0.0;  // (std/sem)^2
  double correlation_time = 0.0;   // s: window length / effective samples
  double drift = 0.0;              // per s, by least squares
  double drift_sem = 0.0;          // its standard error, autocorrelation counted
  double drift_p = 1.0;            // probability of such a drift in a stationary series
  std::size_t periods = 0;         // whole periods averaged over; 0 where none was asked for
};

// Finds the steady part of a series and describes it. Missing samples (NaN) are left out; times need not be even.
//
// Beginning: MSER (White 1997, with batches of 5 samples or a 200th of the run, whichever is longer): the cut d that
// minimises sum_(i>d) (Y_i - mean)^2 / (n - d)^2 over the batch means Y, d at most max_discard n.
// Reached: the least-squares slope of the rest does not differ from zero at drift_level, by a t-test whose variance is
// 12 S0/T^3 with S0 the spectral density at frequency zero; or what it drifts over the window is less than
// drift_tolerance of the larger of |mean| and the range that the whole run passed through.
// Error of the mean: sem^2 = S0/T. S0 is the larger of that of an autoregressive model of the batch means (Heidelberger &
// Welch 1981) and that of the scatter of 16 batches.
// Throws InputError where times and values differ in number or options are wrong.
SteadyState steady_state(std::span<const double> time, std::span<const double> values, const SteadyOptions& options = {});

// Where a run as a whole becomes steady [s]: the last beginning among drawbar pull, driving torque and sinkage.
double steady_begin(const recording::Run& run, const SteadyOptions& options = {});

// The steady state of each channel of a run over one common window: it begins where the last of drawbar pull, driving
// torque and sinkage has become steady. For a row of a table the recorded mean and deviation, reached = true, sem = 0.
std::map<std::string, SteadyState> steady_states(const recording::Run& run, const SteadyOptions& options = {});

// Runs of one condition (slip, load, velocities, pass; not the repeat), by index into the recording's runs.
struct Replicates {
  recording::Condition condition;
  std::vector<std::size_t> runs;
};
std::vector<Replicates> group_replicates(const std::vector<recording::Run>& runs);

// Scatter of the means of replicates in one channel.
struct ReplicateScatter {
  std::size_t count = 0;      // replicates that have the channel
  double mean = 0.0;          // of their means
  double between_std = 0.0;   // deviation between replicates (n - 1); 0 with one
  double within_sem = 0.0;    // root mean square of their own standard errors
  double sem = 0.0;           // standard error of `mean`: between_std/sqrt(n), of a single run within_sem
};
ReplicateScatter replicate_scatter(std::span<const SteadyState> means);

// The deviation between replicates pooled over groups, and its degrees of freedom (0 without any repeated condition).
struct PooledScatter {
  double std = 0.0;
  std::size_t degrees_of_freedom = 0;
};
PooledScatter pooled_scatter(std::span<const ReplicateScatter> groups);

}  // namespace terrode::analysis
