#include "dem/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <istream>
#include <numbers>
#include <ostream>

#include "dem/law/parts.h"

namespace terrode::dem {

// Particles [begin, end) with everything their contacts need. `pair_*` is the inner list: pairs so near that they may
// touch before it is made again from `outer_*`, the list within the skin.
struct Simulation::Chunk {
  std::int32_t begin = 0, end = 0;
  std::vector<std::int32_t> outer_start, outer_j, outer_slot;  // slot in the inner list, -1, or -2 - carried index
  std::vector<std::uint8_t> outer_group;
  std::vector<std::int32_t> pair_i, pair_j, next_i, next_j;
  std::vector<double> history, next_history, exported, wrench;
  std::vector<PairRun> runs;
  std::vector<Incoming> incoming;
  std::vector<WallCandidate> walls;
  double fastest = 0.0;       // (m/s)^2
  double wall_seconds = 0.0;  // of the last step
};

namespace {

// body_of_ of particles that belong to no body; members have the number of theirs.
constexpr std::int32_t is_free = -1, is_frozen = -2;

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Histories lie block by block, number by number, slot by slot: where number k of n of a slot stands.
std::size_t history_at(int slot, int k, int n) {
  const auto block = std::size_t(slot / block_size) * block_size;
  return block * std::size_t(n) + std::size_t(k) * block_size + std::size_t(slot % block_size);
}

constexpr int max_materials = 8;
constexpr std::int64_t check_interval = 200;  // steps between checks of energy and positions

std::uint64_t spread_bits(std::uint64_t x) {
  x &= 0x1FFFFF;
  x = (x | x << 32) & 0x1F00000000FFFFull;
  x = (x | x << 16) & 0x1F0000FF0000FFull;
  x = (x | x << 8) & 0x100F00F00F00F00Full;
  x = (x | x << 4) & 0x10C30C30C30C30C3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

double moment_of_inertia_factor() { return 0.4; }

void require_density(double density) {
  Problems problems;
  require(problems, "density", density, "kg/m3", density > 0.0, "above 0");
  throw_if_any(problems);
}

// Geometry and motion of a contact between two records (position, velocity, spin of four numbers each); d = x_i - x_j.
void set_pair(Contact<double>& c, const Vec3& d, const double* xi, const double* vi, const double* wi, const double* xj,
              const double* vj, const double* wj) {
  const double distance = d.norm();
  const Vec3 n = d / distance;
  c.overlap = xi[3] + xj[3] - distance;
  c.radius_eff = xi[3] * xj[3] * (1.0 / (xi[3] + xj[3]));
  c.mass_eff = 1.0 / (vi[3] + vj[3]);
  const double arm_i = xi[3] - 0.5 * c.overlap, arm_j = xj[3] - 0.5 * c.overlap;
  const Vec3 u(vi[0] - vj[0], vi[1] - vj[1], vi[2] - vj[2]);
  const Vec3 spin_i(wi[0], wi[1], wi[2]), spin_j(wj[0], wj[1], wj[2]);
  c.vn = u.dot(n);
  const Vec3 vt = u - c.vn * n - Vec3(arm_i * spin_i + arm_j * spin_j).cross(n);
  const Vec3 w = (spin_i - spin_j) - (spin_i - spin_j).dot(n) * n;
  c.nx = n.x(), c.ny = n.y(), c.nz = n.z();
  c.vtx = vt.x(), c.vty = vt.y(), c.vtz = vt.z();
  c.wx = w.x(), c.wy = w.y(), c.wz = w.z();
  const double ri2 = xi[3] * xi[3], rj2 = xj[3] * xj[3];
  c.inertia_eff = 1.4 * ri2 * rj2 / (vi[3] * rj2 + vj[3] * ri2);
}

// The same against a surface that moves with velocity `surface_velocity` at the contact and spin `surface_spin`.
void set_wall(Contact<double>& c, const Vec3& n, double distance, const double* x, const double* v, const double* w,
              const Vec3& surface_velocity, const Vec3& surface_spin) {
  c.overlap = x[3] - distance;
  c.radius_eff = x[3];
  c.mass_eff = 1.0 / v[3];
  const double arm = x[3] - 0.5 * c.overlap;
  const Vec3 u = Vec3(v[0], v[1], v[2]) - surface_velocity;
  const Vec3 spin(w[0], w[1], w[2]);
  c.vn = u.dot(n);
  const Vec3 vt = u - c.vn * n - arm * spin.cross(n);
  const Vec3 relative = spin - surface_spin, rolling = relative - relative.dot(n) * n;
  c.nx = n.x(), c.ny = n.y(), c.nz = n.z();
  c.vtx = vt.x(), c.vty = vt.y(), c.vtz = vt.z();
  c.wx = rolling.x(), c.wy = rolling.y(), c.wz = rolling.z();
  c.inertia_eff = 1.4 * x[3] * x[3] / v[3];
}

}  // namespace

Problems Settings::validate() const {
  Problems problems;
  require(problems, "time_step", time_step, "s", time_step >= 0.0, "above 0 (or 0 for the suggested one)");
  for (int k = 0; k < 3; ++k) {
    require(problems, "gravity", gravity[k], "m/s2", true, "a number");
    require(problems, "period", period[k], "m", period[k] >= 0.0, "0 (not periodic) or more");
  }
  require(problems, "viscous", viscous, "N s/m", viscous >= 0.0, "0 or more");
  require(problems, "skin", skin, "m", skin >= 0.0, "0 (chosen) or more");
  return problems;
}

Simulation::Simulation(const Settings& settings)
    : settings_(settings), kernels_(&kernels(settings.kernel.empty() ? nullptr : settings.kernel.c_str())) {
  throw_if_any(settings.validate());
  for (int k = 0; k < 3; ++k) inverse_period_[k] = settings.period[k] > 0.0 ? 1.0 / settings.period[k] : 0.0;
  crew_ = std::make_unique<Crew>(settings.threads);
}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

int Simulation::add_material(const Material& material) {
  throw_if_any(material.validate());
  if (materials_.size() == max_materials) throw InputError("more than 8 materials");
  materials_.push_back(material);
  prepared_ = false;
  return static_cast<int>(materials_.size()) - 1;
}

void Simulation::set_interaction(int a, int b, const Interaction& interaction) {
  const auto known = [&](int m) { return m >= 0 && m < static_cast<int>(materials_.size()); };
  if (!known(a) || !known(b)) throw InputError("interaction of a material that was not added");
  interactions_[std::minmax(a, b)] = make_pair_law(materials_[std::size_t(a)], materials_[std::size_t(b)], interaction);
  prepared_ = false;
}

int Simulation::add_particle(const Sphere& s) {
  Problems problems;
  require(problems, "radius", s.radius, "m", s.radius > 0.0, "above 0");
  require(problems, "density", s.density, "kg/m3", s.density > 0.0, "above 0");
  for (int k = 0; k < 3; ++k) {
    require(problems, "position", s.position[k], "m", true, "a number");
    require(problems, "velocity", s.velocity[k], "m/s", true, "a number");
    require(problems, "spin", s.spin[k], "rad/s", true, "a number");
  }
  if (s.material < 0 || s.material >= static_cast<int>(materials_.size()))
    problems.push_back({{}, 0, 0, "material", "was not added", "a number from add_material"});
  throw_if_any(problems);
  invalidate_lists();
  const double mass = s.density * 4.0 / 3.0 * std::numbers::pi * s.radius * s.radius * s.radius;
  const double inertia = moment_of_inertia_factor() * mass * s.radius * s.radius;
  position_.insert(position_.end(), {s.position.x(), s.position.y(), s.position.z(), s.radius});
  velocity_.insert(velocity_.end(), {s.velocity.x(), s.velocity.y(), s.velocity.z(), 1.0 / mass});
  spin_.insert(spin_.end(), {s.spin.x(), s.spin.y(), s.spin.z(), 1.0 / inertia});
  load_.insert(load_.end(), 8, 0.0);
  const int id = static_cast<int>(slot_of_.size());
  slot_of_.push_back(static_cast<std::int32_t>(id_.size()));
  id_.push_back(id);
  body_of_.push_back(-1);
  material_.push_back(static_cast<std::int16_t>(s.material));
  ++free_count_;
  prepared_ = false;
  return id;
}

int Simulation::add_body(const Body& body) {
  const bool moves = body.free_translation[0] || body.free_translation[1] || body.free_translation[2];
  Problems problems;
  if (moves || body.free_rotation) require(problems, "mass", body.mass, "kg", body.mass > 0.0, "above 0");
  if (body.free_rotation && !(body.inertia.determinant() > 0.0))
    problems.push_back({{}, 0, 0, "inertia", "is not positive definite", "a moment of inertia [kg m2]"});
  throw_if_any(problems);
  bodies_.push_back(body);
  drives_.emplace_back();
  member_ids_.emplace_back();
  member_offsets_.emplace_back();
  prepared_ = false;
  return static_cast<int>(bodies_.size()) - 1;
}

void Simulation::add_surface(int body, SurfacePtr surface, int material) {
  if (body < 0 || body >= body_count()) throw InputError("surface of a body that was not added");
  if (material < 0 || material >= static_cast<int>(materials_.size()))
    throw InputError("surface of a material that was not added");
  surfaces_.push_back({body, material, std::move(surface)});
  invalidate_lists();
  prepared_ = false;
}

void Simulation::add_members(int body, const std::vector<Member>& members, int material) {
  if (body < 0 || body >= body_count()) throw InputError("members of a body that was not added");
  const Body& b = bodies_[std::size_t(body)];
  const bool moves = b.free_translation[0] || b.free_translation[1] || b.free_translation[2];
  for (const Member& m : members) {
    const int id =
        add_particle({b.position + b.orientation * m.offset, m.radius, 1.0, Vec3::Zero(), Vec3::Zero(), material});
    --free_count_;
    const auto slot = std::size_t(slot_of_[std::size_t(id)]);
    velocity_[4 * slot + 3] = moves ? 1.0 / b.mass : 0.0;
    spin_[4 * slot + 3] = 0.0;
    body_of_[slot] = body;
    member_ids_[std::size_t(body)].push_back(id);
    member_offsets_[std::size_t(body)].push_back(m.offset);
  }
  place_members(body);
}

void Simulation::remove_particles(const std::function<bool(const Vec3&, double)>& remove) {
  invalidate_lists();
  std::size_t kept = 0;
  for (std::size_t p = 0; p < id_.size(); ++p) {
    const double* x = &position_[4 * p];
    const auto id = std::size_t(id_[p]);
    if (body_of_[p] < 0 && remove(Vec3(x[0], x[1], x[2]), x[3])) {
      slot_of_[id] = -1;
      if (body_of_[p] == is_free) --free_count_;
      continue;
    }
    if (kept != p) {
      std::copy_n(&position_[4 * p], 4, &position_[4 * kept]);
      std::copy_n(&velocity_[4 * p], 4, &velocity_[4 * kept]);
      std::copy_n(&spin_[4 * p], 4, &spin_[4 * kept]);
      id_[kept] = id_[p];
      body_of_[kept] = body_of_[p];
      material_[kept] = material_[p];
    }
    slot_of_[id] = static_cast<std::int32_t>(kept++);
  }
  position_.resize(4 * kept);
  velocity_.resize(4 * kept);
  spin_.resize(4 * kept);
  load_.assign(8 * kept, 0.0);
  id_.resize(kept);
  body_of_.resize(kept);
  material_.resize(kept);
}

void Simulation::set_frozen(const std::function<bool(const Vec3&, double)>& freeze, double density) {
  require_density(density);
  bool changed = false;
  for (std::size_t p = 0; p < id_.size(); ++p) {
    if (body_of_[p] >= 0) continue;
    const double r = position_[4 * p + 3];
    const bool frozen = freeze(Vec3(position_[4 * p], position_[4 * p + 1], position_[4 * p + 2]), r);
    if (frozen == (body_of_[p] == is_frozen)) continue;
    if (!changed) invalidate_lists();
    changed = true;
    for (std::size_t k = 0; k < 3; ++k) velocity_[4 * p + k] = spin_[4 * p + k] = 0.0;
    if (frozen) {
      body_of_[p] = is_frozen;
      velocity_[4 * p + 3] = spin_[4 * p + 3] = 0.0;
      --free_count_;
    } else {
      const double mass = density * 4.0 / 3.0 * std::numbers::pi * r * r * r;
      body_of_[p] = is_free;
      velocity_[4 * p + 3] = 1.0 / mass;
      spin_[4 * p + 3] = 1.0 / (moment_of_inertia_factor() * mass * r * r);
      ++free_count_;
    }
  }
  if (changed) checked_ = prepared_ = false;
}

void Simulation::for_each_grain(const std::function<void(const Vec3&, double)>& visit) const {
  for (std::size_t p = 0; p < id_.size(); ++p)
    if (body_of_[p] < 0)
      visit(Vec3(position_[4 * p], position_[4 * p + 1], position_[4 * p + 2]), position_[4 * p + 3]);
}

int Simulation::contacts_of_body(int body) const {
  if (!lists_valid_) return 0;
  int count = 0;
  for (const auto& chunk : chunks_) {
    for (const WallCandidate& w : chunk->walls)
      if (surfaces_[std::size_t(w.surface)].body == body && w.count > 0) ++count;
    if (member_ids_[std::size_t(body)].empty()) continue;
    for (const PairRun& run : chunk->runs)
      for (int s = run.begin; s < run.begin + run.count; ++s) {
        const auto i = std::size_t(chunk->pair_i[std::size_t(s)]), j = std::size_t(chunk->pair_j[std::size_t(s)]);
        if (body_of_[i] != body && body_of_[j] != body) continue;
        const double *xi = &position_[4 * i], *xj = &position_[4 * j];
        if (nearest_image(Vec3(xi[0] - xj[0], xi[1] - xj[1], xi[2] - xj[2])).norm() < xi[3] + xj[3]) ++count;
      }
  }
  return count;
}

void Simulation::place_body(int k, const Vec3& position, const Quat& orientation) {
  if (k < 0 || k >= body_count()) throw InputError("a body that was not added");
  Body& body = bodies_[std::size_t(k)];
  body.position = position;
  body.orientation = orientation;
  invalidate_lists();
  place_members(k);
}

void Simulation::set_drive(int body, std::function<void(double, Body&)> drive) {
  drives_[static_cast<std::size_t>(body)] = std::move(drive);
}

double Simulation::rayleigh_time() const {
  double least = 0.0;
  for (std::size_t p = 0; p < id_.size(); ++p) {
    if (body_of_[p] != is_free) continue;
    const double r = position_[4 * p + 3];
    const double density = 1.0 / velocity_[4 * p + 3] / (4.0 / 3.0 * std::numbers::pi * r * r * r);
    const double t = dem::rayleigh_time(r, density, materials_[std::size_t(material_[p])]);
    if (least == 0.0 || t < least) least = t;
  }
  return least;
}

void Simulation::set_time_step(double dt) {
  settings_.time_step = dt;
  throw_if_any(settings_.validate());
  prepared_ = false;
}

const PairLaw& Simulation::law(int a, int b) const {
  return laws_[static_cast<std::size_t>(a) * materials_.size() + static_cast<std::size_t>(b)];
}

void Simulation::prepare() {
  const std::size_t n = materials_.size();
  laws_.assign(n * n, PairLaw{});
  history_size_ = 0;
  for (const auto& [pair, pair_law] : interactions_) {
    laws_[std::size_t(pair.first) * n + std::size_t(pair.second)] = pair_law;
    laws_[std::size_t(pair.second) * n + std::size_t(pair.first)] = pair_law;
    history_size_ = std::max(history_size_, history_size(pair_law));
  }
  // Particles of these materials can meet each other and the surfaces.
  std::vector<bool> in_use(n, false);
  for (std::size_t p = 0; p < id_.size(); ++p) in_use[std::size_t(material_[p])] = true;
  Problems problems;
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a; b < n; ++b)
      if (in_use[a] && in_use[b] && !interactions_.contains({int(a), int(b)}))
        problems.push_back({{},
                            0,
                            0,
                            "interaction",
                            "of " + materials_[a].name + " and " + materials_[b].name + " is missing",
                            "set_interaction for every pair of materials that can meet"});
    for (const SurfaceOf& s : surfaces_)
      if (in_use[a] && !interactions_.contains(std::minmax(int(a), s.material)))
        problems.push_back(
            {{},
             0,
             0,
             "interaction",
             "of " + materials_[a].name + " and surface " + materials_[std::size_t(s.material)].name + " is missing",
             "set_interaction"});
  }
  throw_if_any(problems);

