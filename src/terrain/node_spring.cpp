#include "terrain/node_spring.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "wheel/body.h"
#include "wheel/wheel.h"

namespace terrode::terrain {

using bekker::ContactArc;
using bekker::StressModifier;

namespace {

constexpr double kPi = std::numbers::pi;
// Rim markers that carry shear displacement: half a degree apart, so that linear interpolation between two of them is
// off by less than a thousandth of K for the paper's wheel.
constexpr int kMarkers = 720;
constexpr double kMarkerStep = 2 * kPi / kMarkers;
// Shear displacement kept on reversal, in units of K: 1 - exp(-4) of the residual stress, from where it unloads.
constexpr double kReversalCap = 4.0;

double wrap(double a) { return std::remainder(a, 2 * kPi); }

}  // namespace

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
  require(p, "damping", damping, "Pa s/m", damping >= 0, "0 or more");
  return p;
}

// A body and what of its contact is remembered apart from the nodes.
struct NodeSpringTerrain::BodyState {
  BodyId id = 0;
  std::shared_ptr<const wheel::Body> shape;
  const wheel::Wheel* wheel = nullptr;
  int strips = 0;        // of the width, for rolling bodies
  double strip_width = 0.0;

  // Everything that a trial computes and a commit keeps.
  struct History {
    bool placed = false;     // a pose is known
    Pose pose;
    double time = 0.0;
    double direction = 1.0;  // of travel along the heading: +1 or -1
    double backing = 0.0;    // [m] moved against it
    double spin = 0.0;       // [rad] of the body about its axle, from the contact frame
    Vec3 heading = Vec3::UnitX(), axle = Vec3::UnitY();
    bool touching = false;
    double exit = 0.0;       // theta_r's moving part [rad]
    double load = 0.0;       // [N]
    double stored = 0.0;     // [J]
    double travel = 0.0;     // [m]
    double turned = 0.0;     // [rad]
    int marker_from = 0, marker_to = 0;  // markers in contact: [from, to)
    bool holds(int marker) const { return ((marker - marker_from) % kMarkers + kMarkers) % kMarkers < marker_to - marker_from; }
  };
  History kept, trial;
  bool tried = false;
  Pose trial_pose;
  Twist trial_twist;

  // Shear displacement along (driving) and across the rim per marker and strip [m]; active: in contact.
  struct Mark {
    double along = 0.0, across = 0.0;
    bool active = false;
  };
  std::vector<Mark> marks, marks_trial;  // [marker * strips + strip]
  std::vector<double> entry_angle;       // of each strip at the last trial: first guess of the next
  std::vector<ContactArc> arcs;
  std::vector<double> arc_exit;  // sine of each strip's exit angle

  std::vector<Touch> touches;            // of the last trial
  std::vector<NodeIndex> contact;        // committed
};

NodeSpringTerrain::NodeSpringTerrain(const NodeSpringParams& params, bekker::PointLaw law,
                                     std::shared_ptr<const Surface> surface)
    : params_(params), law_(law), hooks_(law.hooks()), soil_(params.soil),
      grid_((throw_if_any(params.validate()), params.spacing), surface ? surface : std::make_shared<LevelSurface>()) {}

NodeSpringTerrain::~NodeSpringTerrain() = default;

