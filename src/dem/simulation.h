// The particle engine: spheres, rigid bodies made of surfaces or of overlapping spheres, and their motion.
//
// Time integration is the leapfrog form of velocity Verlet: forces at x_n with v_(n-1/2), then
// v_(n+1/2) = v_(n-1/2) + dt a_n (dt/2 in the first step), x_(n+1) = x_n + dt v_(n+1/2). Velocities read between steps
// are those at the half step.
//
// Results are the same, bit for bit, for any number of threads and any vector width: particles are divided into chunks
// by their number alone, a chunk sums its contacts in list order, and loads on partners in other chunks are kept apart
// and added in the order of the chunks.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/frames.h"
#include "core/parallel.h"
#include "core/problem.h"
#include "dem/kernel.h"
#include "dem/material.h"
#include "dem/surface.h"

namespace terrode::dem {

struct Settings {
  double time_step = 0.0;         // s; 0: Simulation::suggested_time_step()
  Vec3 gravity{0.0, 0.0, -9.81};  // m/s2
  Vec3 period{0.0, 0.0, 0.0};     // m, edge of the periodic cell; 0: not periodic along that axis
  // N s/m, force -viscous v and torque -4/3 viscous R^2 w on every particle, as Stokes' drag has them (settling only):
  // without the torque a grain that touches one other can twist on it for ever.
  double viscous = 0.0;
  double skin = 0.0;              // m, of the neighbour list; 0: a quarter of the smallest radius or more
  int threads = 1;                // 0: all cores
  bool check_energy = true;       // stop when energy grows that nothing put in
  std::string kernel;             // "", "generic", "avx2", "avx512"
  Problems validate() const;
};

// One sphere as it is put in.
struct Sphere {
  Vec3 position = Vec3::Zero();  // m
  double radius = 0.0;           // m
  double density = 0.0;          // kg/m3
  Vec3 velocity = Vec3::Zero();  // m/s
  Vec3 spin = Vec3::Zero();      // rad/s
  int material = 0;
};

// A rigid body. Each translation is driven (keeps the velocity it is given) or free (obeys forces and gravity);
// rotation is driven or free as a whole. The default stands still.
struct Body {
  std::string name;
  Vec3 position = Vec3::Zero();  // m, reference point: centre of mass where anything is free
  Quat orientation = Quat::Identity();
  Vec3 velocity = Vec3::Zero();  // m/s
  Vec3 spin = Vec3::Zero();      // rad/s, world axes
  std::array<bool, 3> free_translation{false, false, false};
  bool free_rotation = false;
  double mass = 0.0;                  // kg, needed where anything is free
  Mat3 inertia = Mat3::Zero();        // kg m2, body axes, needed where rotation is free
  Vec3 applied_force = Vec3::Zero();  // N, besides contacts and gravity
  // Results of the last step: contact force [N] and moment about `position` [N m] on the body, world axes.
  Vec3 force = Vec3::Zero();
  Vec3 torque = Vec3::Zero();
};

// A sphere of a clump, in the clump's axes.
struct Member {
  Vec3 offset = Vec3::Zero();  // m
  double radius = 0.0;         // m
};

struct Energy {
  double translation = 0.0, rotation = 0.0, gravity = 0.0, normal_springs = 0.0, tangential_springs = 0.0;  // J
  double kinetic() const { return translation + rotation; }
  double total() const { return translation + rotation + gravity + normal_springs + tangential_springs; }
};

struct Counters {
  std::int64_t steps = 0, list_builds = 0, inner_builds = 0;
};

// Where the time of run() went [s of wall time, of the calling thread]; `walls` is a part of `forces`, summed over
// threads.
struct Times {
  double lists = 0.0, forces = 0.0, walls = 0.0, motion = 0.0, bodies = 0.0, checks = 0.0;
};

class Simulation {
 public:
  // Throws InputError when the settings are wrong.
  explicit Simulation(const Settings& settings);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  // Building. Interactions must be set for every pair of materials that can meet, before the first step.
  int add_material(const Material& material);
  void set_interaction(int a, int b, const Interaction& interaction);
  int add_particle(const Sphere& sphere);  // returns its id
  int add_body(const Body& body);          // returns its number
  void add_surface(int body, SurfacePtr surface, int material);
  void add_members(int body, const std::vector<Member>& members, int material);
  // Removes particles (not clump members) for which the predicate on position and radius holds; ids stay.
  void remove_particles(const std::function<bool(const Vec3&, double)>& remove);
  // Freezes the particles for which the predicate on position and radius holds, and thaws the others: frozen ones keep
  // their place and touch free ones like a rough wall. `density` [kg/m3] gives thawed ones their mass back.
  void set_frozen(const std::function<bool(const Vec3&, double)>& freeze, double density);
  // Calls visit(position, radius) for every particle that is no member of a body, frozen or free.
  void for_each_grain(const std::function<void(const Vec3&, double)>& visit) const;
  // Grains that touched a body in the last step.
  int contacts_of_body(int body) const;
  // Puts a body, its surfaces and its members somewhere else at once, without the motion in between.
  void place_body(int body, const Vec3& position, const Quat& orientation);
  // Makes every step call `drive(time, body)` before the body moves, to set velocities and applied forces.
  void set_drive(int body, std::function<void(double, Body&)> drive);