  largest_radius_ = 0.0;
  smallest_radius_ = 0.0;
  double sum = 0.0;
  for (std::size_t p = 0; p < id_.size(); ++p) {
    const double r = position_[4 * p + 3];
    largest_radius_ = std::max(largest_radius_, r);
    if (smallest_radius_ == 0.0 || r < smallest_radius_) smallest_radius_ = r;
    sum += r;
  }
  const double mean = id_.empty() ? 0.0 : sum / static_cast<double>(id_.size());
  const double skin = settings_.skin > 0.0 ? settings_.skin : 0.25 * mean;
  if (skin != skin_) invalidate_lists();
  skin_ = skin;

  if (free_count_ > 0) {
    const double rayleigh = rayleigh_time();
    if (settings_.time_step == 0.0) settings_.time_step = suggested_rayleigh_fraction * rayleigh;
    const double limit = largest_rayleigh_fraction * rayleigh;
    if (settings_.time_step > limit)
      problems.push_back({{},
                          0,
                          0,
                          "time_step",
                          "is " + std::to_string(settings_.time_step * 1e6) + " us",
                          "at most " + std::to_string(limit * 1e6) + " us, " +
                              std::to_string(largest_rayleigh_fraction) + " of the smallest grain's Rayleigh time (" +
                              std::to_string(suggested_rayleigh_fraction * rayleigh * 1e6) + " us is suggested)"});
  } else if (settings_.time_step == 0.0) {
    problems.push_back({{}, 0, 0, "time_step", "is 0 and there is no particle to choose it from", "a time step"});
  }
  for (int k = 0; k < 3; ++k)
    if (settings_.period[k] > 0.0 && settings_.period[k] < 2.0 * (2.0 * largest_radius_ + skin_))
      problems.push_back({{},
                          0,
                          0,
                          "period",
                          "is " + std::to_string(settings_.period[k]) + " m",
                          "at least twice the largest diameter and skin, " +
                              std::to_string(2.0 * (2.0 * largest_radius_ + skin_)) + " m"});
  throw_if_any(problems);
  prepared_ = true;
}

