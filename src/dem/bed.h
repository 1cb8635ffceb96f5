// Beds of particles: how they are prepared, tiled, stored and found again.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "core/random.h"
#include "dem/simulation.h"

namespace terrode::dem {

// Diameters of grains. The density of the distribution over the diameter is constant (`uniform`) or proportional to the
// diameter (`linear`), as a share of the number of grains or of their mass; or the diameters are listed with their
// shares. The paper's "linear distribution, 2.5 - 10 mm" gives its particle counts (about 640 in the shear box, 30,000
// in the plate bin) when it is read as uniform by number: the default.
struct SizeDistribution {
  std::string shape = "uniform";          // uniform, linear, listed
  std::string by = "number";              // number, mass
  double smallest = 2.5e-3;               // m, diameter
  double largest = 10e-3;                 // m
  std::vector<double> diameters, shares;  // listed: m, any positive numbers
  Problems validate() const;
  double sample(Random& random) const;  // a diameter [m]
  double mean_volume() const;           // m3, of a grain
};

// How a bed is made, as in the paper (section 3.3): grains are poured under gravity into a periodic prism, settle, are
// cut at the height asked for, and their density is scaled so that the prism has the bulk density asked for.
struct BedRecipe {
  double width = 0.05, length = 0.05;  // m, the prism along x and y
  double height = 0.16;                // m
  SizeDistribution sizes;
  Material grain;
  Interaction contact;  // grain on grain
  // Of grain on grain while the bed settles, absent: as in `contact`. Smooth grains pack densely, and the bed is then
  // sheared with its own friction: dense sand, which dilates and softens.
  std::optional<double> settling_friction, settling_rolling_friction;
  Interaction floor = Interaction::smooth_wall();
  double grain_density = 3090.0;     // kg/m3 while settling
  double bulk_density = 1600.0;      // kg/m3; 0: grain density stays
  double gravity = 9.81;             // m/s2
  bool walls = false;                // smooth rigid walls instead of periodic sides (a shear box)
  double viscous = 0.05;             // N s/m, damping while settling, once the grains have fallen
  double time_step_fraction = 0.15;  // of the smallest Rayleigh time
  // Settled when both hold: kinetic energy over (total mass g mean diameter), and the mean net force on a grain over
  // the mean contact force.
  double settled_energy = 2e-4, settled_force = 0.02;
  double longest_settling = 3.0;  // s; RunError when the bed still moves then
  std::uint64_t seed = 1;
  Problems validate() const;
  Interaction settling_contact() const;  // grain on grain while the bed settles
  std::string text() const;              // every parameter, one a line: equal text, equal bed
};

struct Grain {
  double radius = 0.0;           // m
  Vec3 position = Vec3::Zero();  // m, from the bed's corner; z from the floor
};

struct Bed {
  double width = 0.0, length = 0.0, height = 0.0;  // m
  double grain_density = 0.0;                      // kg/m3, after scaling
  double bulk_density = 0.0;                       // kg/m3, of all grains over width length height
  double solid_fraction = 0.0;                     // -
  double coordination = 0.0;                       // contacts a grain when it had settled
  bool walls = false;                              // stands between walls; false: its sides are periodic
  Material grain;
  std::vector<Grain> grains;
  std::string recipe;  // text of the recipe, for provenance
};

// Where the state of a bed that still settles is kept, and how often.
struct BedCheckpoint {
  std::string path;       // empty: nowhere
  double seconds = 30.0;  // of wall time between two states
};

// Settles a bed. With a checkpoint, one that was cut off goes on from the state kept last, to the same bed bit for bit;
// whoever saves the bed removes the file. Throws InputError for a wrong recipe, RunError when it does not come to
// rest, Interrupted on request.
Bed prepare_bed(const BedRecipe& recipe, int threads = 1, const Progress& progress = {},
                const BedCheckpoint& checkpoint = {});
// The bed repeated nx times along x and ny times along y.
Bed tile(const Bed& bed, int nx, int ny);

// HDF5 in the layout of H5MD 1.1 (de Buyl et al. 2014): /particles/soil with position, radius, mass, box.
void save_bed(const Bed& bed, const std::string& path);
Bed load_bed(const std::string& path);

// The bed of this recipe from `folder` (made when missing; default_cache_folder() when empty), settled only if it is
// not there yet.
Bed cached_bed(const BedRecipe& recipe, const std::string& folder = {}, int threads = 1, const Progress& progress = {});
// $TERRODE_CACHE, else $XDG_CACHE_HOME/terrode, else ~/.cache/terrode.
std::string default_cache_folder();

// Puts the grains into a simulation with their corner at `origin`.
void add_bed(Simulation& simulation, const Bed& bed, int material, const Vec3& origin = Vec3::Zero());

// Runs until kinetic energy and unbalanced force are below the limits; returns false when `longest` seconds were not
// enough.
bool settle(Simulation& simulation, double energy_limit, double force_limit, double longest,
            const Progress& progress = {});
// The same, begun at time `start` [s] of the simulation; calls `between` after every piece of work.
bool settle_since(double start, Simulation& simulation, double energy_limit, double force_limit, double longest,
                  const Progress& progress, const std::function<void()>& between);

}  // namespace terrode::dem
