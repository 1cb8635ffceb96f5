// Lines in the runs' series and what they are locked to: the wheel's turns, the slip path, time or travel. One law for
// all runs is looked for, so that a line too faint for any one run shows.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/campaign.h"

namespace terrode::diagnosis {

// Wheels with more lugs than this are not built: lines of a higher order are locked to something else.
inline constexpr int kMostLugs = 60;

enum class Lock { wheel, slip_path, time, travel };
const char* lock_name(Lock lock);

// A line that all runs share. Its frequency in a run of slip s, rim speed omega r and travel speed v:
//   wheel      order omega/(2 pi)
//   slip_path  omega r (q + (1 - q)|s|)/wavelength
//   time       frequency
//   travel     v/wavelength
struct RippleLine {
  Lock lock = Lock::time;
  // Of its lock, and of the alternatives where they have one of their own.
  double order = 0.0;       // per turn
  double wavelength = 0.0;  // m
  double share = 0.0;       // q
  double frequency = 0.0;   // Hz
  double score = 0.0;       // mean over runs of power over the local background; about 2.5 without a line
  double deviations = 0.0;  // how many robust deviations the score stands above those of all other laws of its kind
  std::array<double, kChannels> amplitude{};  // median over runs, N, N m, m
  std::array<double, kChannels> channel_score{};
  double relative = 0.0;    // median over runs of the pull's amplitude over the rim force T/r
  std::vector<Lock> alternatives;  // other locks that these runs cannot tell from this one
};

struct RippleSearch {
  std::vector<RippleLine> lines;  // significant ones, strongest first; at most one of each kind
  int runs = 0;                   // that took part
  double roughness = 0.0;         // median over them of the pull's deviation within a run over the rim force T/r; 0: no torque
};

// Searches all runs with at least 64 samples. Deterministic.
RippleSearch find_ripples(const Campaign& campaign, double run_in_length);

// The law of `line` as another campaign shows it, significant or not: amplitudes, scores, `relative`; all 0 where its runs are too short.
RippleLine same_law(const RippleLine& line, const Campaign& campaign, double run_in_length);

}  // namespace terrode::diagnosis