// Takes the contact histories out of the lists, which no longer fit the particles.
void Simulation::invalidate_lists() {
  if (!lists_valid_) return;
  lists_valid_ = false;
  carried_.clear();
  carried_walls_.clear();
  const int n = history_size_;
  for (const auto& chunk : chunks_) {
    for (const PairRun& run : chunk->runs)
      for (int s = run.begin; s < run.begin + run.count; ++s) {
        CarriedPair pair{
            id_[std::size_t(chunk->pair_i[std::size_t(s)])], id_[std::size_t(chunk->pair_j[std::size_t(s)])], {}};
        bool any = false;
        for (int k = 0; k < n; ++k) {
          pair.history[k] = chunk->history[history_at(s, k, n)];
          any = any || pair.history[k] != 0.0;
        }
        if (any) carried_.push_back(pair);
      }
    for (const WallCandidate& w : chunk->walls)
      if (w.count > 0) carried_walls_.push_back({id_[std::size_t(w.particle)], 0, w});
  }
}

std::array<int, 3> Simulation::cell_of(const double* x) const {
  std::array<int, 3> c{};
  for (int k = 0; k < 3; ++k) {
    double at = x[k] - cell_origin_[k];
    if (settings_.period[k] > 0.0) at -= settings_.period[k] * std::floor(at / settings_.period[k]);
    c[std::size_t(k)] = std::clamp(static_cast<int>(at / cell_size_[k]), 0, cells_[std::size_t(k)] - 1);
  }
  return c;
}

void Simulation::sort_particles() {
  const std::size_t n = id_.size();
  Vec3 lo = Vec3::Constant(0.0), hi = Vec3::Constant(0.0);
  for (std::size_t p = 0; p < n; ++p)
    for (int k = 0; k < 3; ++k) {
      const double x = position_[4 * p + std::size_t(k)];
      if (!std::isfinite(x)) throw RunError("a particle's position is not a number: the time step is too large");
      lo[k] = p == 0 ? x : std::min(lo[k], x);
      hi[k] = p == 0 ? x : std::max(hi[k], x);
    }
  const double edge = 2.0 * largest_radius_ + skin_;
  // Cells are at least as wide as the longest reach; wider where a few stray particles would make too many.
  for (double size = edge;; size *= 1.3) {
    double total = 1.0;
    for (int k = 0; k < 3; ++k) {
      const double length = settings_.period[k] > 0.0 ? settings_.period[k] : std::max(hi[k] - lo[k], 1e-12);
      const double count = std::max(1.0, std::floor(length / size));
      total *= count;
      if (count < 2e6) cells_[std::size_t(k)] = static_cast<int>(count);
      cell_size_[k] = length / count * (1.0 + 1e-12);
      cell_origin_[k] = settings_.period[k] > 0.0 ? 0.0 : lo[k];
    }
    if (total <= 4.0 * static_cast<double>(n) + 1000.0) break;
  }
  order_.resize(n);
  for (std::size_t p = 0; p < n; ++p) {
    const auto c = cell_of(&position_[4 * p]);
    order_[p] = {spread_bits(std::uint64_t(c[0])) | spread_bits(std::uint64_t(c[1])) << 1 |
                     spread_bits(std::uint64_t(c[2])) << 2,
                 id_[p]};
  }
  std::sort(order_.begin(), order_.end());
  const auto permute4 = [&](std::vector<double>& a) {
    scratch_.resize(4 * n);
    for (std::size_t p = 0; p < n; ++p)
      std::copy_n(&a[4 * std::size_t(slot_of_[std::size_t(order_[p].second)])], 4, &scratch_[4 * p]);
    a.swap(scratch_);
  };
  permute4(position_);
  permute4(velocity_);
  permute4(spin_);
  int_scratch_.resize(n);
  for (std::size_t p = 0; p < n; ++p) int_scratch_[p] = body_of_[std::size_t(slot_of_[std::size_t(order_[p].second)])];
  body_of_.swap(int_scratch_);
  int_scratch_.resize(n);
  for (std::size_t p = 0; p < n; ++p) int_scratch_[p] = material_[std::size_t(slot_of_[std::size_t(order_[p].second)])];
  for (std::size_t p = 0; p < n; ++p) material_[p] = static_cast<std::int16_t>(int_scratch_[p]);
  for (std::size_t p = 0; p < n; ++p) {
    id_[p] = order_[p].second;
    slot_of_[std::size_t(id_[p])] = static_cast<std::int32_t>(p);
  }
  const auto cell_count = std::size_t(cells_[0]) * std::size_t(cells_[1]) * std::size_t(cells_[2]);
  cell_begin_.assign(cell_count, 0);
  cell_end_.assign(cell_count, 0);
  std::size_t last = cell_count;
  for (std::size_t p = 0; p < n; ++p) {
    const auto c = cell_of(&position_[4 * p]);
    const std::size_t at =
        (std::size_t(c[2]) * std::size_t(cells_[1]) + std::size_t(c[1])) * std::size_t(cells_[0]) + std::size_t(c[0]);
    if (at != last) cell_begin_[at] = static_cast<std::int32_t>(p);
    cell_end_[at] = static_cast<std::int32_t>(p) + 1;
    last = at;
  }
}

