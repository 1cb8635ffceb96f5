// Two series or two campaigns side by side: what differs, by how much, and against which scatter.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "recording/recording.h"

namespace terrode::analysis {

// Objective rating of two curves in the manner of ISO/TS 18571: parts and total from 0 (nothing in common) to 1.
// A headline for people; it knows no noise and decides nothing.
struct CurveRating {
  double corridor = 0.0;   // how far within 5 % (all) to 50 % (none) of the reference's largest absolute value
  double phase = 0.0;      // shift of best correlation, none at 20 % of the length
  double magnitude = 0.0;  // after the shift, with time warped within 10 %: relative distance, none at 50 %
  double slope = 0.0;      // of the smoothed derivatives after the shift: relative distance, none at 200 %
  double total = 0.0;      // 0.4 corridor + 0.2 each of the others
  double shift = 0.0;      // s by which the result has to be moved later to match
};

// Rates `result` against `reference`, both sampled evenly at the same times. Throws InputError for fewer than 10 samples
// or different lengths.
CurveRating rate_curves(std::span<const double> reference, std::span<const double> result, double step);

// Area between the distribution functions of two samples (Ferson, Oberkampf & Ginzburg 2008), in the values' unit.
double area_metric(std::vector<double> a, std::vector<double> b);

// One channel of one pair of runs.
struct ChannelComparison {
  std::string channel, unit;
  double recorded_mean = 0.0, computed_mean = 0.0;
  double error = 0.0;                          // computed less recorded
  double error_sem = 0.0;                      // from both means' standard errors and the replicates' scatter; 0: not known
  double recorded_drift = 0.0, computed_drift = 0.0;   // per s
  double recorded_std = 0.0, computed_std = 0.0;       // within the run: size of the fluctuation
  std::optional<double> recorded_line, computed_line;  // Hz: strongest line of either, where there is one
  std::optional<double> spectral_distance;     // rms of ln(density ratio) over the common band, 0: the same content
  double area = 0.0;                           // area metric of the samples
  double own_area = 0.0;                       // the same between the recording's replicates, else between its halves
  std::optional<CurveRating> rating;           // of time series
};

struct RunComparison {
  std::string recorded_run, computed_run;      // ids; computed "a..b" where two were interpolated
  recording::Condition condition;
  bool interpolated = false;                   // the result was interpolated in slip between two points
  std::map<std::string, ChannelComparison> channels;
};

// A channel over all pairs.
struct ChannelSummary {
  std::size_t pairs = 0;
  double bias = 0.0, rmse = 0.0;               // of the means
  double relative_rmse = 0.0;                  // rmse over the larger of the recorded means' range and size
  double largest_error = 0.0, largest_at_slip = 0.0;
  double scatter = 0.0;                        // pooled deviation between the recording's replicates; 0 without any
  double area = 0.0;                           // area metric between recorded and computed means, pairs as samples
  double rating = 0.0;                         // mean total rating of the time series, 0 without any
  std::string unit;
};

struct Comparison {
  std::vector<RunComparison> runs;
  std::map<std::string, ChannelSummary> summary;
  std::vector<std::string> unmatched;          // runs of the recording that the result has no condition for
};

struct CompareOptions {
  std::vector<std::string> channels;           // empty: drawbar pull, torque, sinkage, load where both have them
  double slip_tolerance = 0.005;               // slips within it are the same
  double condition_tolerance = 0.03;           // of load and wheel rate, relative
};

// Pairs the runs of a recording with those of a result by slip, load, wheel rate and pass, and compares them channel by
// channel. Where the result has no run at a slip but has some on both sides at the same load and rate, its means are
// interpolated linearly. A condition that only one side states counts as the same.
Comparison compare(const recording::Recording& result, const recording::Recording& reference, const CompareOptions& options = {});

}  // namespace terrode::analysis