  // Smallest Rayleigh time of the free particles [s], and the time step suggested from it.
  double rayleigh_time() const;
  double suggested_time_step() const { return suggested_rayleigh_fraction * rayleigh_time(); }

  // Advances n steps. Throws InputError where the time step is above largest_rayleigh_fraction of the Rayleigh time or
  // the periodic cell is too small; RunError when energy grows that nothing put in, or a particle is lost.
  void run(std::int64_t n);

  double time() const { return time_; }
  double time_step() const { return settings_.time_step; }
  void set_time_step(double dt);
  void set_viscous(double viscous) { settings_.viscous = viscous; }
  const Settings& settings() const { return settings_; }
  const Counters& counters() const { return counters_; }
  const Times& times() const { return times_; }
  const char* kernel_name() const { return kernels_->name; }

  // Particles by id, in the order they were put in; removed ones are left out of `ids`.
  std::vector<int> ids() const;        // free particles
  std::vector<int> grains() const;     // free and frozen ones
  std::size_t particle_count() const;  // free particles and members
  std::size_t free_count() const { return free_count_; }
  Vec3 position(int id) const;
  Vec3 velocity(int id) const;
  Vec3 spin(int id) const;
  double radius(int id) const;
  double mass(int id) const;
  void set_velocity(int id, const Vec3& velocity, const Vec3& spin);
  // Multiplies the mass and inertia of every free particle (density rescaling).
  void scale_density(double factor);

  Body& body(int k) { return bodies_[static_cast<std::size_t>(k)]; }
  const Body& body(int k) const { return bodies_[static_cast<std::size_t>(k)]; }
  int body_count() const { return static_cast<int>(bodies_.size()); }

  Energy energy() const;
  // Work that bodies have done on the particles so far [J].
  double body_work() const { return body_work_; }
  // Contacts per free particle: each contact between two particles counts for both, with a surface for one.
  double coordination() const;
  // Largest net force on a free particle that has contacts over the mean contact force (both in the last step): how far
  // from rest the packing is. Advances nothing; uses velocities before and after the last step.
  double unbalanced_force() const;
  double total_mass() const;
  double largest_speed() const { return largest_speed_; }
  // Bytes held for particles, lists and histories.
  std::size_t memory_bytes() const;
  // Normal forces of all touching pairs [N], for tests and force-chain pictures.
  struct PairContact {
    int a = 0, b = 0;
    double overlap = 0.0;
    std::array<double, max_history> history{};
  };
  std::vector<PairContact> pair_contacts() const;

  // The whole state, bit for bit. Restore into a simulation built the same way (materials, interactions, bodies,
  // surfaces, drives); throws InputError when it was not.
  void save(std::ostream& out) const;
  void load(std::istream& in);