// Pairs (i, j > i) of this chunk's particles within reach and skin, and the surfaces near them.
void Simulation::build_outer(Chunk& chunk) {
  chunk.outer_start.clear();
  chunk.outer_j.clear();
  chunk.walls.clear();
  const bool bodies = !bodies_.empty();
  std::array<int, 3> last_cell{-1, -1, -1};
  std::array<std::size_t, 27> around{};
  std::size_t n_around = 0;
  SurfacePoint points[max_surface_points];
  for (std::int32_t i = chunk.begin; i < chunk.end; ++i) {
    chunk.outer_start.push_back(static_cast<std::int32_t>(chunk.outer_j.size()));
    const double* xi = &position_[4 * std::size_t(i)];
    const auto c = cell_of(xi);
    if (c != last_cell) {
      last_cell = c;
      n_around = 0;
      for (int z = -1; z <= 1; ++z)
        for (int y = -1; y <= 1; ++y)
          for (int x = -1; x <= 1; ++x) {
            std::array<int, 3> d{c[0] + x, c[1] + y, c[2] + z};
            bool outside = false;
            for (std::size_t k = 0; k < 3; ++k) {
              if (d[k] >= 0 && d[k] < cells_[k]) continue;
              if (settings_.period[int(k)] > 0.0)
                d[k] = (d[k] + cells_[k]) % cells_[k];
              else
                outside = true;
            }
            if (outside) continue;
            const std::size_t at =
                (std::size_t(d[2]) * std::size_t(cells_[1]) + std::size_t(d[1])) * std::size_t(cells_[0]) +
                std::size_t(d[0]);
            if (cell_end_[at] > cell_begin_[at]) around[n_around++] = at;
          }
      std::sort(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(n_around),
                [&](std::size_t a, std::size_t b) { return cell_begin_[a] < cell_begin_[b]; });
      n_around = static_cast<std::size_t>(
          std::unique(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(n_around)) - around.begin());
    }
    for (std::size_t q = 0; q < n_around; ++q) {
      const std::int32_t end = cell_end_[around[q]];
      for (std::int32_t j = std::max(cell_begin_[around[q]], i + 1); j < end; ++j) {
        const double* xj = &position_[4 * std::size_t(j)];
        const Vec3 d = nearest_image(Vec3(xi[0] - xj[0], xi[1] - xj[1], xi[2] - xj[2]));
        const double reach = xi[3] + xj[3] + skin_;
        if (d.squaredNorm() >= reach * reach) continue;
        if (bodies) {
          if (body_of_[std::size_t(i)] >= 0 && body_of_[std::size_t(i)] == body_of_[std::size_t(j)]) continue;
          if (velocity_[4 * std::size_t(i) + 3] == 0.0 && velocity_[4 * std::size_t(j) + 3] == 0.0) continue;
        }
        chunk.outer_j.push_back(j);
      }
    }
    if (velocity_[4 * std::size_t(i) + 3] == 0.0) continue;
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
      if (surfaces_[s].body == body_of_[std::size_t(i)]) continue;
      const Body& body = bodies_[std::size_t(surfaces_[s].body)];
      const Vec3 d = nearest_image(Vec3(xi[0], xi[1], xi[2]) - body.position);
      const double reach = xi[3] + skin_;
      if (surfaces_[s].shape->near(body.orientation.conjugate() * d, reach, points) == 0) continue;
      WallCandidate w{};
      w.particle = i;
      w.surface = static_cast<std::int32_t>(s);
      chunk.walls.push_back(w);
    }
  }
  chunk.outer_start.push_back(static_cast<std::int32_t>(chunk.outer_j.size()));
  chunk.outer_slot.assign(chunk.outer_j.size(), -1);
  chunk.outer_group.resize(chunk.outer_j.size());
  chunk.wrench.assign(6 * bodies_.size(), 0.0);
}

// Gives carried histories to the new lists. Partners may have changed order: the history changes sign with it.
void Simulation::attach_carried() {
  for (std::size_t k = 0; k < carried_.size(); ++k) {
    CarriedPair& pair = carried_[k];
    std::int32_t i = slot_of_[std::size_t(pair.a)], j = slot_of_[std::size_t(pair.b)];
    if (i < 0 || j < 0) continue;
    if (i > j) {
      std::swap(i, j);
      for (double& h : pair.history) h = -h;
    }
    Chunk& chunk = *chunks_[std::size_t(i / chunk_size_)];
    const auto row = std::size_t(i - chunk.begin);
    for (std::int32_t p = chunk.outer_start[row]; p < chunk.outer_start[row + 1]; ++p)
      if (chunk.outer_j[std::size_t(p)] == j) chunk.outer_slot[std::size_t(p)] = -2 - static_cast<std::int32_t>(k);
  }
  for (const CarriedWall& carried : carried_walls_) {
    const std::int32_t p = slot_of_[std::size_t(carried.id)];
    if (p < 0) continue;
    Chunk& chunk = *chunks_[std::size_t(p / chunk_size_)];
    auto at = std::lower_bound(chunk.walls.begin(), chunk.walls.end(), std::pair(p, carried.candidate.surface),
                               [](const WallCandidate& w, const std::pair<std::int32_t, std::int32_t>& key) {
                                 return std::pair(w.particle, w.surface) < key;
                               });
    if (at == chunk.walls.end() || at->particle != p || at->surface != carried.candidate.surface) continue;
    *at = carried.candidate;
    at->particle = p;
  }
}

