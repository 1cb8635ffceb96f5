#include "dem/dem_terrain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <sstream>

#include "wheel/body.h"

namespace terrode::dem {

std::vector<Member> shell_of_spheres(double radius, double width, double diameter, double spacing) {
  const double r = 0.5 * diameter, step = spacing * r;
  std::vector<Member> out;
  const auto ring = [&](double at_radius, double y) {
    const int n = std::max(1, static_cast<int>(std::ceil(2.0 * std::numbers::pi * at_radius / step)));
    for (int k = 0; k < n; ++k) {
      const double a = 2.0 * std::numbers::pi * k / n;
      out.push_back({Vec3(at_radius * std::sin(a), y, -at_radius * std::cos(a)), r});
    }
  };
  const double rim = radius - r, half = 0.5 * width - r;
  const int across = std::max(1, static_cast<int>(std::ceil(2.0 * half / step)));
  for (int k = 0; k <= across; ++k) ring(rim, -half + 2.0 * half * k / across);
  for (const double y : {-half, half})
    for (double q = rim - step; q > 0.5 * radius; q -= step) ring(q, y);
  return out;
}

DemTerrain::DemTerrain(DemTerrainParams params) : ParticleGround(std::move(params)) {
  Settings settings;
  settings.gravity = Vec3(0.0, 0.0, -params_.gravity);
  settings.period = Vec3(0.0, bed_width(), 0.0);
  settings.threads = params_.threads;
  settings.time_step = params_.time_step;
  simulation_ = std::make_unique<Simulation>(settings);
  soil_ = simulation_->add_material(params_.prism.grain);
  const int floor =
      simulation_->add_material({"floor", params_.prism.grain.young_modulus, params_.prism.grain.poisson_ratio});
  wheel_material_ =
      simulation_->add_material({"wheel", params_.prism.grain.young_modulus, params_.prism.grain.poisson_ratio});
  simulation_->set_interaction(soil_, soil_, params_.soil);
  simulation_->set_interaction(soil_, floor, params_.floor);
  simulation_->set_interaction(soil_, wheel_material_, params_.wheel);
  simulation_->set_interaction(wheel_material_, wheel_material_, params_.wheel);
  simulation_->set_interaction(wheel_material_, floor, params_.floor);
  simulation_->add_surface(simulation_->add_body({}), make_plane(Vec3::UnitZ(), -depth_), floor);
}

DemTerrain::~DemTerrain() = default;

terrain::BodyId DemTerrain::add_body(std::shared_ptr<const wheel::Body> shape) {
  if (!shape) throw InputError("a body needs a shape");
  if (laid_) throw InputError("bodies are put on particles before the first step");
  if (params_.surface == WheelSurface::spheres && (!shape->rolling() || !shape->plain_cylinder()))
    throw InputError("a shell of spheres is made for plain cylindrical wheels only");
  Body body;
  body.position = Vec3(0.0, 0.0, 1e3);  // out of the way until its first motion
  const int engine = simulation_->add_body(body);
  if (params_.surface == WheelSurface::spheres) {
    const wheel::Rolling* rim = shape->rolling();
    simulation_->add_members(engine, shell_of_spheres(rim->radius, rim->width, params_.shell_diameter, params_.shell_spacing),
                             wheel_material_);
  } else {
    simulation_->add_surface(engine, make_shape(shape), wheel_material_);
  }
  engine_.push_back(engine);
  return keep(std::move(shape));
}

// Lays all of a full bed and fixes its border; later, says where a body has left it.
void DemTerrain::lay_full() {
  const double tile_length = params_.prism.width, from = -params_.full_behind, to = from + params_.full_length;
  for (const Announced& b : bodies_) {
    if (!b.announced || !laid_) continue;
    const double x = b.pose.p_W.x();
    if (x < from + params_.border || x > to - params_.border)
      throw RunError(fmt::format("the wheel is at x = {:.4g} m, beyond the full bed from {:.4g} to {:.4g} m: give it more length "
                                 "or travel less",
                                 x, from, to));
  }
  if (laid_) return;
  const auto count = static_cast<long>(std::ceil(params_.full_length / tile_length - 1e-9));
  const Bed strip = tile(params_.prism, 1, params_.tiles_y);
  for (long k = 0; k < count; ++k)
    add_bed(*simulation_, strip, soil_,
            Vec3(from + static_cast<double>(k) * tile_length, -0.5 * bed_width(), -depth_));
  laid_ = true;
  first_tile_ = free_from_ = 0;
  last_tile_ = free_to_ = count - 1;
  const double end = from + static_cast<double>(count) * tile_length, side = 0.5 * bed_width() - params_.border;
  simulation_->set_frozen(
      [&](const Vec3& x, double) {
        return x.x() < from + params_.border || x.x() > end - params_.border ||
               (params_.border > 0.0 && std::abs(x.y()) > side);
      },
      params_.prism.grain_density);
}

// Lays tiles and moves the window so that every announced body is inside.
void DemTerrain::lay_window() {
  if (full()) return lay_full();
  const std::optional<Range> need = window();
  if (!need || (laid_ && need->first == free_from_ && need->second == free_to_)) return;
  const double tile_length = params_.prism.width;
  const auto tile_of = [n = stretches()](long k) { return k >= 0 ? k / n : -((n - 1 - k) / n); };
  // A frozen stretch or more beyond either end of the window holds the grains in.
  const Bed strip = tile(params_.prism, 1, params_.tiles_y);
  const auto lay = [&](long k) {
    add_bed(*simulation_, strip, soil_, Vec3(static_cast<double>(k) * tile_length, -0.5 * bed_width(), -depth_));
  };
  const long first = tile_of(need->first - 1), last = tile_of(need->second + 1);
  if (!laid_) {
    first_tile_ = first;
    last_tile_ = first_tile_ - 1;
  }
  while (last_tile_ < last) lay(++last_tile_);
  while (first_tile_ > first) lay(--first_tile_);
  free_from_ = need->first;
  free_to_ = need->second;
  laid_ = true;
  // A grain that a body may touch before the window moves on stays free: frozen, it would stand like a rock.
  const auto beside_a_body = [&](const Vec3& x, double radius) {
    return std::any_of(bodies_.begin(), bodies_.end(), [&](const Announced& b) {
      return b.announced && std::hypot(x.x() - b.pose.p_W.x(), x.z() - b.pose.p_W.z()) < reach(b) + radius;
    });
  };
  simulation_->set_frozen(
      [&](const Vec3& x, double radius) {
        const long k = stretch_of(x.x());
        return (k < free_from_ || k > free_to_) && !beside_a_body(x, radius);
      },
      params_.prism.grain_density);
}

void DemTerrain::advance() {
  lay_window();
  Simulation& sim = *simulation_;
  for (std::size_t k = 0; k < bodies_.size(); ++k)
    if (bodies_[k].announced && sim.body(engine_[k]).position.z() > 1e2)  // its first motion
      sim.place_body(engine_[k], bodies_[k].pose.p_W, bodies_[k].pose.R_WB);
  before_ = state();
  if (time_step_ == 0.0) time_step_ = params_.time_step > 0.0 ? params_.time_step : sim.suggested_time_step();
  const auto n = static_cast<std::int64_t>(std::ceil(step_length() / time_step_ * (1.0 - 1e-12)));
  const double dt = step_length() / static_cast<double>(n);
  if (sim.time_step() == 0.0 || std::abs(sim.time_step() / dt - 1.0) > 1e-9) sim.set_time_step(dt);
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    Body& body = sim.body(engine_[k]);
    const Twist twist = following(bodies_[k], {body.position, body.orientation});
    body.velocity = twist.v_W;
    body.spin = twist.w_W;
  }
  std::vector<Wrench> sum(bodies_.size());
  for (std::int64_t s = 0; s < n; ++s) {
    sim.run(1);
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      const Body& body = sim.body(engine_[k]);
      sum[k] += {body.force, body.torque};
    }
  }
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    const Body& body = sim.body(engine_[k]);
    answer(k, sum[k] * (1.0 / static_cast<double>(n)), {body.position, body.orientation}, {body.velocity, body.spin},
           sim.contacts_of_body(engine_[k]));
  }
}