 private:
  struct Chunk;
  struct SurfaceOf {
    int body = 0, material = 0;
    SurfacePtr shape;
  };
  struct WallEntry {  // made as WallEntry{}: no padding, equal states have equal bytes
    std::int32_t facet, unused;
    double history[max_history];
  };
  struct WallCandidate {
    std::int32_t particle, surface, count, unused;
    WallEntry entry[max_surface_points];
  };
  struct CarriedPair {
    std::int32_t a, b;
    double history[max_history];
  };
  struct CarriedWall {
    std::int32_t id, unused;
    WallCandidate candidate;
  };
  struct Incoming {
    std::int32_t chunk, slot, particle;  // slot among the chunk's exported loads
  };

  void prepare();
  void invalidate_lists();
  void rebuild();
  void attach_carried();
  void build_outer(Chunk& chunk);
  void build_inner();
  void fill_inner(Chunk& chunk);
  void chunk_forces(std::size_t c);
  void chunk_motion(std::size_t c);
  void wall_forces(Chunk& chunk);
  void move_bodies();
  void place_members(int body);
  void check_state();
  void sort_particles();
  const PairLaw& law(int a, int b) const;
  Vec3 nearest_image(Vec3 d) const {
    constexpr double magic = 6755399441055744.0;  // adding and subtracting 1.5 2^52 rounds to an integer
    for (int k = 0; k < 3; ++k)
      if (settings_.period[k] > 0.0) d[k] -= settings_.period[k] * ((d[k] * inverse_period_[k] + magic) - magic);
    return d;
  }
  std::array<int, 3> cell_of(const double* x) const;
  template <class Visit>
  void visit_contacts(const Visit& visit) const;
  template <class Archive>
  void archive(Archive& ar);

  Settings settings_;
  Vec3 inverse_period_ = Vec3::Zero();
  const Kernels* kernels_;
  std::unique_ptr<Crew> crew_;
  std::vector<Material> materials_;
  std::map<std::pair<int, int>, PairLaw> interactions_;
  std::vector<PairLaw> laws_;  // by material_a * n + material_b
  int history_size_ = 0;       // numbers per pair contact
  bool prepared_ = false, first_step_ = true, lists_valid_ = false;

  // By slot (sorted by space).
  std::vector<double> position_, velocity_, spin_, load_;
  std::vector<std::int32_t> id_, body_of_;
  std::vector<std::int16_t> material_;
  std::vector<std::int32_t> slot_of_;  // by id; -1 where removed
  std::size_t free_count_ = 0;

  std::vector<Body> bodies_;
  std::vector<std::function<void(double, Body&)>> drives_;
  std::vector<SurfaceOf> surfaces_;
  std::vector<std::vector<std::int32_t>> member_ids_;  // by body
  std::vector<std::vector<Vec3>> member_offsets_;

  std::vector<std::unique_ptr<Chunk>> chunks_;
  std::vector<CarriedPair> carried_;
  std::vector<CarriedWall> carried_walls_;
  std::vector<std::pair<std::uint64_t, std::int32_t>> order_;
  std::vector<double> scratch_;
  std::vector<std::int32_t> int_scratch_;
  int chunk_size_ = 1;
  std::vector<std::int32_t> cell_begin_, cell_end_;
  std::array<int, 3> cells_{1, 1, 1};
  Vec3 cell_origin_ = Vec3::Zero(), cell_size_ = Vec3::Ones();

  double largest_radius_ = 0.0, smallest_radius_ = 0.0, skin_ = 0.0, inner_skin_ = 0.0;
  double outer_moved_ = 0.0, inner_moved_ = 0.0, largest_speed_ = 0.0;
  double time_ = 0.0, body_work_ = 0.0;
  double checked_energy_ = 0.0, checked_work_ = 0.0, checked_scale_ = 0.0;
  bool checked_ = false;
  Counters counters_;
  Times times_;  // not part of the state
};

}  // namespace terrode::dem