void Simulation::rebuild() {
  invalidate_lists();
  sort_particles();
  const auto n = static_cast<std::int32_t>(id_.size());
  // A function of the number of particles alone, so that sums do not depend on the number of threads.
  const std::int32_t count = std::clamp(n / 2048, 1, 4096);
  chunk_size_ = std::max(1, (n + count - 1) / count);
  const auto used = std::size_t((n + chunk_size_ - 1) / chunk_size_);
  while (chunks_.size() < used) chunks_.push_back(std::make_unique<Chunk>());
  chunks_.resize(used);
  for (std::size_t c = 0; c < used; ++c) {
    chunks_[c]->begin = static_cast<std::int32_t>(c) * chunk_size_;
    chunks_[c]->end = std::min(n, chunks_[c]->begin + chunk_size_);
  }
  crew_->run(chunks_.size(), [this](std::size_t c) { build_outer(*chunks_[c]); });
  attach_carried();
  outer_moved_ = 0.0;
  ++counters_.list_builds;
  build_inner();
  carried_.clear();
  carried_walls_.clear();
  lists_valid_ = true;
}

void Simulation::build_inner() {
  // About forty steps' worth of motion: rare rebuilds for little more than the touching pairs.
  inner_skin_ = std::clamp(80.0 * settings_.time_step * largest_speed_, 0.002 * smallest_radius_, skin_);
  crew_->run(chunks_.size(), [this](std::size_t c) { fill_inner(*chunks_[c]); });
  for (const auto& chunk : chunks_) chunk->incoming.clear();
  for (std::size_t c = 0; c < chunks_.size(); ++c)
    for (const PairRun& run : chunks_[c]->runs) {
      if (!run.external) continue;
      for (int s = run.begin; s < run.begin + run.count; ++s) {
        const std::int32_t j = chunks_[c]->pair_j[std::size_t(s)];
        chunks_[std::size_t(j / chunk_size_)]->incoming.push_back(
            {static_cast<std::int32_t>(c), s - run.export_offset, j});
      }
    }
  inner_moved_ = 0.0;
  ++counters_.inner_builds;
}

void Simulation::fill_inner(Chunk& chunk) {
  const std::size_t n_materials = materials_.size(), n_groups = 2 * n_materials * n_materials;
  std::array<int, 2 * max_materials * max_materials> count{}, at{};
  for (std::int32_t i = chunk.begin; i < chunk.end; ++i) {
    const double* xi = &position_[4 * std::size_t(i)];
    const auto row = std::size_t(i - chunk.begin);
    for (auto p = std::size_t(chunk.outer_start[row]); p < std::size_t(chunk.outer_start[row + 1]); ++p) {
      const auto j = std::size_t(chunk.outer_j[p]);
      const double* xj = &position_[4 * j];
      const Vec3 d = nearest_image(Vec3(xi[0] - xj[0], xi[1] - xj[1], xi[2] - xj[2]));
      const double reach = xi[3] + xj[3] + inner_skin_;
      if (d.squaredNorm() >= reach * reach) {
        chunk.outer_group[p] = 255;
        chunk.outer_slot[p] = -1;
        continue;
      }
      const std::size_t pair = std::size_t(material_[std::size_t(i)]) * n_materials + std::size_t(material_[j]);
      const std::size_t group = 2 * pair + (static_cast<std::int32_t>(j) >= chunk.end ? 1 : 0);
      chunk.outer_group[p] = static_cast<std::uint8_t>(group);
      ++count[group];
    }
  }
  chunk.runs.clear();
  int slots = 0, exports = 0;
  for (std::size_t g = 0; g < n_groups; ++g) {
    if (count[g] == 0) continue;
    const int blocks = (count[g] + block_size - 1) / block_size;
    PairRun run{slots, count[g], static_cast<int>(g / 2), static_cast<std::int32_t>(g % 2), 0};
    at[g] = slots;
    if (run.external) {
      run.export_offset = slots - exports;
      exports += blocks * block_size;
    }
    slots += blocks * block_size;
    chunk.runs.push_back(run);
  }
  const int n = history_size_;
  chunk.next_i.assign(std::size_t(slots), chunk.begin);
  chunk.next_j.assign(std::size_t(slots), chunk.begin);
  chunk.next_history.assign(std::size_t(slots) * std::size_t(n), 0.0);
  chunk.exported.resize(8 * std::size_t(exports));
  const auto index = [n](int slot, int k) { return history_at(slot, k, n); };
  for (std::int32_t i = chunk.begin; i < chunk.end; ++i) {
    const auto row = std::size_t(i - chunk.begin);
    for (auto p = std::size_t(chunk.outer_start[row]); p < std::size_t(chunk.outer_start[row + 1]); ++p) {
      if (chunk.outer_group[p] == 255) continue;
      const int slot = at[chunk.outer_group[p]]++;
      chunk.next_i[std::size_t(slot)] = i;
      chunk.next_j[std::size_t(slot)] = chunk.outer_j[p];
      const int from = chunk.outer_slot[p];
      if (from >= 0)
        for (int k = 0; k < n; ++k) chunk.next_history[index(slot, k)] = chunk.history[index(from, k)];
      else if (from <= -2)
        for (int k = 0; k < n; ++k) chunk.next_history[index(slot, k)] = carried_[std::size_t(-2 - from)].history[k];
      chunk.outer_slot[p] = slot;
    }
  }
  chunk.pair_i.swap(chunk.next_i);
  chunk.pair_j.swap(chunk.next_j);
  chunk.history.swap(chunk.next_history);
}

void Simulation::chunk_forces(std::size_t c) {
  Chunk& chunk = *chunks_[c];
  PairArrays a;
  a.position = position_.data();
  a.velocity = velocity_.data();
  a.spin = spin_.data();
  a.load = load_.data();
  a.i = chunk.pair_i.data();
  a.j = chunk.pair_j.data();
  a.history = chunk.history.data();
  a.history_stride = block_size * history_size_;
  a.exported = chunk.exported.data();
  a.dt = settings_.time_step;
  for (int k = 0; k < 3; ++k) {
    a.period[k] = settings_.period[k];
    a.inverse_period[k] = inverse_period_[k];
  }
  for (const PairRun& run : chunk.runs) kernels_->pairs(a, laws_[std::size_t(run.law)], run);
  chunk.wall_seconds = -seconds();
  wall_forces(chunk);
  chunk.wall_seconds += seconds();
}

void Simulation::wall_forces(Chunk& chunk) {
  std::fill(chunk.wrench.begin(), chunk.wrench.end(), 0.0);
  SurfacePoint points[max_surface_points];
  for (WallCandidate& w : chunk.walls) {
    const auto p = std::size_t(w.particle);
    const SurfaceOf& surface = surfaces_[std::size_t(w.surface)];
    const Body& body = bodies_[std::size_t(surface.body)];
    const bool turned = !body.orientation.vec().isZero(0.0);
    const double* x = &position_[4 * p];
    const Vec3 d = nearest_image(Vec3(x[0], x[1], x[2]) - body.position);
    const int n = surface.shape->near(turned ? body.orientation.conjugate() * d : d, x[3], points);
    if (n == 0) {
      w.count = 0;
      continue;
    }
    const PairLaw& pair_law = law(material_[p], surface.material);
    // Each contact keeps the history of the facet it is on.
    if (n != 1 || w.count != 1 || w.entry[0].facet != points[0].facet) {
      WallEntry next[max_surface_points];
      for (int m = 0; m < n; ++m) {
        next[m] = WallEntry{points[m].facet, 0, {}};
        for (int o = 0; o < w.count; ++o)
          if (w.entry[o].facet == points[m].facet) next[m] = w.entry[o];
      }
      std::copy_n(next, n, w.entry);
      w.count = n;
    }
    for (int m = 0; m < n; ++m) {
      const Vec3 normal = turned ? body.orientation * points[m].normal : points[m].normal;
      Contact<double> contact;
      const double arm = x[3] - 0.5 * (x[3] - points[m].distance);
      const Vec3 lever = d - arm * normal;
      set_wall(contact, normal, points[m].distance, x, &velocity_[4 * p], &spin_[4 * p],
               body.velocity + body.spin.cross(lever), body.spin);
      contact.dt = settings_.time_step;
      evaluate(pair_law, contact, w.entry[m].history);
      const Vec3 tangential(contact.ftx, contact.fty, contact.ftz), rolling(contact.mx, contact.my, contact.mz);
      const Vec3 force = contact.fn * normal + tangential;
      const Vec3 torque = rolling - arm * normal.cross(tangential);
      double* load = &load_[8 * p];
      double* wrench = &chunk.wrench[6 * std::size_t(surface.body)];
      const Vec3 moment = lever.cross(force) + rolling;
      for (int k = 0; k < 3; ++k) {
        load[k] += force[k];
        load[4 + k] += torque[k];
        wrench[k] -= force[k];
        wrench[3 + k] -= moment[k];
      }
    }
  }
}

