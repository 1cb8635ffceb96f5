#include "terrain/node_spring.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "terrain/node_contact.h"

namespace terrode::terrain {

Problems NodeSpringParams::validate() const {
  Problems p = soil.validate();
  for (auto& problem : p) problem.key = "soil." + problem.key;
  for (auto& problem : angles.validate()) {
    problem.key = "angles." + problem.key;
    p.push_back(problem);
  }
  require(p, "spacing", spacing, "m", spacing > 0 && spacing < 1, "a length above 0 and below 1 m");
  require(p, "springback", springback, "m", springback > 0, "a length above 0");
  require(p, "unloading_k0", unloading_k0, "Pa/m", unloading_k0 >= 0, "0 or more");
  require(p, "unloading_au", unloading_au, "Pa/m2", unloading_au >= 0, "0 or more");
  if (unloading == Unloading::elastic_plastic)
    require(p, "unloading_k0", unloading_k0, "Pa/m", unloading_k0 + unloading_au > 0,
            "a stiffness above 0 for elastic-plastic unloading");
  require(p, "travel_length", travel_length, "m", travel_length >= 0, "0 or more");
  require(p, "damping", damping, "Pa s/m", damping >= 0, "0 or more");
  require(p, "damping_time", damping_time, "s", damping_time >= 0, "0 or more");
  require(p, "heap_fraction", heap_fraction, "-", heap_fraction >= 0 && heap_fraction <= 1, "a fraction from 0 to 1");
  require(p, "repose_angle", repose_angle, "rad", repose_angle >= 0 && repose_angle < 0.5 * std::numbers::pi,
          "an angle from 0 to below pi/2");
  return p;
}

NodeSpringTerrain::NodeSpringTerrain(const NodeSpringParams& params, bekker::PointLaw law,
                                     std::shared_ptr<const Surface> surface, std::shared_ptr<const SoilField> field,
                                     std::shared_ptr<const void> owner)
    : params_(params),
      owner_(std::move(owner)),
      law_(law),
      soil_(params.soil),
      field_(std::move(field)),
      grid_((throw_if_any(params.validate()), params.spacing), surface ? surface : std::make_shared<LevelSurface>()) {}

NodeSpringTerrain::~NodeSpringTerrain() = default;

BodyId NodeSpringTerrain::add_body(std::shared_ptr<const wheel::Body> shape) {
  if (!shape) throw InputError("node-spring ground: no shape given for a body");
  if (in_step_) throw RunError("node-spring ground: a body was added within a step");
  auto s = std::make_unique<BodyState>();
  const double across = 2 * shape->bounding_radius() / params_.spacing + 4;
  if (across > 5000) throw InputError("node-spring ground: the node spacing is too fine for this body");
  // The smaller dimension of what lies flattest.
  const auto extent = [&](const Vec3& d) { return shape->support(d).dot(d) - shape->support(-d).dot(d); };
  s->width = std::min(extent(Vec3::UnitX()), extent(Vec3::UnitY()));
  if (const wheel::Rolling* rolling = shape->rolling()) {
    s->width = rolling->width;
    s->wheel = dynamic_cast<const wheel::Wheel*>(shape.get());
    const int strips = std::max(1, static_cast<int>(std::ceil(rolling->width / params_.spacing - 1e-9)));
    for (int k = 0; k < strips; ++k) s->offsets.push_back(rolling->width * ((k + 0.5) / strips - 0.5));
    s->entry_angle.assign(s->offsets.size(), 0.0);
    s->kept_entry = s->entry_angle;
    s->arcs.reserve(s->offsets.size());
    s->exit_sine.reserve(s->offsets.size());
    s->rear_reach.reserve(s->offsets.size());
    s->rear_end.reserve(s->offsets.size());
    s->rear_share.reserve(s->offsets.size());
    s->panels.reserve(static_cast<std::size_t>(across) + 8);
    s->shear = s->shear_trial = RimShear(strips);
  }
  s->touches.reserve(static_cast<std::size_t>(across * across));
  s->contact.reserve(static_cast<std::size_t>(across * across));
  s->shape = std::move(shape);
  s->id = static_cast<BodyId>(bodies_.size());
  bodies_.push_back(std::move(s));
  return static_cast<BodyId>(bodies_.size()) - 1;
}

NodeSpringTerrain::BodyState& NodeSpringTerrain::state(BodyId body) const {
  if (body < 0 || static_cast<std::size_t>(body) >= bodies_.size())
    throw InputError("node-spring ground: there is no body " + std::to_string(body));
  return *bodies_[static_cast<std::size_t>(body)];
}

void NodeSpringTerrain::begin_step(double t, double h) {
  if (!std::isfinite(t) || !std::isfinite(h) || h <= 0)
    throw InputError("node-spring ground: a step needs a finite length above 0");
  if (in_step_) throw RunError("node-spring ground: a step was begun before the last one ended");
  in_step_ = true;
  t_ = t;
  h_ = h;
  for (auto& s : bodies_) s->tried = false;
}

void NodeSpringTerrain::set_motion(BodyId body, const Pose& pose, const Twist& twist) {
  state(body);
  require_finite(pose, twist, "node-spring ground");
}

ContactResult NodeSpringTerrain::wrench(BodyId body, const Pose& pose, const Twist& twist) {
  BodyState& s = state(body);
  if (!in_step_) throw RunError("node-spring ground: a wrench was asked for outside a step");
  require_finite(pose, twist, "node-spring ground");
  s.tried = true;
  s.trial_pose = pose;
  s.trial_twist = twist;
  return evaluate(s, pose, twist, nullptr);
}

std::vector<PatchNode> NodeSpringTerrain::patch(BodyId body) const {
  BodyState& s = state(body);
  std::vector<PatchNode> out;
  if (in_step_ && s.tried) evaluate(s, s.trial_pose, s.trial_twist, &out);
  return out;
}

ContactResult NodeSpringTerrain::evaluate(BodyState& s, const Pose& pose, const Twist& twist,
                                          std::vector<PatchNode>* record) const {
  s.touches.clear();
  s.trial = s.kept;
  s.trial.placed = true;
  s.trial.pose = pose;
  s.trial.time = t_;
  s.trial.touching = false;
  s.trial.load = s.trial.stored = 0.0;
  // Nodes are numbered by integers.
  const double away = std::max(std::abs(pose.p_W.x()), std::abs(pose.p_W.y())) + s.shape->bounding_radius();
  if (!(away < 1e9 * params_.spacing))
    throw RunError(fmt::format("node-spring ground: body {} is {:.3g} m away, beyond what nodes of {:.3g} m are numbered for at t = {:.6g} s", s.id,
                               away, params_.spacing, t_));
  ContactResult out;
  if (s.shape->rolling() && roll(s, pose, twist, record, out)) return out;
  return press(s, pose, twist, record);
}

void NodeSpringTerrain::leave(const BodyState& s, NodeIndex index, Node& node) const {
  if (params_.unloading != Unloading::elastic) {
    node.plastic = std::max(node.plastic, node.reached);
    const auto soil = soil_at(index.ix * params_.spacing, index.iy * params_.spacing, node.plastic);
    node.entry = std::max(0.0, node.plastic - springback(soil, node.plastic, s.width));
  }
  ++node.passes;
  node.body = -1;
  node.reached = 0.0;
  node.shear_x = node.shear_y = 0.0;
}

void NodeSpringTerrain::commit(BodyState& s) {
  s.kept = s.trial;
  const bool heaps = params_.heap_fraction > 0, settles = params_.repose_angle > 0;
  double pushed = 0.0;
  for (const auto& touch : s.touches) {
    Node& node = grid_.touch(touch.index);
    const double before = node.body >= 0 ? node.reached : node.entry;
    node.reached = std::max(before, touch.reached);
    pushed += node.reached - before;
    node.body = s.id;
    node.stamp = step_;
    node.shear_x = touch.shear_x;
    node.shear_y = touch.shear_y;
  }
  int ix0 = 0, ix1 = -1, iy0 = 0, iy1 = -1;
  for (const NodeIndex& i : s.contact) {
    Node& node = grid_.touch(i);
    if (node.stamp == step_ || node.body != s.id) continue;
    leave(s, i, node);
    if (ix1 < ix0) {
      ix0 = ix1 = i.ix;
      iy0 = iy1 = i.iy;
    }
    ix0 = std::min(ix0, i.ix);
    ix1 = std::max(ix1, i.ix);
    iy0 = std::min(iy0, i.iy);
    iy1 = std::max(iy1, i.iy);
  }
  s.contact.clear();
  for (const auto& touch : s.touches) s.contact.push_back(touch.index);
  std::swap(s.shear, s.shear_trial);
  s.kept_entry = s.entry_angle;
  if (heaps && pushed > 0) heap(s, params_.heap_fraction * pushed * params_.spacing * params_.spacing);
  if (settles && ix1 >= ix0) settle(ix0 - 2, iy0 - 2, ix1 + 2, iy1 + 2);
}

// Soil that gives way goes up around the contact: equal shares to the free nodes that border it.
void NodeSpringTerrain::heap(const BodyState& s, double volume) {
  const auto free_neighbour = [&](NodeIndex i) {
    const Node* n = grid_.find(i);
    return !n || n->body < 0;
  };
  constexpr int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  int border = 0;
  for (const NodeIndex& i : s.contact)
    for (const auto& d : steps) border += free_neighbour({i.ix + d[0], i.iy + d[1]}) ? 1 : 0;
  if (border == 0) return;
  const double rise = volume / (border * params_.spacing * params_.spacing);
  for (const NodeIndex& i : s.contact)
    for (const auto& d : steps) {
      const NodeIndex j{i.ix + d[0], i.iy + d[1]};
      if (free_neighbour(j)) grid_.touch(j).raised += rise;
    }
}

// Slopes above the angle of repose fall: between free neighbours half of what is too steep goes down, sweep by sweep.
// Soil is moved, never made.
void NodeSpringTerrain::settle(int ix0, int iy0, int ix1, int iy1) {
  const double dx = params_.spacing, steepest = std::tan(params_.repose_angle) * dx;
  const auto level = [&](NodeIndex i) {
    const Node* n = grid_.find(i);
    return grid_.surface_at(i).z + (n ? n->raised - n->entry : 0.0);
  };
  const auto free_node = [&](NodeIndex i) {
    const Node* n = grid_.find(i);
    return !n || n->body < 0;
  };
  constexpr int sweeps = 4;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bool moved = false;
    for (int iy = iy0; iy <= iy1; ++iy)
      for (int ix = ix0; ix <= ix1; ++ix)
        for (const auto& d : {std::pair{1, 0}, std::pair{0, 1}}) {
          const NodeIndex a{ix, iy}, b{ix + d.first, iy + d.second};
          if (!free_node(a) || !free_node(b)) continue;
          const double drop = level(a) - level(b), over = std::abs(drop) - steepest;
          if (over <= 0) continue;
          const double share = 0.25 * over;
          grid_.touch(drop > 0 ? a : b).raised -= share;
          grid_.touch(drop > 0 ? b : a).raised += share;
          moved = true;
        }
    if (!moved) break;
  }
}

