#include "vehicle/frame_recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "terrain/particle_view.h"
#include "vehicle/vehicle.h"
#include "wheel/convex.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {
namespace {

// The loaded nodes under each body now. A ground tells them within a step alone: one is tried on it and taken back.
std::vector<std::vector<terrain::PatchNode>> pressed_nodes(Simulation& simulation) {
  terrain::Terrain& ground = simulation.ground();
  std::vector<std::vector<terrain::PatchNode>> out(simulation.contacts().size());
  if (ground.sampling() != terrain::Sampling::point_value) return out;
  const std::vector<std::uint8_t> before = ground.snapshot();
  constexpr double kTrialStep = 1e-3;  // s; any length: forces are those at its beginning
  ground.begin_step(simulation.time(), kTrialStep);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const GroundContact& c = simulation.contacts()[i];
    ground.wrench(c.id, c.body->pose(), c.body->twist());
    out[i] = ground.patch(c.id);
  }
  ground.end_step();
  ground.restore(before);
  return out;
}

}  // namespace

Problems FrameSettings::validate() const {
  Problems p;
  require(p, "frames.interval", interval, "s", interval > 0.0, "a time above 0");
  require(p, "frames.spacing", spacing, "m", spacing > 0.0, "a length above 0");
  require(p, "frames.x_max", x_max, "m", x_max - x_min >= spacing, "above x_min by at least the spacing");
  require(p, "frames.y_max", y_max, "m", y_max - y_min >= spacing, "above y_min by at least the spacing");
  return p;
}

FrameSettings frame_settings(const Rig& rig, std::size_t frames) {
  const wheel::Rolling& rim = *rig.shape().rolling();
  const RigMotion& motion = rig.motion();
  const double omega_r = motion.angular_velocity * rim.radius;
  double speed = motion.forward_velocity.value_or(omega_r);
  if (motion.mode == RigMode::imposed_slip && std::isfinite(motion.slip)) speed = omega_r * (1.0 - motion.slip);
  double travel = speed * rig.planned_seconds();
  if (!motion.duration) travel = std::clamp(travel, -motion.distance - rim.radius, motion.distance + rim.radius);
  FrameSettings s;
  s.interval = std::max(rig.planned_seconds() / static_cast<double>(std::max<std::size_t>(frames, 1)), rig.spec().time_step);
  const double margin = 1.5 * rim.radius, from = rig.spec().start_x;
  s.x_min = from + std::min(travel, 0.0) - margin;
  s.x_max = from + std::max(travel, 0.0) + margin;
  s.y_min = rig.spec().start_y - 0.5 * rim.width - 0.5 * rim.radius;
  s.y_max = rig.spec().start_y + 0.5 * rim.width + 0.5 * rim.radius;
  constexpr double kNodesARadius = 40.0, kMostAlong = 400.0;
  s.spacing = std::max(rim.radius / kNodesARadius, (s.x_max - s.x_min) / kMostAlong);
  s.names = {"wheel"};
  return s;
}

FrameSettings frame_settings(Vehicle& vehicle, const std::vector<Eigen::Vector2d>& path, double duration,
                             std::size_t frames) {
  FrameSettings s;
  s.interval = std::max(duration / static_cast<double>(std::max<std::size_t>(frames, 1)), vehicle.options().time_step);
  double reach = 0.0, radius = std::numeric_limits<double>::infinity();
  for (const VehicleWheelSpec& w : vehicle.spec().wheels) {
    reach = std::max(reach, w.centre.head<2>().norm() + w.shape.radius + 0.5 * w.shape.width);
    radius = std::min(radius, w.shape.radius);
    s.names.push_back(w.name);
  }
  for (const BodySpec& b : vehicle.spec().bodies)
    (b.touches_ground ? s.names.push_back(b.name) : s.boxes.push_back({b.name, &vehicle.body(b.name), b.size}));
  for (const RockSpec& r : vehicle.options().rocks)
    if (!r.fixed) s.names.push_back(r.name);
  s.x_min = s.y_min = std::numeric_limits<double>::infinity();
  s.x_max = s.y_max = -s.x_min;
  for (const Eigen::Vector2d& p : path) {
    s.x_min = std::min(s.x_min, p.x() - 1.3 * reach);
    s.x_max = std::max(s.x_max, p.x() + 1.3 * reach);
    s.y_min = std::min(s.y_min, p.y() - 1.3 * reach);
    s.y_max = std::max(s.y_max, p.y() + 1.3 * reach);
  }
  constexpr double kNodesARadius = 12.0, kMostAlong = 400.0;
  s.spacing = std::max({radius / kNodesARadius, (s.x_max - s.x_min) / kMostAlong, (s.y_max - s.y_min) / kMostAlong});
  return s;
}

FrameRecorder::FrameRecorder(const FrameSettings& settings) : settings_(settings) { throw_if_any(settings.validate()); }