void Simulation::chunk_motion(std::size_t c) {
  Chunk& chunk = *chunks_[c];
  for (const Incoming& in : chunk.incoming) {
    const double* e = &chunks_[std::size_t(in.chunk)]->exported[8 * std::size_t(in.slot)];
    double* load = &load_[8 * std::size_t(in.particle)];
    for (int k = 0; k < 4; ++k) load[k] -= e[k];
    for (int k = 4; k < 8; ++k) load[k] += e[k];
  }
  DriftArrays a;
  a.position = position_.data();
  a.velocity = velocity_.data();
  a.spin = spin_.data();
  a.load = load_.data();
  a.body = body_of_.data();
  for (int k = 0; k < 3; ++k) a.gravity[k] = settings_.gravity[k];
  a.viscous = settings_.viscous;
  a.dt = settings_.time_step;
  a.kick_dt = first_step_ ? 0.5 * settings_.time_step : settings_.time_step;
  chunk.fastest = kernels_->drift(a, chunk.begin, chunk.end);
}

void Simulation::place_members(int k) {
  const auto b = std::size_t(k);
  const Body& body = bodies_[b];
  for (std::size_t m = 0; m < member_ids_[b].size(); ++m) {
    const auto slot = std::size_t(slot_of_[std::size_t(member_ids_[b][m])]);
    const Vec3 offset = body.orientation * member_offsets_[b][m];
    const Vec3 v = body.velocity + body.spin.cross(offset);
    for (int q = 0; q < 3; ++q) {
      position_[4 * slot + std::size_t(q)] = body.position[q] + offset[q];
      velocity_[4 * slot + std::size_t(q)] = v[q];
      spin_[4 * slot + std::size_t(q)] = body.spin[q];
    }
    for (std::size_t q = 0; q < 8; ++q) load_[8 * slot + q] = 0.0;
  }
}

void Simulation::move_bodies() {
  const double dt = settings_.time_step, kick = first_step_ ? 0.5 * dt : dt;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    Body& body = bodies_[b];
    body.force.setZero();
    body.torque.setZero();
    for (const auto& chunk : chunks_) {
      const double* w = &chunk->wrench[6 * b];
      body.force += Vec3(w[0], w[1], w[2]);
      body.torque += Vec3(w[3], w[4], w[5]);
    }
    double reach = 0.0;
    for (std::size_t m = 0; m < member_ids_[b].size(); ++m) {
      const auto slot = std::size_t(slot_of_[std::size_t(member_ids_[b][m])]);
      const double* l = &load_[8 * slot];
      const Vec3 offset = body.orientation * member_offsets_[b][m];
      body.force += Vec3(l[0], l[1], l[2]);
      body.torque += Vec3(l[4], l[5], l[6]) + offset.cross(Vec3(l[0], l[1], l[2]));
      reach = std::max(reach, offset.norm());
    }
    body_work_ -= (body.force.dot(body.velocity) + body.torque.dot(body.spin)) * kick;
    if (drives_[b]) drives_[b](time_, body);
    for (int k = 0; k < 3; ++k)
      if (body.free_translation[std::size_t(k)])
        body.velocity[k] += ((body.force[k] + body.applied_force[k]) / body.mass + settings_.gravity[k]) * kick;
    if (body.free_rotation) {
      const Mat3 R = body.orientation.toRotationMatrix();
      const Mat3 inertia = R * body.inertia * R.transpose();
      const Vec3 gyroscopic = body.spin.cross(inertia * body.spin);
      body.spin += inertia.ldlt().solve(body.torque - gyroscopic) * kick;
    }
    body.position += body.velocity * dt;
    const double angle = body.spin.norm() * dt;
    if (angle > 0.0) {
      body.orientation = Quat(Eigen::AngleAxisd(angle, body.spin.normalized())) * body.orientation;
      body.orientation.normalize();
    }
    place_members(static_cast<int>(b));
    for (const SurfaceOf& s : surfaces_)
      if (s.body == static_cast<int>(b)) reach = std::max(reach, s.shape->extent());
    double speed = body.velocity.norm();
    if (angle > 0.0) speed += body.spin.norm() * reach;
    largest_speed_ = std::max(largest_speed_, speed);
  }
}

void Simulation::run(std::int64_t n) {
  const std::function<void(std::size_t)> forces = [this](std::size_t c) { chunk_forces(c); };
  const std::function<void(std::size_t)> motion = [this](std::size_t c) { chunk_motion(c); };
  if (!prepared_) prepare();
  for (std::int64_t k = 0; k < n; ++k) {
    double before = seconds();
    const auto spent = [&before](double& on) {
      const double now = seconds();
      on += now - before;
      before = now;
    };
    // Two partners can close by twice the distance that the fastest has gone.
    if (!lists_valid_ || 2.0 * outer_moved_ > skin_)
      rebuild();
    else if (2.0 * inner_moved_ > inner_skin_)
      build_inner();
    spent(times_.lists);
    if (settings_.check_energy && (!checked_ || counters_.steps % check_interval == 0)) check_state();
    spent(times_.checks);
    crew_->run(chunks_.size(), forces);
    spent(times_.forces);
    crew_->run(chunks_.size(), motion);
    double fastest = 0.0;
    for (const auto& chunk : chunks_) {
      if (!(chunk->fastest <= fastest)) fastest = chunk->fastest;
      times_.walls += chunk->wall_seconds;
    }
    largest_speed_ = std::sqrt(fastest);
    spent(times_.motion);
    move_bodies();
    spent(times_.bodies);
    if (!std::isfinite(largest_speed_))
      throw RunError("a velocity is not a number after " + std::to_string(time_) + " s: the time step is too large");
    outer_moved_ += largest_speed_ * settings_.time_step;
    inner_moved_ += largest_speed_ * settings_.time_step;
    first_step_ = false;
    time_ += settings_.time_step;
    ++counters_.steps;
  }
}