void DemTerrain::take_back() { set_state(before_); }

double DemTerrain::height(double x, double y) const {
  double top = -depth_;
  const double width = bed_width();
  simulation_->for_each_grain([&](const Vec3& p, double r) {
    const double dx = x - p.x();
    double dy = y - p.y();
    dy -= width * std::nearbyint(dy / width);
    const double below = r * r - dx * dx - dy * dy;
    if (below > 0.0) top = std::max(top, p.z() + std::sqrt(below));
  });
  const double origin = full() ? -params_.full_behind : 0.0;
  return laid_ && x >= origin + static_cast<double>(first_tile_) * params_.prism.width &&
                 x <= origin + static_cast<double>(last_tile_ + 1) * params_.prism.width
             ? top
             : 0.0;
}

void DemTerrain::particles(std::vector<float>& position, std::vector<float>& radius) const {
  const double width = bed_width();
  for (const int id : simulation_->grains()) {
    Vec3 p = simulation_->position(id);
    p.y() -= width * std::nearbyint(p.y() / width);
    for (const double x : p) position.push_back(static_cast<float>(x));
    radius.push_back(static_cast<float>(simulation_->radius(id)));
  }
}

std::string DemTerrain::state() const {
  std::ostringstream out;
  const auto put = [&](const auto& v) { out.write(reinterpret_cast<const char*>(&v), sizeof v); };
  put(laid_), put(first_tile_), put(last_tile_), put(free_from_), put(free_to_), put(kept_chord_), put(time_step_);
  simulation_->save(out);
  return std::move(out).str();
}

void DemTerrain::set_state(const std::string& bytes) {
  std::istringstream in(bytes);
  const auto get = [&](auto& v) { in.read(reinterpret_cast<char*>(&v), sizeof v); };
  get(laid_), get(first_tile_), get(last_tile_), get(free_from_), get(free_to_), get(kept_chord_), get(time_step_);
  if (!in) throw InputError("the saved ground ends too early");
  simulation_->load(in);
}

std::vector<std::uint8_t> DemTerrain::snapshot() const {
  if (in_step()) throw RunError("a snapshot within a step");
  const std::string s = state();
  return {s.begin(), s.end()};
}

void DemTerrain::restore(std::span<const std::uint8_t> bytes) {
  abandon_step();
  set_state(std::string(bytes.begin(), bytes.end()));
}

}  // namespace terrode::dem