void FrameRecorder::lay_out(Simulation& simulation) {
  for (std::size_t i = 0; i < simulation.contacts().size(); ++i) {
    const wheel::Body& shape = *simulation.contacts()[i].shape;
    recording::FrameBody b;
    b.name = i < settings_.names.size() ? settings_.names[i] : fmt::format("body_{}", i + 1);
    if (const wheel::Rolling* rim = shape.rolling()) {
      b.radius = rim->radius;
      b.width = rim->width;
      if (const auto* w = dynamic_cast<const wheel::Wheel*>(&shape)) {
        b.grouser_count = w->shape().grousers.count;
        b.grouser_height = w->shape().grousers.height;
        b.grouser_thickness = w->shape().grousers.thickness;
      }
    } else if (dynamic_cast<const wheel::Sphere*>(&shape) != nullptr) {
      b.shape = recording::FrameBody::Shape::sphere;
      b.radius = shape.bounding_radius();
    } else {
      b.shape = recording::FrameBody::Shape::box;
      b.size = Vec3(shape.support(Vec3::UnitX()).x() - shape.support(-Vec3::UnitX()).x(),
                    shape.support(Vec3::UnitY()).y() - shape.support(-Vec3::UnitY()).y(),
                    shape.support(Vec3::UnitZ()).z() - shape.support(-Vec3::UnitZ()).z());
    }
    layout_.bodies.push_back(std::move(b));
  }
  for (const FrameSettings::Box& box : settings_.boxes) {
    recording::FrameBody b;
    b.name = box.name;
    b.shape = recording::FrameBody::Shape::box;
    b.size = box.size;
    layout_.bodies.push_back(std::move(b));
  }
  recording::FrameGround g;
  g.x0 = settings_.x_min;
  g.y0 = settings_.y_min;
  g.spacing = settings_.spacing;
  g.columns = static_cast<std::size_t>(std::floor((settings_.x_max - settings_.x_min) / g.spacing + 1e-9)) + 1;
  g.rows = static_cast<std::size_t>(std::floor((settings_.y_max - settings_.y_min) / g.spacing + 1e-9)) + 1;
  for (std::size_t j = 0; j < g.rows; ++j)
    for (std::size_t i = 0; i < g.columns; ++i)
      g.undisturbed.push_back(static_cast<float>(simulation.ground().undisturbed_height(
          g.x0 + static_cast<double>(i) * g.spacing, g.y0 + static_cast<double>(j) * g.spacing)));
  g.pressure = true;
  layout_.ground = std::move(g);
}

void FrameRecorder::observe(double time, Simulation& simulation) {
  constexpr double kRounding = 1e-9;  // of an interval: times are sums of steps
  if (frames_.empty()) {
    lay_out(simulation);
    next_ = time;
  } else if (time < next_ - kRounding * settings_.interval || time <= frames_.back().time) {
    return;
  }
  while (next_ <= time + kRounding * settings_.interval) next_ += settings_.interval;

  const recording::FrameGround& g = *layout_.ground;
  recording::Frame frame;
  frame.time = time;
  frame.height.reserve(g.columns * g.rows);
  for (std::size_t j = 0; j < g.rows; ++j)
    for (std::size_t i = 0; i < g.columns; ++i)
      frame.height.push_back(static_cast<float>(simulation.ground().height(g.x0 + static_cast<double>(i) * g.spacing,
                                                                           g.y0 + static_cast<double>(j) * g.spacing)));
  frame.pressure.assign(g.columns * g.rows, 0.0f);
  const auto patches = pressed_nodes(simulation);
  for (const GroundContact& c : simulation.contacts()) {
    frame.bodies.push_back({c.body->pose(), c.wrench});
    for (const terrain::PatchNode& n : patches[frame.bodies.size() - 1]) {
      // A node stands for a square of its own area, and for at least one node of the grid.
      const double reach = std::max(0.5 * std::sqrt(std::max(n.area, 0.0)), 0.5 * g.spacing);
      const auto span = [&](double at, double origin, std::size_t count) {
        const auto from = static_cast<std::ptrdiff_t>(std::ceil((at - reach - origin) / g.spacing));
        const auto to = static_cast<std::ptrdiff_t>(std::floor((at + reach - origin) / g.spacing));
        return std::pair{std::max<std::ptrdiff_t>(from, 0), std::min(to, static_cast<std::ptrdiff_t>(count) - 1)};
      };
      const auto [i0, i1] = span(n.p_W.x(), g.x0, g.columns);
      const auto [j0, j1] = span(n.p_W.y(), g.y0, g.rows);
      for (std::ptrdiff_t j = j0; j <= j1; ++j)
        for (std::ptrdiff_t i = i0; i <= i1; ++i) {
          float& p = frame.pressure[static_cast<std::size_t>(j) * g.columns + static_cast<std::size_t>(i)];
          p = std::max(p, static_cast<float>(n.pressure));
        }
    }
  }
  for (const FrameSettings::Box& box : settings_.boxes) frame.bodies.push_back({box.body->pose(), {}});
  if (const auto* view = dynamic_cast<const terrain::ParticleView*>(&simulation.ground())) {
    const std::size_t before = radius_.size();
    radius_.clear();
    view->particles(frame.position, radius_);
    if (radius_.size() < before) throw RunError("particles were lost between two frames");
  }
  frames_.push_back(std::move(frame));
}