// Energy may grow by what bodies put in, and by no more than half of what is there (the tangential spring's stiffness
// changes with the overlap, so that it is not conservative); a step too large multiplies it.
void Simulation::check_state() {
  const Energy e = energy();
  if (!std::isfinite(e.total()))
    throw RunError("energy is not a number after " + std::to_string(time_) + " s: the time step is too large");
  double heaviest = 0.0;
  for (std::size_t p = 0; p < id_.size(); ++p)
    if (velocity_[4 * p + 3] > 0.0 && body_of_[p] == is_free) heaviest = std::max(heaviest, 1.0 / velocity_[4 * p + 3]);
  const double work = body_work_ - checked_work_;
  const double scale = e.kinetic() + e.normal_springs + e.tangential_springs;
  const double floor = heaviest * settings_.gravity.norm() * smallest_radius_;
  if (checked_ && e.total() - checked_energy_ > work + 0.5 * (std::abs(work) + checked_scale_) + floor)
    throw RunError("energy grew from " + std::to_string(checked_energy_) + " J to " + std::to_string(e.total()) +
                   " J within " + std::to_string(check_interval) + " steps while bodies put in " +
                   std::to_string(work) + " J, after " + std::to_string(time_) + " s: take a smaller time step (now " +
                   std::to_string(settings_.time_step * 1e6) + " us)");
  checked_ = true;
  checked_energy_ = e.total();
  checked_work_ = body_work_;
  checked_scale_ = scale;
}

std::vector<int> Simulation::ids() const {
  std::vector<int> out;
  for (std::size_t id = 0; id < slot_of_.size(); ++id)
    if (slot_of_[id] >= 0 && body_of_[std::size_t(slot_of_[id])] == is_free) out.push_back(static_cast<int>(id));
  return out;
}
std::vector<int> Simulation::grains() const {
  std::vector<int> out;
  for (std::size_t id = 0; id < slot_of_.size(); ++id)
    if (slot_of_[id] >= 0 && body_of_[std::size_t(slot_of_[id])] < 0) out.push_back(static_cast<int>(id));
  return out;
}
std::size_t Simulation::particle_count() const { return id_.size(); }
Vec3 Simulation::position(int id) const {
  const double* x = &position_[4 * std::size_t(slot_of_[std::size_t(id)])];
  return {x[0], x[1], x[2]};
}
Vec3 Simulation::velocity(int id) const {
  const double* x = &velocity_[4 * std::size_t(slot_of_[std::size_t(id)])];
  return {x[0], x[1], x[2]};
}
Vec3 Simulation::spin(int id) const {
  const double* x = &spin_[4 * std::size_t(slot_of_[std::size_t(id)])];
  return {x[0], x[1], x[2]};
}
double Simulation::radius(int id) const { return position_[4 * std::size_t(slot_of_[std::size_t(id)]) + 3]; }
double Simulation::mass(int id) const { return 1.0 / velocity_[4 * std::size_t(slot_of_[std::size_t(id)]) + 3]; }

void Simulation::set_velocity(int id, const Vec3& velocity, const Vec3& spin) {
  const auto slot = std::size_t(slot_of_[std::size_t(id)]);
  for (int k = 0; k < 3; ++k) {
    velocity_[4 * slot + std::size_t(k)] = velocity[k];
    spin_[4 * slot + std::size_t(k)] = spin[k];
  }
  checked_ = false;
  largest_speed_ = std::max(largest_speed_, velocity.norm());
}

void Simulation::scale_density(double factor) {
  if (!(factor > 0.0) || !std::isfinite(factor)) throw InputError("density factor must be above 0");
  for (std::size_t p = 0; p < id_.size(); ++p) {
    if (body_of_[p] != is_free) continue;
    velocity_[4 * p + 3] /= factor;
    spin_[4 * p + 3] /= factor;
  }
  checked_ = false;
  prepared_ = false;
}

// Calls visit(a, b, contact, history) for every touching pair and visit(a, -1, ...) for every surface contact, with
// geometry and motion of now set.
template <class Visit>
void Simulation::visit_contacts(const Visit& visit) const {
  if (!lists_valid_) return;
  const int n = history_size_;
  for (const auto& chunk : chunks_) {
    for (const PairRun& run : chunk->runs)
      for (int s = run.begin; s < run.begin + run.count; ++s) {
        const auto i = std::size_t(chunk->pair_i[std::size_t(s)]), j = std::size_t(chunk->pair_j[std::size_t(s)]);
        const double *xi = &position_[4 * i], *xj = &position_[4 * j];
        const Vec3 d = nearest_image(Vec3(xi[0] - xj[0], xi[1] - xj[1], xi[2] - xj[2]));
        if (d.norm() >= xi[3] + xj[3]) continue;
        Contact<double> c;
        set_pair(c, d, xi, &velocity_[4 * i], &spin_[4 * i], xj, &velocity_[4 * j], &spin_[4 * j]);
        std::array<double, max_history> h{};
        for (int k = 0; k < n; ++k)
          h[std::size_t(k)] = chunk->history[history_at(s, k, n)];
        visit(int(i), int(j), laws_[std::size_t(run.law)], c, h);
      }
    SurfacePoint points[max_surface_points];
    for (const WallCandidate& w : chunk->walls) {
      const auto p = std::size_t(w.particle);
      const SurfaceOf& surface = surfaces_[std::size_t(w.surface)];
      const Body& body = bodies_[std::size_t(surface.body)];
      const double* x = &position_[4 * p];
      const Vec3 d = nearest_image(Vec3(x[0], x[1], x[2]) - body.position);
      const int count = surface.shape->near(body.orientation.conjugate() * d, x[3], points);
      for (int m = 0; m < count; ++m) {
        Contact<double> c;
        const Vec3 normal = body.orientation * points[m].normal;
        set_wall(c, normal, points[m].distance, x, &velocity_[4 * p], &spin_[4 * p],
                 body.velocity + body.spin.cross(d - (x[3] + points[m].distance) / 2.0 * normal), body.spin);
        std::array<double, max_history> h{};
        for (int o = 0; o < w.count; ++o)
          if (w.entry[o].facet == points[m].facet) std::copy_n(w.entry[o].history, max_history, h.begin());
        visit(int(p), -1, law(material_[p], surface.material), c, h);
      }
    }
  }
}

