// Finds where a recording and the steady wheel part, names the physics left out, and shows what switching it on gains on
// conditions kept out of the fit. docs/diagnosis.md says what each step assumes.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "diagnosis/model.h"
#include "diagnosis/ripple.h"
#include "recording/recording.h"

namespace terrode::diagnosis {

struct Options {
  unsigned long seed = 1;
  int threads = 0;
  // Effects that are not to be considered: what the tool says when the cause is not in its list.
  std::vector<std::string> without;
  // Of the same soil and conditions, its bed, wheel and rig known: what is looked for is what differs from it (diagnosis/reference.h).
  const recording::Recording* reference = nullptr;
  Progress progress;
};

// Where a channel departs from the plain model after its parameters were refitted.
struct Located {
  std::string channel, unit;
  std::map<std::string, std::pair<double, double>> where;  // slip, normal_load, angular_velocity, pass, position, order, ...
  double size = 0.0;
  double significance = 0.0;  // deviations of noise
};

struct Estimate {
  double value = 0.0, deviation = 0.0;
  std::string unit;
};

struct Finding {
  std::vector<std::string> ids;  // most probable first; several: the recording cannot tell them apart
  double probability = 0.0;      // that the cause is one of `ids`
  std::map<std::string, double> share;  // of that probability, by id
  std::string cls;
  std::map<std::string, Estimate> parameters;  // of the first id
  std::string equation, source, statement;
  std::array<double, kChannels> change{};  // root mean square change over the conditions, by channel
};

struct ParameterChange {
  std::string name, unit;
  double believed = 0.0, refitted = 0.0, fitted = 0.0, deviation = 0.0;  // refitted: without the effects
};

struct ChannelFit {
  double rmse_before = 0, rmse_after = 0, heldout_before = 0, heldout_after = 0, noise_floor = 0;
  bool present = false;
};

struct Experiment {
  std::string design;
  std::vector<std::vector<std::string>> separates;
};

// One explanation that was tried.
struct Candidate {
  std::string label;
  double log_evidence = 0.0;  // over the plain model, nats, tempered
  double chi2_gain = 0.0;
  std::map<std::string, std::map<std::string, double>> effects;
  // What its odds were weighed from: misfit of each channel and of the soil tests, of priors, and Laplace's price.
  std::array<double, kChannels + 1> misfit{};
  double penalty = 0.0, occam = 0.0;
};

// A further effect that was considered on top of an explanation.
struct Growth {
  std::string label;       // with it
  double support = 0.0;    // what it brings, nats
  std::array<double, kChannels> before{}, after{};  // misfit of runs' means over their scatter
};

// A held-out block: everything at one load, speed, pass or stretch of slips.
struct Block {
  std::string name;
  int runs = 0;
  std::array<double, kChannels> before{}, after{};  // root mean square error of runs' means
};

// Both models as they were fitted without one block, so that a simulation in time can be held against that block.
struct Replay {
  std::string held_out;  // the block's name; empty: none
  std::vector<std::size_t> runs;  // of Diagnosis::runs
  bekker::Soil soil_before, soil_after;
  bekker::ContactAngles angles_before, angles_after;
  std::map<std::string, std::map<std::string, double>> effects;  // of the model after
};

// Means of one run beside both models, for tables and pictures.
struct RunComparison {
  std::string id;
  Condition condition;
  std::array<double, kChannels> observed{}, before{}, after{}, deviation{};
  std::array<bool, kChannels> has{};
};

struct Diagnosis {
  std::string title, verdict, statement;
  std::vector<Located> located;
  std::vector<Finding> effects;
  std::vector<ParameterChange> parameters;
  bool unexplained = false;
  double unexplained_fraction = 0.0;
  std::string unexplained_form;  // empty: none
  std::array<ChannelFit, kChannels> fit;
  std::vector<Experiment> next_experiments;

  // Beyond the contract, for the report.
  std::vector<Candidate> candidates;
  std::vector<Growth> growth;
  std::vector<Block> blocks;
  Replay replay;
  std::vector<RunComparison> runs;
  std::vector<RippleLine> ripples;
  std::map<std::string, Estimate> detectable;  // smallest strength that would have been seen, by "id.parameter"
  std::string prediction;                      // one made without the data it is about, and its outcome
  bool prediction_held = false;
  std::vector<std::string> remarks;
  double false_alarm_rate = 0.01;  // family-wise, of naming anything on a recording that lacks nothing
  double gate = 0.0, gate_statistic = 0.0;
  Noise noise;
  // What corrected.yaml holds.
  bekker::WheelSize wheel;
  bekker::Soil soil;
  bekker::ContactAngles angles;
  std::map<std::string, std::map<std::string, double>> corrected_effects;
  std::vector<Condition> conditions;
};

// Throws InputError where the recording holds nothing to diagnose.
Diagnosis diagnose(const recording::Recording& recording, const Options& options = {});

}  // namespace terrode::diagnosis