std::vector<std::uint8_t> FrameRecorder::state() const {
  std::vector<std::uint8_t> out;
  const auto put = [&out](const void* data, std::size_t size) {
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    out.insert(out.end(), bytes, bytes + size);
  };
  const auto put_all = [&put](const auto& values) {
    const std::uint64_t n = values.size();
    put(&n, sizeof n);
    if (n > 0) put(values.data(), n * sizeof values[0]);
  };
  std::vector<double> numbers = {next_};
  for (const recording::Frame& f : frames_) {
    numbers.push_back(f.time);
    for (const recording::FrameBodyState& b : f.bodies)
      for (const Vec3* v : {&b.pose.p_W, &b.soil.F_W, &b.soil.M_W}) numbers.insert(numbers.end(), v->data(), v->data() + 3);
    for (const recording::FrameBodyState& b : f.bodies)
      numbers.insert(numbers.end(), b.pose.R_WB.coeffs().data(), b.pose.R_WB.coeffs().data() + 4);
  }
  const std::uint64_t count = frames_.size();
  put(&count, sizeof count);
  put_all(numbers);
  put_all(radius_);
  for (const recording::Frame& f : frames_)
    for (const std::vector<float>* v : {&f.height, &f.pressure, &f.position, &f.velocity}) put_all(*v);
  return out;
}

void FrameRecorder::take_up(const std::vector<std::uint8_t>& state, Simulation& simulation) {
  std::size_t at = 0;
  const auto fail = [] { throw InputError(Problem{{}, 0, 0, "checkpoint", "has frames of another run", {}}); };
  const auto get = [&](void* data, std::size_t size) {
    if (size > state.size() - at) fail();
    if (size > 0) std::memcpy(data, state.data() + at, size);
    at += size;
  };
  const auto get_all = [&](auto& values) {
    std::uint64_t n = 0;
    get(&n, sizeof n);
    if (n > (state.size() - at) / sizeof values[0]) fail();
    values.resize(n);
    get(values.data(), n * sizeof values[0]);
  };
  std::uint64_t count = 0;
  std::vector<double> numbers;
  get(&count, sizeof count);
  get_all(numbers);
  get_all(radius_);
  const std::size_t bodies = simulation.contacts().size() + settings_.boxes.size();
  if (numbers.empty() || count > numbers.size() || numbers.size() != 1 + count * (1 + 13 * bodies)) fail();
  layout_ = {};
  lay_out(simulation);
  frames_.clear();
  next_ = numbers[0];
  const double* x = numbers.data() + 1;
  for (std::uint64_t k = 0; k < count; ++k) {
    recording::Frame f;
    f.time = *x++;
    f.bodies.resize(bodies);
    for (recording::FrameBodyState& b : f.bodies)
      for (Vec3* v : {&b.pose.p_W, &b.soil.F_W, &b.soil.M_W}) {
        *v = Vec3(x[0], x[1], x[2]);
        x += 3;
      }
    for (recording::FrameBodyState& b : f.bodies) {
      b.pose.R_WB.coeffs() << x[0], x[1], x[2], x[3];
      x += 4;
    }
    for (std::vector<float>* v : {&f.height, &f.pressure, &f.position, &f.velocity}) get_all(*v);
    frames_.push_back(std::move(f));
  }
}

void FrameRecorder::write(recording::Hdf5File& file) const {
  recording::FrameLayout layout = layout_;
  std::vector<float> first;  // where each particle was first seen
  if (!radius_.empty()) {
    recording::FrameParticles grains;
    grains.radius = radius_;
    grains.low = Vec3::Constant(std::numeric_limits<double>::infinity());
    grains.high = -grains.low;
    for (const recording::Frame& frame : frames_) {
      first.insert(first.end(), frame.position.begin() + static_cast<std::ptrdiff_t>(std::min(first.size(), frame.position.size())),
                   frame.position.end());
      for (std::size_t i = 0; i + 2 < frame.position.size(); i += 3) {
        const Vec3 p(frame.position[i], frame.position[i + 1], frame.position[i + 2]);
        grains.low = grains.low.cwiseMin(p);
        grains.high = grains.high.cwiseMax(p);
      }
    }
    layout.particles = std::move(grains);
  }
  recording::FrameWriter writer(file, layout);
  for (const recording::Frame& frame : frames_) {
    if (frame.position.size() == first.size()) {
      writer.append(frame);
      continue;
    }
    recording::Frame whole = frame;
    whole.position.insert(whole.position.end(), first.begin() + static_cast<std::ptrdiff_t>(frame.position.size()), first.end());
    writer.append(whole);
  }
}

}  // namespace terrode::vehicle