Energy Simulation::energy() const {
  Energy e;
  for (std::size_t p = 0; p < id_.size(); ++p) {
    if (body_of_[p] != is_free) continue;
    const double *x = &position_[4 * p], *v = &velocity_[4 * p], *w = &spin_[4 * p];
    e.translation += 0.5 / v[3] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    e.rotation += 0.5 / w[3] * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    e.gravity -= (settings_.gravity.x() * x[0] + settings_.gravity.y() * x[1] + settings_.gravity.z() * x[2]) / v[3];
  }
  visit_contacts([&](int, int, const PairLaw& pair_law, Contact<double>& c, std::array<double, max_history>& h) {
    c.dt = 0.0;
    std::array<double, max_history> unchanged = h;
    evaluate(pair_law, c, unchanged.data());
    e.normal_springs += 0.4 * c.kn * c.overlap * c.overlap;
    if (TangentialParts::histories[pair_law.tangential] == 3)
      e.tangential_springs += 0.5 * c.kt * (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
  });
  return e;
}

double Simulation::coordination() const {
  double sum = 0.0;
  visit_contacts([&](int i, int j, const PairLaw&, Contact<double>&, std::array<double, max_history>&) {
    if (body_of_[std::size_t(i)] == is_free) sum += 1.0;
    if (j >= 0 && body_of_[std::size_t(j)] == is_free) sum += 1.0;
  });
  return free_count_ > 0 ? sum / static_cast<double>(free_count_) : 0.0;
}

double Simulation::unbalanced_force() const {
  std::vector<Vec3> net(id_.size(), Vec3::Zero());
  std::vector<bool> touched(id_.size(), false);
  double sum = 0.0;
  std::size_t contacts = 0;
  visit_contacts([&](int i, int j, const PairLaw& pair_law, Contact<double>& c, std::array<double, max_history>& h) {
    c.dt = 0.0;
    evaluate(pair_law, c, h.data());
    const Vec3 f = c.fn * Vec3(c.nx, c.ny, c.nz) + Vec3(c.ftx, c.fty, c.ftz);
    net[std::size_t(i)] += f;
    touched[std::size_t(i)] = true;
    if (j >= 0) {
      net[std::size_t(j)] -= f;
      touched[std::size_t(j)] = true;
    }
    sum += f.norm();
    ++contacts;
  });
  double mean_net = 0.0;
  std::size_t count = 0;
  for (std::size_t p = 0; p < id_.size(); ++p)
    if (touched[p] && body_of_[p] == is_free) {
      mean_net += (net[p] + settings_.gravity / velocity_[4 * p + 3]).norm();
      ++count;
    }
  if (contacts == 0 || count == 0 || sum == 0.0) return 1.0;
  return mean_net / static_cast<double>(count) / (sum / static_cast<double>(contacts));
}

double Simulation::total_mass() const {
  double m = 0.0;
  for (std::size_t p = 0; p < id_.size(); ++p)
    if (body_of_[p] == is_free) m += 1.0 / velocity_[4 * p + 3];
  return m;
}

std::vector<Simulation::PairContact> Simulation::pair_contacts() const {
  std::vector<PairContact> out;
  visit_contacts([&](int i, int j, const PairLaw&, Contact<double>& c, std::array<double, max_history>& h) {
    if (j >= 0) out.push_back({id_[std::size_t(i)], id_[std::size_t(j)], c.overlap, h});
  });
  return out;
}

std::size_t Simulation::memory_bytes() const {
  const auto of = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  std::size_t sum = of(position_) + of(velocity_) + of(spin_) + of(load_) + of(id_) + of(body_of_) + of(material_) +
                    of(slot_of_) + of(order_) + of(scratch_) + of(int_scratch_) + of(cell_begin_) + of(cell_end_) +
                    of(carried_) + of(carried_walls_);
  for (const auto& c : chunks_)
    sum += sizeof(Chunk) + of(c->outer_start) + of(c->outer_j) + of(c->outer_slot) + of(c->outer_group) +
           of(c->pair_i) + of(c->pair_j) + of(c->next_i) + of(c->next_j) + of(c->history) + of(c->next_history) +
           of(c->exported) + of(c->incoming) + of(c->walls) + of(c->wrench);
  return sum;
}

namespace {

struct Writer {
  std::ostream& out;
  template <class T>
  void value(T& x) {
    static_assert(std::is_trivially_copyable_v<T>);
    out.write(reinterpret_cast<const char*>(&x), sizeof x);
  }
  template <class T>
  void vector(std::vector<T>& v) {
    std::uint64_t n = v.size();
    value(n);
    out.write(reinterpret_cast<const char*>(v.data()), static_cast<std::streamsize>(n * sizeof(T)));
  }
};

struct Reader {
  std::istream& in;
  template <class T>
  void value(T& x) {
    in.read(reinterpret_cast<char*>(&x), sizeof x);
    if (!in) throw InputError("the saved state ends too early");
  }
  template <class T>
  void vector(std::vector<T>& v) {
    std::uint64_t n = 0;
    value(n);
    // No more than what is there to be read: damage must not ask for all of the memory.
    const auto here = in.tellg();
    in.seekg(0, std::ios::end);
    const auto left = in.tellg() - here;
    in.seekg(here);
    if (!in || left < 0 || n > static_cast<std::uint64_t>(left) / sizeof(T)) throw InputError("the saved state ends too early");
    v.resize(n);
    in.read(reinterpret_cast<char*>(v.data()), static_cast<std::streamsize>(n * sizeof(T)));
    if (!in) throw InputError("the saved state ends too early");
  }
};

constexpr std::uint64_t state_mark = 0x31304D4544455254ull;  // "TREDEM01"

}  // namespace

template <class Archive>
void Simulation::archive(Archive& ar) {
  const auto fixed = [&](auto now, const char* what) {
    auto stored = now;
    ar.value(stored);
    if (stored != now) throw InputError(std::string("the saved state has another ") + what + " than this simulation");
  };
  fixed(state_mark, "format");
  fixed(std::uint64_t{materials_.size()}, "number of materials");
  fixed(std::uint64_t{bodies_.size()}, "number of bodies");
  fixed(std::uint64_t{surfaces_.size()}, "number of surfaces");
  for (int k = 0; k < 3; ++k) fixed(settings_.period[k], "period");
  ar.value(settings_.time_step);
  ar.value(settings_.viscous);
  for (auto* v : {&position_, &velocity_, &spin_, &load_}) ar.vector(*v);
  for (auto* v : {&id_, &body_of_, &slot_of_, &cell_begin_, &cell_end_}) ar.vector(*v);
  ar.vector(material_);
  ar.value(free_count_);
  const auto vec3 = [&](Vec3& v) {
    for (int k = 0; k < 3; ++k) ar.value(v[k]);
  };
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    Body& body = bodies_[b];
    for (Vec3* v : {&body.position, &body.velocity, &body.spin, &body.applied_force, &body.force, &body.torque})
      vec3(*v);
    for (int k = 0; k < 4; ++k) ar.value(body.orientation.coeffs()[k]);
    ar.value(body.free_translation);
    ar.value(body.free_rotation);
    ar.value(body.mass);
    ar.vector(member_ids_[b]);
    std::uint64_t members = member_offsets_[b].size();
    ar.value(members);
    member_offsets_[b].resize(members);
    for (Vec3& v : member_offsets_[b]) vec3(v);
  }
  std::uint64_t chunk_count = chunks_.size();
  ar.value(chunk_count);
  while (chunks_.size() < chunk_count) chunks_.push_back(std::make_unique<Chunk>());
  chunks_.resize(chunk_count);
  for (const auto& c : chunks_) {
    ar.value(c->begin);
    ar.value(c->end);
    for (auto* v : {&c->outer_start, &c->outer_j, &c->outer_slot, &c->pair_i, &c->pair_j}) ar.vector(*v);
    ar.vector(c->outer_group);
    for (auto* v : {&c->history, &c->exported, &c->wrench}) ar.vector(*v);
    ar.vector(c->runs);
    ar.vector(c->incoming);
    ar.vector(c->walls);
  }
  ar.vector(carried_);
  ar.vector(carried_walls_);
  ar.value(chunk_size_);
  ar.value(cells_);
  vec3(cell_origin_);
  vec3(cell_size_);
  for (double* x : {&largest_radius_, &smallest_radius_, &skin_, &inner_skin_, &outer_moved_, &inner_moved_,
                    &largest_speed_, &time_, &body_work_, &checked_energy_, &checked_work_, &checked_scale_})
    ar.value(*x);
  for (bool* x : {&checked_, &first_step_, &lists_valid_}) ar.value(*x);
  ar.value(counters_);
}

void Simulation::save(std::ostream& out) const {
  Writer writer{out};
  const_cast<Simulation*>(this)->archive(writer);  // the writer only reads
  if (!out) throw RunError("the state could not be written");
}

void Simulation::load(std::istream& in) {
  Reader reader{in};
  archive(reader);
  if (id_.empty()) {
    prepared_ = false;
    return;
  }
  const double skin = skin_;
  const bool valid = lists_valid_;
  lists_valid_ = false;  // prepare() must not take histories out of the lists it is about to keep
  prepare();
  skin_ = skin;
  lists_valid_ = valid;
}

}  // namespace terrode::dem