void NodeSpringTerrain::end_step() {
  if (!in_step_) throw RunError("node-spring ground: a step was ended that was not begun");
  ++step_;
  for (auto& s : bodies_)
    if (s->tried) commit(*s);
  in_step_ = false;
}

double NodeSpringTerrain::undisturbed_height(double x, double y) const { return grid_.surface().height(x, y); }

double NodeSpringTerrain::height(double x, double y) const {
  const double dx = params_.spacing, u = x / dx, v = y / dx, fu = std::floor(u), fv = std::floor(v);
  const double a = u - fu, b = v - fv;
  const auto at = [&](int i, int j) {
    const Node* n = grid_.find({static_cast<std::int32_t>(fu) + i, static_cast<std::int32_t>(fv) + j});
    return n ? n->raised - std::max(n->entry, n->reached) : 0.0;
  };
  return undisturbed_height(x, y) + (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

void NodeSpringTerrain::reserve(double x0, double y0, double x1, double y1) {
  const NodeIndex a = grid_.nearest(std::min(x0, x1), std::min(y0, y1)), b = grid_.nearest(std::max(x0, x1), std::max(y0, y1));
  const auto tiles = [](std::int32_t lo, std::int32_t hi) { return (hi - lo) / Tile::size + 2; };
  if (static_cast<double>(tiles(a.ix, b.ix)) * tiles(a.iy, b.iy) > 1e6)
    throw InputError("node-spring ground: the rectangle to reserve holds more than a million tiles");
  for (std::int32_t iy = a.iy; iy < b.iy + Tile::size; iy += Tile::size)
    for (std::int32_t ix = a.ix; ix < b.ix + Tile::size; ix += Tile::size)
      grid_.touch({std::min(ix, b.ix), std::min(iy, b.iy)});
}

namespace {

class Writer {
 public:
  template <class T>
  void put(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    const auto* p = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_.insert(bytes_.end(), p, p + sizeof(T));
  }
  void put(const Vec3& v) {
    for (int i = 0; i < 3; ++i) put(v[i]);
  }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
};

class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  template <class T>
  T get() {
    if (bytes_.size() < sizeof(T)) throw InputError("node-spring ground: the snapshot ends early");
    T value;
    std::memcpy(&value, bytes_.data(), sizeof(T));
    bytes_ = bytes_.subspan(sizeof(T));
    return value;
  }
  Vec3 vec() {
    Vec3 v;
    for (int i = 0; i < 3; ++i) v[i] = get<double>();
    return v;
  }
  bool done() const { return bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
};

constexpr std::uint64_t kMagic = 0x3273676e69727073ull;  // "springs2"

bool pristine(const Node& n) {
  return n.plastic == 0 && n.entry == 0 && n.reached == 0 && n.raised == 0 && n.passes == 0 && n.body < 0 && n.removed == 0;
}

void put_node(Writer& out, const Node& n) {
  for (const double v : {n.plastic, n.entry, n.reached, n.raised, n.shear_x, n.shear_y}) out.put(v);
  out.put(n.passes);
  out.put(n.body);
  out.put(n.stamp);
  out.put(n.removed);
}

Node get_node(Reader& in) {
  Node n;
  for (double* v : {&n.plastic, &n.entry, &n.reached, &n.raised, &n.shear_x, &n.shear_y}) *v = in.get<double>();
  n.passes = in.get<std::int32_t>();
  n.body = in.get<std::int32_t>();
  n.stamp = in.get<std::uint32_t>();
  n.removed = in.get<std::uint32_t>();
  return n;
}

}  // namespace

std::vector<std::uint8_t> NodeSpringTerrain::snapshot() const {
  if (in_step_) throw RunError("node-spring ground: a snapshot was asked for within a step");
  Writer out;
  out.put(kMagic);
  out.put(params_.spacing);
  out.put(step_);
  // Nodes that remember something, in the order of their tiles: equal grounds give equal bytes whatever was reserved.
  std::uint64_t count = 0;
  const auto tiles = grid_.sorted_tiles();
  for (const Tile* tile : tiles)
    for (const Node& n : tile->nodes) count += pristine(n) ? 0 : 1;
  out.put(count);
  for (const Tile* tile : tiles)
    for (int i = 0; i < Tile::size * Tile::size; ++i) {
      const Node& n = tile->nodes[i];
      if (pristine(n)) continue;
      out.put(tile->tx * Tile::size + i % Tile::size);
      out.put(tile->ty * Tile::size + i / Tile::size);
      put_node(out, n);
    }
  out.put(static_cast<std::uint64_t>(bodies_.size()));
  for (const auto& s : bodies_) {
    const BodyState::History& h = s->kept;
    out.put(static_cast<std::uint8_t>(h.placed));
    out.put(static_cast<std::uint8_t>(h.touching));
    out.put(h.pose.p_W);
    for (int i = 0; i < 4; ++i) out.put(h.pose.R_WB.coeffs()[i]);
    for (const double v : {h.time, h.direction, h.backing, h.spin, h.exit, h.slip_now, h.rolled, h.gone, h.load, h.stored, h.travel, h.turned}) out.put(v);
    out.put(h.heading);
    out.put(h.axle);
    s->shear.write(out);
    for (const double a : s->kept_entry) out.put(a);
    out.put(static_cast<std::uint64_t>(s->contact.size()));
    for (const NodeIndex& i : s->contact) {
      out.put(i.ix);
      out.put(i.iy);
    }
  }
  return out.take();
}

void NodeSpringTerrain::restore(std::span<const std::uint8_t> bytes) {
  in_step_ = false;
  Reader in(bytes);
  if (in.get<std::uint64_t>() != kMagic || in.get<double>() != params_.spacing)
    throw InputError("node-spring ground: the snapshot is of another ground");
  const auto step = in.get<std::uint32_t>();
  grid_.clear();
  const auto count = in.get<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) {
    NodeIndex index;
    index.ix = in.get<std::int32_t>();
    index.iy = in.get<std::int32_t>();
    grid_.touch(index) = get_node(in);
  }
  if (in.get<std::uint64_t>() != bodies_.size())
    throw InputError("node-spring ground: the snapshot has another number of bodies");
  for (auto& s : bodies_) {
    BodyState::History& h = s->kept;
    h.placed = in.get<std::uint8_t>() != 0;
    h.touching = in.get<std::uint8_t>() != 0;
    h.pose.p_W = in.vec();
    for (int i = 0; i < 4; ++i) h.pose.R_WB.coeffs()[i] = in.get<double>();
    for (double* v : {&h.time, &h.direction, &h.backing, &h.spin, &h.exit, &h.slip_now, &h.rolled, &h.gone, &h.load, &h.stored, &h.travel, &h.turned})
      *v = in.get<double>();
    h.heading = in.vec();
    h.axle = in.vec();
    if (!s->shear.read(in)) throw InputError("node-spring ground: the snapshot is damaged");
    for (double& a : s->kept_entry) a = in.get<double>();
    s->contact.resize(in.get<std::uint64_t>());
    for (NodeIndex& i : s->contact) {
      i.ix = in.get<std::int32_t>();
      i.iy = in.get<std::int32_t>();
    }
  }
  if (!in.done()) throw InputError("node-spring ground: the snapshot has bytes to spare");
  step_ = step;
}

}  // namespace terrode::terrain