BodyId NodeSpringTerrain::add_body(std::shared_ptr<const wheel::Body> shape) {
  if (!shape) throw InputError("node-spring ground: no shape given for a body");
  if (in_step_) throw RunError("node-spring ground: a body was added within a step");
  auto s = std::make_unique<BodyState>();
  const double across = 2 * shape->bounding_radius() / params_.spacing + 4;
  if (across > 20000) throw InputError("node-spring ground: the node spacing is too fine for this body");
  if (const wheel::Rolling* rolling = shape->rolling()) {
    s->wheel = dynamic_cast<const wheel::Wheel*>(shape.get());
    s->strips = std::max(1, static_cast<int>(std::ceil(rolling->width / params_.spacing - 1e-9)));
    s->strip_width = rolling->width / s->strips;
    s->marks.resize(static_cast<std::size_t>(kMarkers * s->strips));
    s->marks_trial.resize(s->marks.size());
    s->entry_angle.assign(static_cast<std::size_t>(s->strips), 0.0);
    s->arcs.reserve(static_cast<std::size_t>(s->strips));
    s->arc_exit.reserve(static_cast<std::size_t>(s->strips));
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

double NodeSpringTerrain::springback(const bekker::LocalSoil& soil, double plastic) const {
  if (plastic <= 0) return 0.0;
  if (params_.unloading == Unloading::elastic_plastic) {
    const double p = bekker::power_law_pressure(soil, plastic);
    return std::min(p / (params_.unloading_k0 + params_.unloading_au * plastic), plastic);
  }
  // Shallow ruts spring back by half their depth at most, so that the surface never rises to where it was.
  return std::min(params_.springback, 0.5 * plastic);
}

ContactResult NodeSpringTerrain::evaluate(BodyState& s, const Pose& pose, const Twist& twist,
                                          std::vector<PatchNode>* record) const {
  s.touches.clear();
  s.trial = s.kept;
  s.trial.placed = true;
  s.trial.pose = pose;
  s.trial.time = t_;
  s.trial.touching = false;
  s.trial.marker_from = s.trial.marker_to = 0;
  return s.shape->rolling() ? roll(s, pose, twist, record) : press(s, pose, twist, record);
}

ContactResult NodeSpringTerrain::roll(BodyState& s, const Pose& pose, const Twist& twist,
                                      std::vector<PatchNode>* record) const {
  using History = BodyState::History;
  using Mark = BodyState::Mark;
  ContactResult result;
  const History& kept = s.kept;
  History& trial = s.trial;
  const wheel::Rolling& rolling = *s.shape->rolling();
  const bool plain = s.shape->plain_cylinder();
  const double dx = params_.spacing;

  // Contact frame: u out of the ground, heading along the travel, axle, and up within the wheel's plane.
  Vec3 u = Vec3::UnitZ();
  if (!grid_.level()) {
    // The mean slope under the wheel, over its contact's length.
    const double reach = 0.5 * rolling.radius, x = pose.p_W.x(), y = pose.p_W.y();
    const Surface& surface = grid_.surface();
    u = Vec3(-(surface.height(x + reach, y) - surface.height(x - reach, y)) / (2 * reach),
             -(surface.height(x, y + reach) - surface.height(x, y - reach)) / (2 * reach), 1.0)
            .normalized();
  }
  const Vec3 body_axle = pose.R_WB * Vec3::UnitY();
  Vec3 body_heading = body_axle.cross(u);
  const double tilt = body_heading.norm();
  if (tilt < 0.2) return press(s, pose, twist, record);  // lies on its side
  body_heading /= tilt;
  const Vec3 e_d = body_heading.cross(body_axle);
  const Vec3 down = pose.R_WB * -Vec3::UnitZ();
  trial.spin = std::atan2(-down.dot(body_heading), -down.dot(e_d));
  trial.heading = body_heading;
  trial.axle = body_axle;

  Vec3 moved = Vec3::Zero(), swung = Vec3::Zero();
  double spun = 0.0;
  if (kept.placed) {
    moved = pose.p_W - kept.pose.p_W;
    swung = body_axle - kept.axle;
    spun = wrap(trial.spin - kept.spin);
  }
  const double advance = moved.dot(body_heading), rise = moved.dot(e_d);
  if (!kept.placed) {
    const double v = twist.v_W.dot(body_heading), w = twist.w_W.dot(body_axle);
    trial.direction = v < 0 || (v == 0 && w < 0) ? -1.0 : 1.0;
  } else {
    // Reversing counts once it has gone as far as the springback, so that jitter at rest does not turn the contact.
    trial.backing = std::max(0.0, kept.backing - kept.direction * advance);
    if (trial.backing > params_.springback) {
      trial.direction = -kept.direction;
      trial.backing = 0.0;
    }
  }
  const double f = trial.direction;
  const Vec3 e_f = f * body_heading, e_y = f * body_axle;
  trial.travel += std::abs(advance);
  trial.turned += f * spun;

  bekker::Context context;
  context.angular_velocity = twist.w_W.dot(e_y);
  context.forward_velocity = twist.v_W.dot(e_f);
  const double rim_speed = context.angular_velocity * rolling.radius;
  if (rim_speed > 0) context.slip = 1.0 - context.forward_velocity / rim_speed;
  else if (context.forward_velocity > 0 || rim_speed < 0) context.slip = -std::numeric_limits<double>::infinity();
  else context.slip = 0.0;
  if (context.slip > 1.0) context.slip = 1.0;
  context.normal_load = kept.load;
  context.position = trial.travel;
  context.time = t_;
  context.radius = rolling.radius;
  context.width = rolling.width;
  context.unit_weight = params_.soil.unit_weight();
  context.wheel_angle = trial.turned;

  bekker::ContactShape shape{rolling.radius, context.slip, kept.load, 0.0};
  const double surface_here = grid_.surface().height(pose.p_W.x(), pose.p_W.y());
  context.sinkage = std::max(0.0, rolling.radius - (pose.p_W.z() - surface_here) * u.z());
  if (hooks_ & StressModifier::kContact)
    for (const StressModifier* m : law_.modifiers)
      if (m->hooks() & StressModifier::kContact) m->contact(context, shape);
  const double lift = shape.radius - rolling.radius;  // of the contact arc's centre above the axle
  const double outer = plain ? 0.0 : (s.wheel ? s.wheel->shape().grousers.count > 0 ? s.wheel->shape().grousers.height : 0.0 : 0.0);

  // Entry angle of each strip.
  const double half_width = 0.5 * rolling.width;
  const bool flat = grid_.level().has_value();
  const auto strip_radius = [&](double y) {
    return (plain || !s.wheel ? shape.radius : s.wheel->radius_at(y) + lift) + outer;
  };
  // Distance from the arc's centre down to the ground as it lies, under the rim's point (x, y).
  const auto clearance = [&](double x, double y, double guess) {
    const Vec3 at = pose.p_W + x * e_f + y * e_y - (guess - lift) * e_d;
    const double z = grid_.height(at.x(), at.y());
    return -Vec3(at.x() - pose.p_W.x(), at.y() - pose.p_W.y(), z - pose.p_W.z()).dot(e_d) + lift;
  };
  double entry_max = 0.0;
  for (int k = 0; k < s.strips; ++k) {
    const double y = -half_width + (k + 0.5) * s.strip_width, R = strip_radius(y);
    double theta = s.entry_angle[static_cast<std::size_t>(k)], last = -1.0;
    double gap = clearance(R * std::sin(theta), y, R);
    bool found = false;
    for (int i = 0; i < 40; ++i) {
      if (gap >= R) break;
      theta = std::acos(std::max(gap / R, 0.0));
      if (std::abs(theta - last) <= 1e-15 * theta) {
        found = true;
        break;
      }
      last = theta;
      const double next = clearance(R * std::sin(theta), y, R);
      if (next == gap) {
        found = true;
        break;
      }
      gap = next;
    }
    if (!found) {
      // From the front: the outermost angle at which the rim lies below the ground, then halving.
      theta = 0.0;
      const auto below = [&](double a) { return R * std::cos(a) - clearance(R * std::sin(a), y, R * std::cos(a)); };
      const double step = std::min(0.5 * dx / R, 0.02);
      double a = 0.0, hit = -1.0;
      for (a = 0.5 * kPi; a > 0; a -= step)
        if (below(a) > 0) {
          hit = a;
          break;
        }
      if (hit < 0 && below(0.0) > 0) hit = 0.0;
      if (hit >= 0) {
        double lo = hit, hi = std::min(hit + step, 0.5 * kPi);
        for (int i = 0; i < 60; ++i) (below(0.5 * (lo + hi)) > 0 ? lo : hi) = 0.5 * (lo + hi);
        theta = 0.5 * (lo + hi);
      }
    }
    s.entry_angle[static_cast<std::size_t>(k)] = theta;
    entry_max = std::max(entry_max, theta);
  }
  if (entry_max <= 0) return result;

  // Moving part of the exit angle: where the rim's surface neither presses nor parts, approached over the springback.
  double target = kept.exit;
  const bool moving = kept.placed && (advance != 0 || rise != 0);
  if (moving) target = std::atan2(rise, std::abs(advance));
  target = std::clamp(target, -entry_max, entry_max);
  if (!kept.placed) {
    target = -entry_max;
    trial.exit = target;
  } else if (!kept.touching || f != kept.direction) {
    trial.exit = target;
  } else {
    const double path = std::abs(rise) + std::abs(advance) * std::sin(entry_max);
    trial.exit = target + (kept.exit - target) * std::exp(-path / params_.springback);
  }
  const bool elastic = params_.unloading == Unloading::elastic;
  if (elastic) trial.exit = 0.0;

  s.arcs.clear();
  s.arc_exit.clear();
  double exit_min = entry_max;
  for (int k = 0; k < s.strips; ++k) {
    const double theta_f = s.entry_angle[static_cast<std::size_t>(k)];
    const double y = -half_width + (k + 0.5) * s.strip_width;
    bekker::ContactShape own = shape;
    own.radius = strip_radius(y);
    bekker::ContactAngles angles = params_.angles;
    const double z = own.radius * (1.0 - std::cos(theta_f));
    if (own.rear_fraction > 0) angles.theta_r = -std::acos(std::max(-1.0, 1.0 - own.rear_fraction * z / own.radius));
    if (params_.unloading == Unloading::elastic_plastic && z > 0)
      angles.theta_r = std::min(angles.theta_r, -std::acos(std::max(-1.0, 1.0 - springback(soil_, z) / own.radius)));
    own.rear_fraction = 0.0;
    angles.theta_r = std::clamp(angles.theta_r + trial.exit, -theta_f, 0.999 * theta_f);
    s.arcs.emplace_back(own, angles,
                        params_.shear_history == ShearHistory::closed_form ? params_.skid_shear
                                                                           : bekker::SkidShear::as_printed,
                        params_.soil.friction_angle, theta_f > 0 ? theta_f : 1e-12);
    s.arc_exit.push_back(std::sin(angles.theta_r));
    exit_min = std::min(exit_min, angles.theta_r);
  }

  // Rim markers: displacement of the rim's material along the ground since the last committed pose.
  const double dspin = f * spun;  // about e_y
  static const Mark none{};
  if (params_.shear_history == ShearHistory::rim) {
    const double lo = f > 0 ? exit_min : -entry_max, hi = f > 0 ? entry_max : -exit_min;  // about the body's axle
    trial.marker_from = static_cast<int>(std::floor((lo + trial.spin) / kMarkerStep)) - 1;
    trial.marker_to = static_cast<int>(std::ceil((hi + trial.spin) / kMarkerStep)) + 1;
    const double sway = moved.dot(e_y), go = moved.dot(e_f), up = moved.dot(e_d);
    const double yaw = -f * swung.dot(e_f);  // turn of the heading towards e_y [rad]
    const double roll_up = f * swung.dot(e_d);
    for (int m = trial.marker_from; m < trial.marker_to; ++m) {
      const double theta = f * (m * kMarkerStep - trial.spin);
      const double before = theta + dspin;
      const double mid = 0.5 * (theta + before), c = std::cos(mid), sn = std::sin(mid);
      const std::size_t row = static_cast<std::size_t>(((m % kMarkers) + kMarkers) % kMarkers * s.strips);
      const bool kept_row = kept.holds(m);
      const double along0 = rolling.radius * dspin - (go * c + up * sn);
      const double across0 = sway + rolling.radius * sn * yaw;
      for (int k = 0; k < s.strips; ++k) {
        const ContactArc& arc = s.arcs[static_cast<std::size_t>(k)];
        const double y = -half_width + (k + 0.5) * s.strip_width;
        const Mark& old = kept_row ? s.marks[row + static_cast<std::size_t>(k)] : none;
        Mark& now = s.marks_trial[row + static_cast<std::size_t>(k)];
        const double rear = arc.theta_r - kMarkerStep;
        if (theta >= arc.theta_f || theta < rear) {
          now = Mark{};
          continue;
        }
        const double along = along0 + y * (yaw * c - roll_up * sn), across = across0;
        double share = 1.0;
        if (!old.active) {
          if (before > arc.theta_f && dspin > 0) share = (arc.theta_f - theta) / dspin;
          else if (before < rear && dspin < 0) share = (rear - theta) / dspin;
          else if (!kept.placed) share = 0.0;
          now.along = f * share * along;
          now.across = f * share * across;
        } else {
          now = old;
          const double a = f * along, b = f * across;
          const double back = now.along * a + now.across * b;
          if (back < 0) {
            const double length = std::hypot(now.along, now.across), cap = kReversalCap * soil_.shear_modulus;
            if (length > cap) {
              now.along *= cap / length;
              now.across *= cap / length;
            }
          }
          now.along += a;
          now.across += b;
        }
        now.active = true;
      }
    }
  }

  // Nodes. Lattice cells are taken as squares along the wheel's axes.
  const double flat_f = std::hypot(e_f.x(), e_f.y()), flat_y = std::hypot(e_y.x(), e_y.y());
  const double hx = 0.5 * dx / flat_f, hy = 0.5 * dx / flat_y;
  const double R_max = strip_radius(0.0);
  const double x_from = R_max * std::sin(exit_min) - hx, x_to = R_max * std::sin(entry_max) + hx;
  const double axle_clearance = clearance(0.0, 0.0, R_max) - lift;
  double bx0 = 1e300, bx1 = -1e300, by0 = 1e300, by1 = -1e300;
  for (const double a : {x_from, x_to})
    for (const double b : {-half_width - hy, half_width + hy}) {
      const Vec3 corner = pose.p_W + a * e_f + b * e_y - axle_clearance * e_d;
      bx0 = std::min(bx0, corner.x());
      bx1 = std::max(bx1, corner.x());
      by0 = std::min(by0, corner.y());
      by1 = std::max(by1, corner.y());
    }
  const int ix0 = static_cast<int>(std::ceil(bx0 / dx)), ix1 = static_cast<int>(std::floor(bx1 / dx));
  const int iy0 = static_cast<int>(std::ceil(by0 / dx)), iy1 = static_cast<int>(std::floor(by1 / dx));

  static const Node virgin{};
  const double tan_side = [&] {  // of the slip angle, for closed-form shear
    const double v = context.forward_velocity;
    return v != 0 ? twist.v_W.dot(e_y) / std::abs(v) : 0.0;
  }();
  const Vec3 v_f(twist.v_W.dot(e_f), twist.v_W.dot(e_y), twist.v_W.dot(e_d));
  const Vec3 w_f(twist.w_W.dot(e_f), twist.w_W.dot(e_y), twist.w_W.dot(e_d));
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();  // in (e_f, e_y, e_d), about the body's origin
  double normal_work = 0.0, unload_stiffness = 0.0, load_stiffness = 0.0;
  const bool with_laws = !law_.modifiers.empty() || law_.pressure_law || law_.shear_law;
  constexpr double gauss = 0.57735026918962576451;  // 1/sqrt(3)

  for (int iy = iy0; iy <= iy1; ++iy) {
    for (int ix = ix0; ix <= ix1; ++ix) {
      const double px = ix * dx, py = iy * dx;
      const double pz = flat ? *grid_.level() : grid_.surface().height(px, py);
      const Vec3 rel(px - pose.p_W.x(), py - pose.p_W.y(), pz - pose.p_W.z());
      const double xr = rel.dot(e_f), yr = rel.dot(e_y);
      const double cover = std::min(yr + hy, half_width) - std::max(yr - hy, -half_width);
      if (cover <= 1e-12 * dx) continue;
      const int k = std::clamp(static_cast<int>((yr + half_width) / s.strip_width), 0, s.strips - 1);
      const ContactArc& arc = s.arcs[static_cast<std::size_t>(k)];
      const double R = arc.radius;
      if (arc.theta_f <= 1e-9) continue;
      const double front_end = R * arc.sin_f, rear_end = R * s.arc_exit[static_cast<std::size_t>(k)];
      const double from = std::max(xr - hx, rear_end), to = std::min(xr + hx, front_end);
      if (to <= from) continue;
      const Node* found = grid_.find({ix, iy});
      const Node& node = found ? *found : virgin;
      if (node.removed) continue;
      const double H = -rel.dot(e_d) + lift;  // ground's undisturbed surface below the arc's centre
      double climb = 0.0;                     // of it along e_f, over the frame's plane
      if (!flat) {
        const Eigen::Vector2d g = grid_.surface().gradient(px, py);
        climb = (g.x() * e_f.x() + g.y() * e_f.y()) * e_d.z() + e_f.x() * e_d.x() + e_f.y() * e_d.y();
      }
      // Unloading of the whole node, judged at its centre.
      const double xc = std::clamp(xr, -R, R);
      const double depth_c = std::max(std::sqrt(R * R - xc * xc) - H + node.raised, node.entry);
      double hold = 1.0;
      const bool in_contact = node.body == s.id;
      if (!elastic && in_contact && xr >= rear_end) {
        const double gap = node.reached - depth_c;
        if (gap > 0) hold = std::max(0.0, 1.0 - gap / std::max(springback(soil_, node.reached), 1e-12));
      }
      s.touches.push_back({{ix, iy}, depth_c, 0.0, 0.0});
      double node_along = 0.0, node_across = 0.0;
      if (params_.shear_history == ShearHistory::ground) {
        const double sn = xc / R, c = std::sqrt(1.0 - sn * sn);
        node_along = (in_contact ? node.shear_x : 0.0) + f * (rolling.radius * dspin - (moved.dot(e_f) * c + moved.dot(e_d) * sn));
        node_across = (in_contact ? node.shear_y : 0.0) + f * moved.dot(e_y);
        s.touches.back().shear_x = node_along;
        s.touches.back().shear_y = node_across;
      }

      // Quadrature over the part of the cell within the contact, split where the pressure has its peak.
      const double peak = R * arc.sin_m;
      // Where the contact ends the pressure starts like a broken power of the distance: squaring the coordinate there
      // makes two points enough.
      double ends[3] = {from, to, to};
      int pieces = 1;
      if (peak > from && peak < to) {
        ends[1] = peak;
        pieces = 2;
      }
      const int points = plain ? 2 : 4;
      bool loaded = false;
      PatchNode shown;
      double shown_area = 0.0;
      for (int piece = 0; piece < pieces; ++piece) {
        const double a = ends[piece], half = 0.5 * (ends[piece + 1] - a);
        for (int q = 0; q < points; ++q) {
          double x, patch_area;  // of the ground
          if (!plain) {
            x = a + (2 * q + 1) * half / points;
            patch_area = 2.0 * half / points * cover;
          } else {
            const double g = 0.5 * (1.0 + (q ? gauss : -gauss));
            const double b = ends[piece + 1];
            if (b >= front_end) x = b - 2.0 * half * g * g;
            else if (a <= rear_end) x = a + 2.0 * half * g * g;
            else x = a + 2.0 * half * g;
            patch_area = 2.0 * half * cover * (b >= front_end || a <= rear_end ? g : 0.5);
          }
          double sin_t = x / R, cos_t = std::sqrt(1.0 - sin_t * sin_t), below = R * cos_t - lift;
          double theta = std::asin(sin_t);
          Vec3 out(sin_t, 0.0, -cos_t);  // of the surface, into the ground
          if (!plain) {
            const Vec3 origin = x * e_f + std::clamp(yr, -half_width * (1 - 1e-9), half_width * (1 - 1e-9)) * e_y -
                                2.0 * s.shape->bounding_radius() * e_d;
            wheel::RayHit hit;
            const Quat to_body = pose.R_WB.conjugate();
            if (!s.shape->ray(to_body * origin, to_body * e_d, hit) || hit.side) continue;
            const Vec3 p = pose.R_WB * hit.p_B, n = pose.R_WB * hit.n_B;
            below = -p.dot(e_d);
            out = Vec3(n.dot(e_f), n.dot(e_y), n.dot(e_d));
            if (-out.z() < 1e-3) continue;
            const double rho = std::hypot(x, below + lift);
            sin_t = x / rho;
            cos_t = (below + lift) / rho;
            theta = std::atan2(x, below + lift);
          }
          const double depth = below + lift - H + climb * (x - xr) + node.raised - node.entry;  // in this contact
          if (depth <= 0) continue;
          const double equivalent = params_.distribution == PressureDistribution::wong_reece ? arc.equivalent(theta) : theta;
          const double z = equivalent == theta ? depth : depth + R * (std::cos(equivalent) - cos_t);
          if (z <= 0) continue;
          const double sinkage = z + node.entry;
          double share = hold;
          if (!elastic && sinkage < node.plastic) share *= z / (node.plastic - node.entry);

          // Shear displacement, in the travel's frame: driving positive, sideways along e_y.
          double along, across;
          if (params_.shear_history == ShearHistory::rim) {
            const double at = (f * theta + trial.spin) / kMarkerStep;
            const int m = static_cast<int>(std::floor(at));
            const double w = at - m;
            const auto mark = [&](int i) -> const Mark& {
              return s.marks_trial[static_cast<std::size_t>(((i % kMarkers) + kMarkers) % kMarkers * s.strips + k)];
            };
            const Mark &m0 = mark(m), &m1 = mark(m + 1);
            double w0 = 1 - w, w1 = w;
            // Next to an end of the contact one neighbour lies outside: displacement starts at 0 there.
            if (m0.active != m1.active) {
              const Mark& in = m0.active ? m0 : m1;
              const double theta_in = f * ((m0.active ? m : m + 1) * kMarkerStep - trial.spin);
              const bool front = theta_in < theta;
              const double share_in = front ? std::clamp((arc.theta_f - theta) / (arc.theta_f - theta_in), 0.0, 1.0) : 1.0;
              along = in.along * share_in;
              across = in.across * share_in;
            } else {
              along = w0 * m0.along + w1 * m1.along;
              across = w0 * m0.across + w1 * m1.across;
            }
            along *= f;
            across *= f;
          } else if (params_.shear_history == ShearHistory::ground) {
            along = f * node_along;
            across = f * node_across;
          } else {
            const double j = arc.shear_displacement(theta, sin_t);
            along = arc.shear_sign(theta, j) * std::abs(j);
            across = arc.locked ? 0.0 : R * arc.one_minus_s * (arc.theta_f - theta) * tan_side;
          }
          double length = std::hypot(along, across);
          if (std::isinf(along)) {
            along = along < 0 ? -1.0 : 1.0;
            across = tan_side;
            length = std::numeric_limits<double>::infinity();
          }

          const Vec3 arm(x, yr, -below);
          const Vec3 velocity = v_f + w_f.cross(arm);
          const double press = velocity.dot(out);
          bekker::Stress stress;
          if (!with_laws) {
            stress.sigma = share * bekker::power_law_pressure(soil_, sinkage);
            if (params_.damping > 0) stress.sigma = std::max(0.0, stress.sigma + params_.damping * press);
            stress.tau = (soil_.cohesion + stress.sigma * soil_.tan_phi) * bekker::janosi_mobilised(soil_, length);
          } else {
            bekker::Point point;
            point.sinkage = sinkage;
            point.depth = depth + node.entry;
            point.theta = theta;
            point.sin_theta = sin_t;
            point.cos_theta = cos_t;
            point.shear_displacement = length;
            point.slide_speed = std::hypot(rim_speed - context.forward_velocity * cos_t, v_f.y());
            const double se = equivalent == theta ? sin_t : std::sin(equivalent);
            const double ce = equivalent == theta ? cos_t : std::cos(equivalent);
            point.penetration_speed = std::max(0.0, v_f.x() * se - v_f.z() * ce);
            bekker::Context own = context;
            own.pass = node.passes + 1;
            stress = bekker::stress_at(soil_, law_, own, point);
            stress.sigma *= share;
            stress.tau *= share;
            stress.drive *= share;
            stress.drag *= share;
          }
          if (share <= 0) stress = {};
          if (stress.sigma <= 0 && stress.tau <= 0) continue;
          loaded = true;
          const double area = params_.area == NodeArea::arc ? patch_area / -out.z() : patch_area;
          // Shear on the body, against the displacement of its surface, in the surface's plane.
          Vec3 tangent(-out.z(), 0.0, out.x());
          const double norm = std::hypot(tangent.x(), tangent.z());
          tangent /= norm;
          double du = 0.0, dv = 0.0;
          if (std::isinf(length)) {
            const double l = std::hypot(along, across);
            du = along / l;
            dv = across / l;
          } else if (length > 0) {
            du = along / length;
            dv = across / length;
          }
          const Vec3 shear = stress.tau * (du * tangent - dv * Vec3::UnitY());
          const Vec3 total = area * (shear - stress.sigma * out);
          force += total;
          moment += arm.cross(total);
          // Wedge stresses: thrust with its torque, and drag through the axle.
          force.x() += area * (stress.drive - stress.drag);
          moment.y() -= area * rolling.radius * stress.drive;
          normal_work += area * stress.sigma * press;
          result.slip_power -= area * shear.dot(velocity);
          result.contact_area += area;
          result.compaction_resistance += area * stress.sigma * out.x();
          result.max_sinkage = std::max(result.max_sinkage, depth + node.entry - node.raised);
          const double back = elastic ? sinkage : std::max(springback(soil_, sinkage), 1e-12);
          if (!elastic) result.stored_energy += 0.5 * area * stress.sigma * share * back;
          unload_stiffness += area * -out.z() * stress.sigma / back;
          load_stiffness += area * -out.z() * soil_.n * stress.sigma / sinkage;
          if (record) {
            const Vec3 at = pose.p_W + arm.x() * e_f + arm.y() * e_y + arm.z() * e_d;
            shown.p_W += area * at;
            shown.n_W += area * (out.x() * e_f + out.y() * e_y + out.z() * e_d);
            shown.pressure += area * stress.sigma;
            shown.shear_W += area * (shear.x() * e_f + shear.y() * e_y + shear.z() * e_d);
            shown.sinkage = std::max(shown.sinkage, depth + node.entry);
            shown.shear_displacement = std::max(shown.shear_displacement, length);
            shown_area += area;
          }
        }
      }
      if (loaded) ++result.contact_count;
      if (record && shown_area > 0) {
        shown.p_W /= shown_area;
        shown.n_W.normalize();
        shown.pressure /= shown_area;
        shown.shear_W /= shown_area;
        shown.area = shown_area;
        shown.passes = node.passes;
        record->push_back(shown);
      }
    }
  }

  trial.touching = result.contact_count > 0;
  result.wrench.F_W = force.x() * e_f + force.y() * e_y + force.z() * e_d;
  result.wrench.M_W = moment.x() * e_f + moment.y() * e_y + moment.z() * e_d;
  trial.load = result.wrench.F_W.dot(u);
  trial.stored = result.stored_energy;
  result.plastic_power = normal_work;
  if (kept.placed && t_ > kept.time) result.plastic_power -= (trial.stored - kept.stored) / (t_ - kept.time);
  const Mat3 along_normal = u * u.transpose();
  result.stiffness.topLeftCorner<3, 3>() = (rise > 0 ? unload_stiffness : load_stiffness) * along_normal;
  return result;
}

ContactResult NodeSpringTerrain::press(BodyState&, const Pose&, const Twist&, std::vector<PatchNode>*) const {
  throw RunError("node-spring ground: only bodies that roll are known");
}

void NodeSpringTerrain::leave(Node& node) const {
  if (params_.unloading != Unloading::elastic) {
    node.plastic = std::max(node.plastic, node.reached);
    node.entry = std::max(0.0, node.plastic - springback(soil_, node.plastic));
  }
  ++node.passes;
  node.body = -1;
  node.reached = 0.0;
  node.shear_x = node.shear_y = 0.0;
}

void NodeSpringTerrain::commit(BodyState& s) {
  s.kept = s.trial;
  for (const Touch& touch : s.touches) {
    Node& node = grid_.touch(touch.index);
    node.reached = node.body >= 0 ? std::max(node.reached, touch.reached) : touch.reached;
    node.body = s.id;
    node.stamp = step_;
    node.shear_x = touch.shear_x;
    node.shear_y = touch.shear_y;
  }
  for (const NodeIndex& i : s.contact) {
    Node& node = grid_.touch(i);
    if (node.stamp != step_ && node.body == s.id) leave(node);
  }
  s.contact.clear();
  for (const Touch& touch : s.touches) s.contact.push_back(touch.index);
  std::swap(s.marks, s.marks_trial);
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

constexpr std::uint64_t kMagic = 0x3173676e69727073ull;  // "springs1"

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
    for (const double v : {h.time, h.direction, h.backing, h.spin, h.exit, h.load, h.stored, h.travel, h.turned}) out.put(v);
    out.put(h.heading);
    out.put(h.axle);
    out.put(h.marker_from);
    out.put(h.marker_to);
    for (int m = h.marker_from; m < h.marker_to; ++m)
      for (int k = 0; k < s->strips; ++k) {
        const auto& mark = s->marks[static_cast<std::size_t>(((m % kMarkers) + kMarkers) % kMarkers * s->strips + k)];
        out.put(mark.along);
        out.put(mark.across);
        out.put(static_cast<std::uint8_t>(mark.active));
      }
    for (const double a : s->entry_angle) out.put(a);
    out.put(static_cast<std::uint64_t>(s->contact.size()));
    for (const NodeIndex& i : s->contact) {
      out.put(i.ix);
      out.put(i.iy);
    }
  }
  return out.take();
}

void NodeSpringTerrain::restore(std::span<const std::uint8_t> bytes) {
  if (in_step_) throw RunError("node-spring ground: restored within a step");
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
    for (double* v : {&h.time, &h.direction, &h.backing, &h.spin, &h.exit, &h.load, &h.stored, &h.travel, &h.turned})
      *v = in.get<double>();
    h.heading = in.vec();
    h.axle = in.vec();
    h.marker_from = in.get<int>();
    h.marker_to = in.get<int>();
    if (h.marker_to < h.marker_from || h.marker_to - h.marker_from > kMarkers)
      throw InputError("node-spring ground: the snapshot is damaged");
    for (int m = h.marker_from; m < h.marker_to; ++m)
      for (int k = 0; k < s->strips; ++k) {
        auto& mark = s->marks[static_cast<std::size_t>(((m % kMarkers) + kMarkers) % kMarkers * s->strips + k)];
        mark.along = in.get<double>();
        mark.across = in.get<double>();
        mark.active = in.get<std::uint8_t>() != 0;
      }
    for (double& a : s->entry_angle) a = in.get<double>();
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
