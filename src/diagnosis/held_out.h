// Explanations on runs that took no part in their fits: whole loads, speeds, passes and stretches of slip.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/hypotheses.h"

namespace terrode::diagnosis {

// Blocks that are held out whole, by name: for every run whether it belongs to the block. Loads, speeds and passes away from
// the commonest, and stretches of slip.
std::vector<std::pair<std::string, std::vector<char>>> blocks_of(const Campaign& campaign);

// How a model that was fitted without a block predicts the means of that block's runs.
struct Fold {
  bool solved = false;
  Fit fit;
  double chi2 = 0;  // of their whole series, where it is asked for
  std::array<double, kChannels> squares{};
  std::array<int, kChannels> count{};
};

// Fits `h` from the base of `from` to all runs but the held ones.
Fold fold(const Model& model, const Tried& from, const Hypothesis& h, const std::vector<char>& held, int iterations, bool of_series = false);

// Two explanations on blocks that were left out of their fits.
struct HeldOut {
  std::array<std::array<double, kChannels>, 2> error{};  // of the runs' means, root mean square by channel
  double series = 0;                                     // chi-square of the runs' whole series that the second gains, where asked for
};

// Where there are enough blocks the one that speaks loudest for either is left out: no name may hang on one stretch of slip.
HeldOut held_out(const Model& model, const Tried& a, const Tried& b, bool of_series, int threads);

}  // namespace terrode::diagnosis
