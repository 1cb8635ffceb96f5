// Soil parameters from wheel runs: one set for drawbar pull, driving torque and sinkage over all slips and loads
// together, as Smith et al. Table 8.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "bekker/steady_wheel.h"
#include "calibration/estimate.h"
#include "core/progress.h"
#include "recording/recording.h"

namespace terrode::calibration {

inline constexpr std::array<const char*, 3> kWheelChannels = {"drawbar_pull", "driving_torque", "sinkage"};
inline constexpr std::array<const char*, 3> kWheelUnits = {"N", "N m", "m"};

// Steady values under one condition; replicates are averaged. Channels in the order of kWheelChannels.
struct WheelPoint {
  std::string id;                    // of its run, or of the first replicate
  bekker::Operating operating;
  int replicates = 1;
  std::array<std::optional<double>, 3> mean;   // N, N m, m
  std::array<double, 3> standard_error{};      // of the mean; 0 where nothing is known of it
};

struct WheelData {
  double radius = 0.0, width = 0.0;  // m
  std::vector<WheelPoint> points;
  std::vector<std::string> notes;    // runs that were left out, and why
};

// The steady values of a recording's runs. Their standard errors hold the scatter between replicates where there are
// any (pooled over conditions), else the error of each mean within its run. Runs that do not become steady are kept,
// with a note. Throws InputError when no run has a load and one of the three channels.
WheelData wheel_data(const recording::Recording& recording);

// Limits of a parameter and how it is fitted.
struct ParameterRange {
  double low = 0.0, high = 0.0;               // what the search may not leave
  double start_low = 0.0, start_high = 0.0;   // where starting points are drawn
};

// The parameters of the steady wheel in the order of Table 8.
inline constexpr std::array<const char*, 8> kWheelParameters = {"cohesion", "friction_angle", "shear_modulus", "k", "n", "a0", "a1", "theta_r"};

struct WheelFitOptions {
  // Parameters that are fitted; the others keep their values in `soil` and `angles`.
  std::vector<std::string> free = {"cohesion", "friction_angle", "shear_modulus", "k", "n", "a0", "a1"};
  bekker::Soil soil;                  // values of the rest; its plate_width is what k refers to
  bekker::ContactAngles angles;
  bool start_from_soil = false;       // soil and angles are one of the starting points
  std::vector<Fit> priors;            // soil tests: estimates that are identified and free count as measurements
  std::array<bool, 3> use = {true, true, true};
  // Deviation of the model in a channel that is taken as given; absent: found from the residuals.
  std::array<std::optional<double>, 3> discrepancy;
  int starts = 24;
  double confidence = 0.95;
  bool profiles = true;               // intervals from profiles, else from standard errors
  int threads = 1;
  unsigned long seed = 1;

  Problems validate() const;
};

// Range of a parameter; throws InputError for a name that is none of kWheelParameters.
ParameterRange parameter_range(const std::string& name);

struct WheelFit : Fit {
  struct Channel {
    std::string name, unit;
    int count = 0;
    double rmse = 0.0;            // of the fit
    double standard_error = 0.0;  // root mean square of the means' standard errors
    double discrepancy = 0.0;     // what the model misses beyond that, as a deviation
    double correlation = 0.0;     // of residuals at neighbouring slips
  };
  std::array<Channel, 3> channels;
  bekker::Soil soil;              // with the fitted values
  bekker::ContactAngles angles;
  std::vector<std::array<double, 3>> predicted;  // by point
  double chi_squared = 0.0;       // of the wheel data at the solution
  int starts = 0;                 // starting points from which a minimum was found
  int starts_at_best = 0;         // of them, those that led to the best one
  // Other minima that the data do not exclude (chi squared less than 6 above the best): values of the free parameters.
  std::vector<std::vector<double>> rivals;
  std::vector<std::string> free;
};

// Least squares over all points and channels with weights 1/(standard error^2 + discrepancy^2). The discrepancy of each
// channel, what the model misses, is found so that its residuals have the variance their degrees of freedom call for;
// it takes residuals of different points as independent, and a warning tells where they are not.
// Several starting points, spread over the ranges (a latin hypercube), each followed by Levenberg-Marquardt.
// Throws InputError for fewer values than parameters, RunError when no start led to a minimum.
WheelFit fit_wheel(const WheelData& data, const WheelFitOptions& options, const Progress& progress = {});

}  // namespace terrode::calibration
