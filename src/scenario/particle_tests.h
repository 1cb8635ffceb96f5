// Soil tests on particles as a file: direct shear, pressure-sinkage and angle of repose, over loads and seeds.
//
//   particle_tests:
//     repeats: 5
//     direct_shear: {normal_stress: [2080 Pa, 5330 Pa, 17830 Pa]}
//     pressure_sinkage: {}
//
// What is not given is as in Smith et al. (2014, section 3.3, Tables 2 to 4).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dem/soil_tests.h"
#include "scenario/table.h"

namespace terrode::scenario {

// Grains and contact law; names and meanings as in dem/material.h and dem/bed.h.
struct TestGrains {
  double smallest = 2.5e-3, largest = 10e-3;  // m, diameters
  std::string distribution = "uniform", by = "number";
  std::vector<double> diameters, shares;      // m and any positive numbers; given: instead of smallest to largest
  double density = 3090.0, bulk_density = 1600.0;  // kg/m3
  double young_modulus = 7.0e7;               // Pa
  double poisson_ratio = 0.35;
  std::string normal = "hertz", tangential = "mindlin", rolling = "epsd", cohesion = "none";
  double restitution = 0.4, friction = 0.86, rolling_friction = 1.0;
  std::optional<double> settling_friction, settling_rolling_friction;
  double rolling_rate = 0.0;                  // s2/m2
  double rolling_damping = 1.0;
  double cohesion_energy_density = 0.0;       // Pa
  bool printed_shear_modulus = false;
  double wall_restitution = 0.06, wall_friction = 0.0;
};

struct DirectShearSpec {
  double width = 0.06, length = 0.06, height = 0.06;       // m, of the box
  std::vector<double> normal_stress = {2080, 5330, 17830};  // Pa
  std::vector<double> rate = {0.66e-3};                     // m/s
  double travel = 6.6e-3;                                   // m
  double seating = 0.1;                                     // s
  double lid_mass = 0.0;                                    // kg; 0: the dead weight of normal_stress
  double lid_damping = 0.05;                                // dem/soil_tests.h
  int samples = 66;
};

struct PressureSinkageSpec {
  double prism = 0.05, height = 0.16;  // m
  int tiles_x = 3, tiles_y = 8;
  double plate_width = 0.05, plate_length = 0.13, plate_thickness = 0.01;  // m
  std::vector<double> rate = {0.01};   // m/s
  double sinkage = 0.02;               // m
  int samples = 40;
  bool rough_plate = false;
};

struct ReposeSpec {
  double width = 0.12, length = 0.04, height = 0.06;  // m, of the heap before the wall is taken away
};

struct ParticleTests {
  std::string file, text, title;
  int seed = 1;
  int repeats = 1;                // tests of every condition, with seeds seed, seed + 1, ...
  double gravity = 9.81;          // m/s2
  double time_step = 0.0;         // s; 0: suggested from the Rayleigh time
  double settling_drag = 0.05;    // N s/m
  TestGrains grains;
  std::optional<DirectShearSpec> direct_shear;
  std::optional<PressureSinkageSpec> pressure_sinkage;
  std::optional<ReposeSpec> angle_of_repose;
};

// True for a YAML file with the key `particle_tests`.
bool is_particle_tests(const std::string& path);
// Throw InputError with every problem.
ParticleTests load_particle_tests(const std::string& path);
ParticleTests parse_particle_tests(const std::string& text, const std::string& file);
// Complete in itself; parse_particle_tests reads it back.
std::string to_yaml(const ParticleTests& tests);
// JSON Schema of such a file, for editors.
std::string particle_tests_schema();

// One test that was run.
struct ParticleTest {
  std::string kind;           // direct_shear, pressure_sinkage, angle_of_repose
  double normal_stress = 0.0; // Pa, of direct_shear
  double rate = 0.0;          // m/s, of direct_shear and pressure_sinkage
  int seed = 1;
  std::vector<double> x, y;   // displacement, sinkage or distance [m]; stress or pressure [Pa], or height [m]
  double angle = 0.0;         // rad, of angle_of_repose
  double cpu_seconds = 0.0;
  std::string error;          // why it has no result; empty: it has

  // The same test of the same file.
  bool same_as(const ParticleTest& other) const;
};

// The tests a file asks for, not yet run: each condition and seed once.
std::vector<ParticleTest> planned(const ParticleTests& tests);

// Runs the planned tests that are not in `known`, up to `threads` at a time, each on one thread; results do not depend
// on `threads`. Beds come from the cache (dem/bed.h). `done` is called after each test, from any thread but one at a
// time, with all results so far. A test that fails says so in `error`. Throws Interrupted when asked to stop; what had
// ended was given to `done`.
std::vector<ParticleTest> run_particle_tests(const ParticleTests& tests, const std::vector<ParticleTest>& known, int threads,
                                             const Progress& progress,
                                             const std::function<void(const std::vector<ParticleTest>&)>& done = {});

// The tests with results as a laboratory's, for fits: repeats are tests of their own.
recording::Recording as_recording(const ParticleTests& tests, const std::vector<ParticleTest>& results);

// Mean and deviation over the seeds of one condition.
struct ParticleCurve {
  std::string kind;
  double normal_stress = 0.0, rate = 0.0;
  int repeats = 0;
  dem::CurveScatter curve;
};
std::vector<ParticleCurve> mean_curves(const std::vector<ParticleTest>& results);

}  // namespace terrode::scenario
