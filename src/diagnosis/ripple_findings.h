// Causes of lines in the series.
#pragma once

#include <vector>

#include "diagnosis/diagnose.h"

namespace terrode::diagnosis {

// One place for each finding.
struct RippleFindings {
  std::vector<Finding> findings;
  std::vector<Located> places;
};

// Lines in the series that have a cause of their own, by what they are locked to: lugs and a wheel out of round to the wheel,
// soil that fails in blocks to the slip path, a carriage or a bed without damping to time, waves and nodes to the travel.
RippleFindings findings_of(const RippleSearch& ripples, const Campaign& campaign, const Options& options);

}  // namespace terrode::diagnosis
