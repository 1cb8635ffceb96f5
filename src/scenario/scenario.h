// What is to be simulated: soil, wheel, rig, ground and the slips, as a YAML file describes them.
//
// A number alone is in SI units; text carries its unit. Soil and wheel may be files of their own, named by a path
// relative to the file that names them. Where a scenario is asked for a recording serves too: its wheel, believed soil
// and run conditions are then the scenario, its measurements what it is compared with.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bekker/slip.h"
#include "bekker/soil.h"
#include "core/problem.h"
#include "bekker/steady_wheel.h"
#include "recording/recording.h"
#include "scenario/reader.h"
#include "terrain/surface.h"
#include "wheel/wheel.h"

namespace terrode::scenario {

// The ways to compute a wheel on soil; `sweep --method` takes these names.
const std::vector<std::string>& method_names();

struct WheelSpec {
  double radius = 0.0;              // m, of the rim without lugs
  double width = 0.0;               // m
  std::optional<double> mass;       // kg
  std::string surface;
  double crown_radius = 0.0;        // m, of the rim's profile across the width; 0: flat
  int grouser_count = 0;
  double grouser_height = 0.0;      // m
  double grouser_thickness = 0.003; // m, at the root
  double grouser_tip_thickness = 0.0;  // m, of shape tapered
  std::string grouser_shape = "straight";
  double grouser_phase = 0.0;       // rad, of the first lug from straight down
  // What touches the soil in place of rim and lugs: convex hulls of points in the wheel's frame [m] (x forward, y along the
  // axle, z up), repeated around the axle: paddles, legs, a polygon.
  std::vector<std::vector<Vec3>> pieces = {};
  int piece_count = 1;  // how often around the axle
};

// The single-wheel rig and how it is driven.
struct RigSpec {
  std::optional<double> normal_load;  // N
  double angular_velocity = 0.3;      // rad/s
  std::string slip_convention = "s = 1 - v/(omega r)";
  std::string mode = "imposed_slip";  // or imposed_pull (free slip), pull_ramp, towed (no torque)
  double slip = 0.2;                  // of a single run, by the file's convention
  double pull = 0.0;                  // N resisting, of mode imposed_pull; where pull_ramp begins
  double final_pull = 60.0;           // N, where pull_ramp ends
  double travel = 0.7;                // m of the carriage after the ramp
  double ramp = 0.5;                  // s, in which the speeds rise
  double time_step = 1e-3;            // s
  double sample_interval = 5e-3;      // s
  double gravity = 9.81;              // m/s2
  double slope = 0.0;                 // rad, positive where the rail climbs
  double carriage_mass = 5.0;         // kg
  std::optional<double> lifted_mass;  // kg that moves up and down; absent: the load as dead weight
};

// Settings of the node-spring ground; terrain/node_spring.h says what the words mean.
struct TerrainSpec {
  double node_spacing = 3.3e-3;       // m
  std::string distribution = "wong_reece";
  std::string unloading = "rigid_plastic";
  std::string area = "arc";
  std::string shear_history = "rim";
  std::string skid_shear = "as_printed";
  double springback = 2e-4;           // m
  double unloading_k0 = 0.0;          // Pa/m
  double unloading_au = 0.0;          // Pa/m2
  double damping = 0.0;               // Pa s/m
  double damping_time = 0.0;          // s
  std::string side_wall = "none";
  double heap_fraction = 0.0;
  double repose_angle = 0.0;          // rad
};

// A law chosen by name, its parameters in SI.
struct LawChoice {
  std::string name;
  std::map<std::string, double> parameters;
};

// What the ground's shape is made of; the parts of a scenario are added up. Which keys a kind has: scenario/ground.cpp.
struct SurfacePart {
  std::string kind = "level";         // or slope, step, fractal, png, ascii
  double height = 0.0;                // m, of level ground; by how much a step rises
  double angle = 0.0, azimuth = 0.0;  // rad
  double at = 0.0, run = 0.02;        // m
  double rms_height = 0.01, hurst = 0.8, longest = 2.0, shortest = 0.05;  // m, -, m, m
  int waves = 96, seed = 1;
  std::string file;                   // with its folder
  double cell = 0.0, black = 0.0, white = 0.0, x0 = 0.0, y0 = 0.0;  // m
};

// Another soil in a rectangle, or mixed in by a share that varies like a surface: from 0, none of it, to 1, it alone.
struct SoilPlace {
  std::optional<double> x0, y0, x1, y1;  // m
  std::vector<SurfacePart> share;        // with heights without dimension
  std::shared_ptr<const terrain::Surface> share_surface;  // made of `share`
  recording::SoilBelief soil;            // whole: what the file leaves out is that of the scenario
};

struct LayerOfSoil {
  std::optional<double> thickness;       // m; the last one goes on for ever
  recording::SoilBelief soil;            // as of SoilPlace
};

// Grains, bed and law of the methods dem and mpi; lengths that are absent come from the wheel (scenario/dem_file.h).
struct ParticleSpec {
  std::optional<double> smallest, largest;          // m, diameters
  std::string distribution = "uniform", by = "number";
  std::optional<double> prism, prism_across, depth, width;  // m
  std::string floor = "smooth";
  std::string bed = "moving";
  double length = 1.0, behind = 0.2, border = 0.01; // m, of a full bed
  std::optional<double> window_ahead, window_behind;  // m
  std::string wheel_surface = "shape";
  double sphere_diameter = 0.01;                    // m
  double sphere_spacing = 0.75;                     // of their radius
  std::optional<double> time_step;                  // s
  double time_step_fraction = 0.12;                 // of the Rayleigh time
  double young_modulus = 7.0e7;                     // Pa
  double poisson_ratio = 0.35;
  double restitution = 0.4, friction = 0.86;
  std::string tangential = "mindlin", rolling = "epsd2";
  double rolling_friction = 1.0;
  double rolling_rate = 0.0;                        // s2/m2
  std::optional<double> wheel_friction, wheel_rolling_friction;
  std::optional<double> settling_friction, settling_rolling_friction;
  std::vector<std::string> approximate;             // departures from the law that the method mpi may make: liggghts/law.h
};

// One missing-physics effect that is switched on, with the parameters that are given (SI).
struct EffectSpec {
  std::string id;
  std::map<std::string, double> parameters;
};

// One steady state that is asked for.
struct OperatingPoint {
  double slip = 0.0;                  // s = 1 - v/(omega r)
  double slip_given = 0.0;            // by the convention of the scenario
  double normal_load = 0.0;           // N
  double angular_velocity = 0.0;      // rad/s
  int pass = 1;
};

// A condition of a sweep; what is absent comes from the rig.
struct SweepCondition {
  double slip = 0.0;                  // by the convention of the scenario
  std::optional<double> normal_load, angular_velocity;
  int pass = 1;
};

struct Scenario {
  std::string file;                   // where it was read
  std::string text;                   // as it was read
  std::string title;
  std::vector<std::string> methods;   // empty: steady
  int seed = 1;
  recording::SoilBelief soil;
  WheelSpec wheel;
  RigSpec rig;
  TerrainSpec terrain;
  LawChoice pressure_law{"power", {}}, shear_law{"janosi", {}};
  std::vector<SurfacePart> surface_parts;
  std::shared_ptr<const terrode::terrain::Surface> surface;  // made of them; null: level
  std::vector<SoilPlace> soil_map;
  std::vector<LayerOfSoil> soil_layers;
  ParticleSpec particles;
  std::vector<EffectSpec> effects;
  std::vector<double> slips;          // by the convention of the scenario
  std::vector<SweepCondition> conditions;
  std::optional<recording::Recording> measured;
  std::string measured_file;          // the recording it came from; empty where the scenario holds the points
  bool from_recording = false;
  std::vector<std::string> notes;     // for the user: defaults that were assumed, keys kept and ignored

