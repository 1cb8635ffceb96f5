// The paper's soil tests on particles: direct shear, pressure-sinkage, and an angle of repose. Results come as the same
// types as measured tests, so that one fit (Eqs. 24 and 25, calibration/soil_tests.h) serves both.
#pragma once

#include "dem/bed.h"
#include "recording/recording.h"

namespace terrode::dem {

// Mean and deviation of curves that share their abscissa (Figs. 7 and 9).
struct CurveScatter {
  std::vector<double> at, mean, deviation;
};

// A box of soil, its upper half pushed along x over the lower one under a lid that is free to rise (section 3.3.1). The
// lid is a rigid body of spheres of the soil's material whose weight gives the normal stress; box walls are smooth.
// The shear force is what upper half and lid together feel along x.
struct DirectShearSettings {
  BedRecipe soil;                 // width, length, height: the box (default 60 x 60 x 60 mm); walls are set
  double normal_stress = 5330.0;  // Pa, at the lid
  double rate = 0.66e-3;          // m/s
  double travel = 6.6e-3;         // m
  double time_step = 0.0;         // s; 0: the suggested one
  double seating = 0.1;           // s for the lid to come to rest
  // A dead weight on soft grains bounces for long. A light lid pressed by a force with a dashpot does not, and loads the
  // soil alike once it moves slowly: mass of the lid [kg], 0: the dead weight of normal_stress; and the dashpot's share of
  // the normal force where the lid moves at `rate` [-] (soil that dilates lifts it at a tenth of the rate or so).
  double lid_mass = 0.0, lid_damping = 0.05;
  double samples = 66;            // along the travel; each is the mean since the one before
  int threads = 1;
  std::string cache;  // folder of beds; empty: default_cache_folder()
  DirectShearSettings();
  Problems validate() const;
};
recording::DirectShearTest direct_shear(const DirectShearSettings& settings, const Progress& progress = {});

// A flat plate pressed into a periodic bin of tiled prisms at a constant rate (section 3.3.2). Sinkage counts from the
// first contact.
struct PressureSinkageSettings {
  BedRecipe prism;                                 // tiled tiles_x x tiles_y times
  int tiles_x = 3, tiles_y = 8;                    // of 50 x 50 mm: the paper's bin of 150 x 400 mm
  double plate_width = 0.05, plate_length = 0.13;  // m, along x and y
  double plate_thickness = 0.01;                   // m
  double rate = 0.01;                              // m/s
  double sinkage = 0.02;                           // m
  double time_step = 0.0;                          // s; 0: the suggested one
  double samples = 40;
  bool rough_plate = false;  // the soil's own friction instead of the smooth wall's
  int threads = 1;
  std::string cache;
  Problems validate() const;
};
recording::PressureSinkageTest pressure_sinkage(const PressureSinkageSettings& settings, const Progress& progress = {});

// A bed on rough ground, periodic along y, held by a wall at either end; one wall is taken away, and the slope that
// stays is measured: the line through the tops of columns one grain wide, between its upper and lower fifth.
struct ReposeSettings {
  BedRecipe soil;  // width: along the slope
  double time_step = 0.0;
  int threads = 1;
  std::string cache;
  Problems validate() const;
};
struct Repose {
  double angle = 0.0;             // rad
  std::vector<double> x, height;  // m, the profile
};
Repose angle_of_repose(const ReposeSettings& settings, const Progress& progress = {});

// Curves of repeated tests (other seeds) on the abscissa of the first.
CurveScatter scatter_of(const std::vector<std::vector<double>>& at, const std::vector<std::vector<double>>& values);

}  // namespace terrode::dem
