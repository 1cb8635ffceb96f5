// A sweep in a result file: one group for each method with a column for each quantity. Shared by the commands that
// write, resume and show sweeps.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "recording/result_file.h"
#include "scenario/sweep.h"

namespace terrode::cli {

using Json = nlohmann::ordered_json;

// The points of a method as columns and back. `drop_empty`: leave out columns without a single number.
recording::ResultTable to_table(const std::vector<scenario::SweepPoint>& points);
std::vector<scenario::SweepPoint> from_table(const recording::ResultTable& table);

// The document of `sweep --json` (docs of the command line).
Json sweep_json(const std::string& scenario_file, const std::string& slip_convention,
                const std::vector<scenario::MethodResult>& results);

// One row a method and slip, units in the header, '.' as decimal point, digits that read back to the same values.
std::string sweep_csv(const std::vector<scenario::MethodResult>& results);

// The table that a person sees.
std::string sweep_text(const std::vector<scenario::MethodResult>& results);

}  // namespace terrode::cli