  bekker::SlipConvention slip_convention() const;
  // The points of the sweep: conditions if there are any, else each slip at the rig's load and speed. Throws InputError
  // where there are none, where a slip cannot be, or where the load is missing.
  std::vector<OperatingPoint> operating_points() const;
  // As operating_points(), for these slips (in the convention of the scenario) at every load and speed of the scenario.
  std::vector<OperatingPoint> operating_points(const std::vector<double>& slips) const;
  // The soil as Bekker-type models take it; kc and kphi become k for the wheel's width. Throws InputError naming what
  // is missing or wrong.
  bekker::Soil bekker_soil() const { return bekker_soil(soil, "soil."); }
  // Of another soil of the scenario; `key` with its dot is where it stands.
  bekker::Soil bekker_soil(const recording::SoilBelief& soil, const std::string& key) const;
  bekker::ContactAngles contact_angles() const;
  bekker::WheelSize wheel_size() const;
  terrode::wheel::WheelShape wheel_shape() const;
  // The wheel as it touches the ground: of that shape, or of convex pieces. Throws InputError.
  std::shared_ptr<const terrode::wheel::Body> wheel_body() const;
};

// Lugs as the wheel room takes them.
wheel::Grousers grousers_of(const WheelSpec& wheel);
WheelSpec wheel_spec_of(const wheel::Grousers& grousers);  // its inverse; other keys at their defaults

// Reads a scenario file, or a recording (a folder, or its recording.yaml; its runs on up to `threads` threads). Throws
// InputError with every problem.
Scenario load_scenario(const std::string& path, int threads = 1);
// What a recording says of wheel, believed soil and run conditions, as a scenario; repeated conditions once.
Scenario scenario_of(const recording::Recording& recording);
// Reads a scenario from text; paths in it are relative to the folder of `file`.
Scenario parse_scenario(const std::string& text, const std::string& file);
// The scenario as YAML, complete in itself (soil and wheel inlined), that parse_scenario reads back.
std::string to_yaml(const Scenario& scenario);
// JSON Schema (draft 2020-12) of a scenario file, for editors.
std::string scenario_schema();
// The same for recording.yaml.
std::string recording_schema();

// "0.1", "-0.7,0.3,0.5" or "FROM:TO:STEP" (both ends included) as slips. Throws InputError.
std::vector<double> parse_slips(const std::string& text);

// Slips at which Smith et al. compare their models; used where a scenario names none.
const std::vector<double>& default_slips();

}  // namespace terrode::scenario
