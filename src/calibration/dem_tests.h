// Soil tests as a search for grain parameters sees them: measured curves on even grids with their scatter, and the
// same tests on beds of particles.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dem/particle_ground.h"
#include "dem/soil_tests.h"
#include "recording/recording.h"

namespace terrode::calibration {

// A grain parameter that a search may free.
struct GrainParameter {
  std::string name, unit;
  bool log = false;               // searched in its logarithm
  double low = 0.0, high = 0.0;   // range of the search unless another is given
  double assumed = 0.0;           // while it is not free; 0 for grain_size: from the bed
  double least = 0.0, most = 0.0; // what may be given at all
  std::string text;

  double to_unit(double value) const;   // the range on [0, 1]
  double from_unit(double share) const;
};

// young_modulus [Pa], friction, rolling_friction, restitution, grain_size (mean diameter) [m], grain_spread (largest over
// smallest diameter), in this order.
const std::vector<GrainParameter>& grain_parameters();
// Throws InputError for another name.
const GrainParameter& grain_parameter(const std::string& name);

using GrainValues = std::map<std::string, double>;

// One condition: every test of the recording at this normal stress, or with this plate.
struct TestTarget {
  std::string test;                 // "direct_shear" or "pressure_sinkage"
  double normal_stress = 0.0;       // Pa
  double plate_width = 0.0, plate_length = 0.0;  // m, of the rectangle that is simulated
  std::vector<double> at;           // m, even displacements
  std::vector<double> measured;     // Pa, mean over the repeats
  int repeats = 0;
  double scale = 0.0;               // Pa, root mean square of `measured`
  // Deviation of the mean over the repeats: in level, and in tilt along the curve, relative to the stress.
  double level_deviation = 0.0, tilt_deviation = 0.0;
  double freedom = 0.0;             // degrees of freedom in which the two are known

  std::string name() const;         // "shear at 5330 Pa", "plate of 0.05 m"
};

struct TargetOptions {
  int points = 12;                        // of each curve
  double longest_shear = 1e9, deepest = 1e9;  // m: leave out what lies beyond
  // Assumed deviation between repeats and for how many degrees of freedom it counts beside those seen (as soil_tests.h).
  double level_repeatability = 0.05, tilt_repeatability = 0.05, repeatability_weight = 2.0;
};

// The tests of a recording by condition; normal stresses and plates within 2 percent are one. A round plate becomes the
// square of its area (told in `notes`). Throws InputError without a test, or where one cannot be used.
std::vector<TestTarget> test_targets(const recording::Recording& recording, const TargetOptions& options, std::vector<std::string>& notes);

// Covariance of all targets' measured values, each divided by its scale and by the square root of their number, so that
// the sum of squared differences of two such vectors is the sum over the tests of the relative mean square.
Eigen::MatrixXd target_covariance(const std::vector<TestTarget>& targets);
// The measured values in that form.
Eigen::VectorXd target_vector(const std::vector<TestTarget>& targets);
// Curves (Pa, one for each target) in that form.
Eigen::VectorXd target_vector(const std::vector<TestTarget>& targets, const std::vector<std::vector<double>>& curves);
// First entry and length of the entries of one of the two tests.
std::pair<Eigen::Index, Eigen::Index> test_block(const std::vector<TestTarget>& targets, const std::string& test);

// How coarse the simulated tests are, and what is the same for all evaluations.
struct DemTestSettings {
  double grains_across = 5.0;       // mean grain diameters across the narrowest plate (0.83 of the shear box)
  double box = 0.0;                 // m, side of the shear box; 0: 1.2 widths of the narrowest plate, else 60 mm
  double bulk_density = 1600.0;     // kg/m3
  std::string rolling = "epsd2";
  // Rates of the simulated tests [m/s]; 0: 0.2 and 0.4 of sqrt(g d), slow enough for the stress not to depend on them.
  double shear_rate = 0.0, plate_rate = 0.0;
  double gravity = 9.81;            // m/s2
  double seating = 0.1;            // s for the lid to come to rest
  int beds = 1;                     // of different seeds, whose curves are averaged
  std::string cache;                // folder of beds
  int threads = 1;

  Problems validate() const;
};

// The simulated test of a target on beds of this recipe, whose extent is set: a box of side `box`, and a bin of three
// plate widths by a length and two widths, 1.6 widths or 3.2 sinkages deep.
dem::DirectShearSettings shear_settings(const TestTarget& target, const dem::BedRecipe& recipe, double box, const DemTestSettings& settings);
dem::PressureSinkageSettings plate_settings(const TestTarget& target, const dem::BedRecipe& recipe, const DemTestSettings& settings);

// The grains and laws of a particle ground as a recipe for the beds of soil tests: its diameters as they are in its
// prism, its bulk density. Walls and floor of the tests are smooth, whatever the ground stands on.
dem::BedRecipe recipe_of_ground(const dem::DemTerrainParams& ground, std::uint64_t seed);

// Runs every target's test on a bed of this seed (or means over several): stress [Pa] at the targets' displacements. Throws RunError where a bed
// does not come to rest.
std::vector<std::vector<double>> simulate_tests(const std::vector<TestTarget>& targets, const DemTestSettings& settings,
                                                const GrainValues& values, std::uint64_t seed, const Progress& progress = {});

}  // namespace terrode::calibration
