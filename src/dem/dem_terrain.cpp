#include "dem/dem_terrain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <sstream>

#include "wheel/body.h"

namespace terrode::dem {

Problems DemTerrainParams::validate() const {
  Problems problems;
  if (prism.grains.empty()) problems.push_back({{}, 0, 0, "prism", "has no grains", "a settled bed"});
  if (tiles_y < 1) problems.push_back({{}, 0, 0, "tiles_y", "is below 1", "1 or more"});
  const auto positive = [&](const char* key, double value, const char* unit) {
    require(problems, key, value, unit, value > 0.0, "above 0");
  };
  positive("window_ahead", window_ahead, "m");
  positive("window_behind", window_behind, "m");
  positive("shell_diameter", shell_diameter, "m");
  require(problems, "shell_spacing", shell_spacing, "-", shell_spacing > 0.0 && shell_spacing <= 1.5,
          "above 0, at most 1.5");
  positive("gravity", gravity, "m/s2");
  require(problems, "full_length", full_length, "m", full_length >= 0.0, "0 (none) or more");
  if (full_length > 0.0) {
    require(problems, "full_behind", full_behind, "m", full_behind > 0.0 && full_behind < full_length,
            "above 0, below the bed's length");
    require(problems, "border", border, "m", border >= 0.0 && 2.0 * border < full_length && 2.0 * border < prism.length * tiles_y,
            "0 or more, below half the bed");
  }
  require(problems, "time_step", time_step, "s", time_step >= 0.0, "0 (suggested) or more");
  for (const Problems& more : {soil.validate(), wheel.validate(), floor.validate()})
    problems.insert(problems.end(), more.begin(), more.end());
  return problems;
}

double surface_level(const Bed& bed) {
  constexpr int n = 24;
  double sum = 0.0;
  const auto nearest = [](double d, double period) { return d - period * std::nearbyint(d / period); };
  for (int k = 0; k < n * n; ++k) {
    const int column = k % n, row = k / n;
    const double x = (column + 0.5) / n * bed.width, y = (row + 0.5) / n * bed.length;
    double top = 0.0;
    for (const Grain& g : bed.grains) {
      const double dx = nearest(g.position.x() - x, bed.width), dy = nearest(g.position.y() - y, bed.length);
      const double below = g.radius * g.radius - dx * dx - dy * dy;
      if (below > 0.0) top = std::max(top, g.position.z() + std::sqrt(below));
    }
    sum += top / (n * n);
  }
  return sum;
}

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

DemTerrain::DemTerrain(DemTerrainParams params) : params_(std::move(params)) {
  throw_if_any(params_.validate());
  depth_ = surface_level(params_.prism);
  for (const Grain& g : params_.prism.grains) largest_ = std::max(largest_, 2.0 * g.radius);
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

double DemTerrain::bed_width() const { return params_.prism.length * params_.tiles_y; }

terrain::BodyId DemTerrain::add_body(std::shared_ptr<const wheel::Body> shape) {
  if (!shape) throw InputError("a body needs a shape");
  if (laid_) throw InputError("bodies are put on particles before the first step");
  if (params_.surface == WheelSurface::spheres && (!shape->rolling() || !shape->plain_cylinder()))
    throw InputError("a shell of spheres is made for plain cylindrical wheels only");
  Touching t;
  t.shape = std::move(shape);
  Body body;
  body.position = Vec3(0.0, 0.0, 1e3);  // out of the way until its first motion
  t.body = simulation_->add_body(body);
  if (params_.surface == WheelSurface::spheres) {
    const wheel::Rolling* rim = t.shape->rolling();
    simulation_->add_members(t.body,
                             shell_of_spheres(rim->radius, rim->width, params_.shell_diameter, params_.shell_spacing),
                             wheel_material_);
  } else {
    simulation_->add_surface(t.body, make_shape(t.shape), wheel_material_);
  }
  bodies_.push_back(std::move(t));
  results_.emplace_back();
  return static_cast<terrain::BodyId>(bodies_.size()) - 1;
}

DemTerrain::Touching& DemTerrain::known(terrain::BodyId body) {
  if (body < 0 || static_cast<std::size_t>(body) >= bodies_.size())
    throw InputError("a body that is not on this ground");
  return bodies_[static_cast<std::size_t>(body)];
}

void DemTerrain::begin_step(double t, double h) {
  if (in_step_) throw RunError("the step before was not ended");
  if (!std::isfinite(t) || !std::isfinite(h) || !(h > 0.0)) throw InputError("a step needs a length above 0");
  step_start_ = t;
  step_length_ = h;
  in_step_ = true;
  computed_ = false;
  for (Touching& b : bodies_) b.announced = false;
}

void DemTerrain::set_motion(terrain::BodyId body, const Pose& pose, const Twist& twist) {
  if (!in_step_) throw RunError("a motion outside a step");
  terrain::require_finite(pose, twist, "the particle ground");
  Touching& b = known(body);
  const bool same = b.announced && b.pose.p_W == pose.p_W && b.pose.R_WB.coeffs() == pose.R_WB.coeffs() &&
                    b.twist.v_W == twist.v_W && b.twist.w_W == twist.w_W;
  if (same) return;
  b.announced = true;
  b.pose = pose;
  b.twist = twist;
  if (computed_) {
    set_state(before_);
    computed_ = false;
  }
}

terrain::ContactResult DemTerrain::wrench(terrain::BodyId body, const Pose& pose, const Twist& twist) {
  set_motion(body, pose, twist);
  if (!computed_) advance();
  return results_[static_cast<std::size_t>(body)];
}

void DemTerrain::end_step() {
  if (!in_step_) throw RunError("no step to end");
  if (!computed_) advance();  // bodies that were announced, or none: the grains go on by themselves
  half_chord_ = half_chord();
  in_step_ = false;
}

// Lays all of a full bed and fixes its border; later, says where a body has left it.
void DemTerrain::lay_full() {
  const double tile_length = params_.prism.width, from = -params_.full_behind, to = from + params_.full_length;
  for (const Touching& b : bodies_) {
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

// Half of what a grain's height above the surface cuts out of the circles that hold the bodies, at the deepest so far.
double DemTerrain::half_chord() const {
  double out = half_chord_;
  for (const Touching& b : bodies_) {
    if (!b.announced) continue;
    const double radius = b.shape->outer_radius(), above = b.pose.p_W.z() - largest_;
    if (std::abs(above) < radius) out = std::max(out, above > 0.0 ? std::sqrt(radius * radius - above * above) : radius);
  }
  return out;
}

// Lays tiles and moves the window so that every announced body is inside.
void DemTerrain::lay_window() {
  if (params_.full_length > 0.0) return lay_full();
  double from = 0.0, to = 0.0;
  bool any = false;
  for (const Touching& b : bodies_) {
    if (!b.announced) continue;
    const double x = b.pose.p_W.x();
    from = any ? std::min(from, x) : x;
    to = any ? std::max(to, x) : x;
    any = true;
  }
  if (!any) return;
  const double chord = half_chord();
  // A prism that is long along the travel thaws and freezes in stretches about as long as it is wide.
  const double tile_length = params_.prism.width;
  const long stretches = std::max(1L, std::lround(tile_length / params_.prism.length));
  const double stretch = tile_length / static_cast<double>(stretches);
  const auto stretch_of = [stretch](double x) { return static_cast<long>(std::floor(x / stretch)); };
  const auto tile_of = [stretches](long k) { return k >= 0 ? k / stretches : -((stretches - 1 - k) / stretches); };
  const long need_from = stretch_of(from - std::max(params_.window_behind, chord)),
             need_to = stretch_of(to + std::max(params_.window_ahead, chord));
  if (laid_ && need_from == free_from_ && need_to == free_to_) return;
  // A frozen stretch or more beyond either end of the window holds the grains in.
  const Bed strip = tile(params_.prism, 1, params_.tiles_y);
  const auto lay = [&](long k) {
    add_bed(*simulation_, strip, soil_, Vec3(static_cast<double>(k) * tile_length, -0.5 * bed_width(), -depth_));
  };
  const long first = tile_of(need_from - 1), last = tile_of(need_to + 1);
  if (!laid_) {
    first_tile_ = first;
    last_tile_ = first_tile_ - 1;
  }
  while (last_tile_ < last) lay(++last_tile_);
  while (first_tile_ > first) lay(--first_tile_);
  free_from_ = need_from;
  free_to_ = need_to;
  laid_ = true;
  // A grain that a body may touch before the window moves on stays free: frozen, it would stand like a rock.
  const auto beside_a_body = [&](const Vec3& x, double radius) {
    return std::any_of(bodies_.begin(), bodies_.end(), [&](const Touching& b) {
      return b.announced && std::hypot(x.x() - b.pose.p_W.x(), x.z() - b.pose.p_W.z()) < b.shape->outer_radius() + radius + largest_;
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
  for (const Touching& b : bodies_) {
    if (!b.announced) continue;
    if (simulation_->body(b.body).position.z() > 1e2)  // its first motion
      simulation_->place_body(b.body, b.pose.p_W, b.pose.R_WB);
  }
  before_ = state();
  Simulation& sim = *simulation_;
  if (time_step_ == 0.0) time_step_ = params_.time_step > 0.0 ? params_.time_step : sim.suggested_time_step();
  const auto n = static_cast<std::int64_t>(std::ceil(step_length_ / time_step_ * (1.0 - 1e-12)));
  const double dt = step_length_ / static_cast<double>(n);
  if (sim.time_step() == 0.0 || std::abs(sim.time_step() / dt - 1.0) > 1e-9) sim.set_time_step(dt);
  // The loop that calls moves a body with the velocity it finds after this force; what the particles' body is behind or
  // ahead by is made up for in a few steps, so that neither jumps.
  constexpr double share = 0.2;
  for (Touching& b : bodies_) {
    Body& body = sim.body(b.body);
    if (!b.announced) {
      body.velocity.setZero();
      body.spin.setZero();
      continue;
    }
    body.velocity = b.twist.v_W + share / step_length_ * (b.pose.p_W - body.position);
    const Eigen::AngleAxisd turn(b.pose.R_WB * body.orientation.conjugate());
    double angle = turn.angle();
    if (angle > std::numbers::pi) angle -= 2.0 * std::numbers::pi;
    body.spin = b.twist.w_W + share / step_length_ * angle * turn.axis();
  }
  std::vector<Wrench> sum(bodies_.size());
  for (std::int64_t s = 0; s < n; ++s) {
    sim.run(1);
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      const Body& body = sim.body(bodies_[k].body);
      sum[k] += {body.force, body.torque};
    }
  }
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    terrain::ContactResult& r = results_[k];
    r = {};
    r.wrench = sum[k] * (1.0 / static_cast<double>(n));
    const Touching& b = bodies_[k];
    if (!b.announced) continue;
    const Body& body = sim.body(b.body);
    const Vec3 lowest = body.orientation * b.shape->support(body.orientation.conjugate() * -Vec3::UnitZ());
    r.max_sinkage = std::max(0.0, -(body.position.z() + lowest.z()));
    r.contact_count = sim.contacts_of_body(b.body);
    const double power = -(r.wrench.F_W.dot(body.velocity) + r.wrench.M_W.dot(body.spin));
    r.plastic_power = std::max(0.0, power);
  }
  computed_ = true;
}

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
  const double origin = params_.full_length > 0.0 ? -params_.full_behind : 0.0;
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

double DemTerrain::roughness() const {
  double top = 0.0;
  for (const Grain& g : params_.prism.grains) top = std::max(top, g.position.z() + g.radius);
  return top - depth_;
}

std::string DemTerrain::state() const {
  std::ostringstream out;
  const auto put = [&](const auto& v) { out.write(reinterpret_cast<const char*>(&v), sizeof v); };
  put(laid_), put(first_tile_), put(last_tile_), put(free_from_), put(free_to_), put(half_chord_), put(time_step_);
  simulation_->save(out);
  return std::move(out).str();
}

void DemTerrain::set_state(const std::string& bytes) {
  std::istringstream in(bytes);
  const auto get = [&](auto& v) { in.read(reinterpret_cast<char*>(&v), sizeof v); };
  get(laid_), get(first_tile_), get(last_tile_), get(free_from_), get(free_to_), get(half_chord_), get(time_step_);
  if (!in) throw InputError("the saved ground ends too early");
  simulation_->load(in);
}

std::vector<std::uint8_t> DemTerrain::snapshot() const {
  if (in_step_) throw RunError("a snapshot within a step");
  const std::string s = state();
  return {s.begin(), s.end()};
}

void DemTerrain::restore(std::span<const std::uint8_t> bytes) {
  in_step_ = false;
  set_state(std::string(bytes.begin(), bytes.end()));
}

}  // namespace terrode::dem
