// The report page and the figure of a slip sweep, from its results and what was measured.
#pragma once

#include <string>
#include <vector>

#include "cli/sweep_result.h"
#include "report/sweep_page.h"

namespace terrode::cli {

// The measured runs of a scenario as points: recorded means, or means of time series over their steady part;
// repetitions of a condition as one point with their scatter.
std::vector<SweepPoint> measured_points(const scenario::Scenario& scenario);

report::SweepReport sweep_report(const scenario::Scenario& scenario, const std::vector<MethodResult>& results,
                                 const std::vector<SweepPoint>& measured, const std::string& command);

}  // namespace terrode::cli
