// Contact of bodies that roll: strips along the travel, each with its entry, peak and exit angle; nodes within them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "bekker/bulldozing.h"
#include "terrain/node_contact.h"

namespace terrode::terrain {

using bekker::ContactArc;

namespace {

constexpr double kPi = std::numbers::pi;
// Stands for the slip of a locked wheel, minus infinity, while it builds up.
constexpr double kLockedSlip = -20.0;
// Turns per step below this are rounding [rad].
constexpr double kStill = 1e-14;

double wrap(double a) { return std::remainder(a, 2 * kPi); }

double still(double a) { return std::abs(a) < kStill ? 0.0 : a; }

}  // namespace

struct NodeSpringTerrain::Roll {
  Roll(const NodeSpringTerrain& ground_in, BodyState& state, const Pose& pose_in, const Twist& twist_in,
       std::vector<PatchNode>* record_in)
      : ground(ground_in), s(state), pose(pose_in), twist(twist_in), record(record_in) {}

  const NodeSpringTerrain& ground;
  BodyState& s;
  const Pose& pose;
  const Twist& twist;
  std::vector<PatchNode>* record;

  const NodeSpringParams& params = ground.params_;
  const BodyState::History& kept = s.kept;
  BodyState::History& trial = s.trial;
  const wheel::Rolling& rolling = *s.shape->rolling();
  const bool plain = s.shape->plain_cylinder();
  const bool level = ground.grid_.level().has_value();
  const bool elastic = params.unloading == Unloading::elastic;
  const double half_width = 0.5 * rolling.width;

  // Contact frame: e_f along the travel, e_y along the axle to the left of it, e_d up in the wheel's plane; u out of the
  // ground.
  Vec3 u = Vec3::UnitZ(), e_f = Vec3::UnitX(), e_y = Vec3::UnitY(), e_d = Vec3::UnitZ();
  double facing = 1.0;
  RimMotion motion;
  double rim_speed = 0.0, tan_slip_angle = 0.0;
  bekker::Context context;
  bekker::ContactShape shape;
  double held_fast = 1.0;  // share of the nodes that let go at once when the axle rises; others have time to roll out
  double exit_gain = 0.0;  // d(exit)/d(rise) within a step [rad/m]
  double lift = 0.0;  // of the arc's centre above the axle [m]: flexible rims flatten at the bottom
  double entry_max = 0.0;
  bool uniform = true;  // all strips have the same arc

  // What the part of one node within the contact gives per metre of width, moments about the axle's middle.
  struct Cell {
    Vec3 normal = Vec3::Zero(), normal_moment = Vec3::Zero(), shear = Vec3::Zero(), shear_moment = Vec3::Zero();
    double drive = 0, drag = 0, area = 0, compaction = 0, stored = 0, damping_power = 0, unload = 0, load = 0, slide = 0, stick = 0, rear = 0;
    double max_sinkage = 0, max_shear = 0, side = 0;
    bool loaded = false;
  };

  bool lay_frame();
  void describe();
  double radius_of(double y) const {
    double r = plain || !s.wheel ? shape.radius : s.wheel->radius_at(y) + lift;
    if (s.wheel && s.wheel->shape().grousers.count > 0) r += s.wheel->shape().grousers.height;
    return r;
  }
  double clearance(double x, double y, double below) const;
  double entry_of(double y, double R, double guess) const;
  void find_entries();
  void find_exit();
  void lay_arcs();
  void move_shear();
  void cell(Cell& out, const Node& node, std::size_t k, double px, double py, double xr, double yr, double H, double climb,
            double from, double to, double hold, double gap, const ShearPath* of_node) const;
  void sum(Sums& sums) const;
  ContactResult result(const Sums& sums) const;
};

bool NodeSpringTerrain::Roll::lay_frame() {
  if (!level) {
    // The mean slope under the wheel, over about the length of its contact.
    const double reach = 0.5 * rolling.radius, x = pose.p_W.x(), y = pose.p_W.y();
    const NodeGrid& grid = ground.grid_;
    u = Vec3(-(grid.base(x + reach, y) - grid.base(x - reach, y)) / (2 * reach),
             -(grid.base(x, y + reach) - grid.base(x, y - reach)) / (2 * reach), 1.0)
            .normalized();
  }
  const Vec3 axle = pose.R_WB * Vec3::UnitY();
  Vec3 heading = axle.cross(u);
  constexpr double upright = 0.2;  // sine of the axle's angle to the ground's normal, below which the wheel lies
  if (heading.norm() < upright) return false;
  heading.normalize();
  e_d = heading.cross(axle);
  const Vec3 down = pose.R_WB * -Vec3::UnitZ();
  trial.spin = std::atan2(-down.dot(heading), -down.dot(e_d));
  trial.heading = heading;
  trial.axle = axle;

  Vec3 moved = Vec3::Zero(), swung = Vec3::Zero();
  double spun = 0.0;
  if (kept.placed) {
    moved = pose.p_W - kept.pose.p_W;
    swung = axle - kept.axle;
    spun = wrap(trial.spin - kept.spin);
    // Reversing counts once it has gone a good part of the contact, so that a wheel that rocks on the spot does not turn it.
    constexpr double part = 0.1;
    const double length = rolling.radius * *std::max_element(s.kept_entry.begin(), s.kept_entry.end());
    trial.backing = std::max(0.0, kept.backing - kept.direction * moved.dot(heading));
    if (trial.backing > std::max(params.springback, part * length)) {
      trial.direction = -kept.direction;
      trial.backing = 0.0;
    }
  } else {
    const double v = twist.v_W.dot(heading), w = twist.w_W.dot(axle);
    trial.direction = v < 0 || (v == 0 && w < 0) ? -1.0 : 1.0;
  }
  facing = trial.direction;
  e_f = facing * heading;
  e_y = facing * axle;
  motion.known = kept.placed;
  motion.radius = rolling.radius;
  motion.spin = facing * spun;
  motion.go = moved.dot(e_f);
  motion.sway = moved.dot(e_y);
  motion.up = moved.dot(e_d);
  motion.yaw = still(-facing * swung.dot(e_f));
  motion.roll = still(facing * swung.dot(e_d));
  trial.travel += std::abs(motion.go);
  trial.turned += motion.spin;
  return true;
}

void NodeSpringTerrain::Roll::describe() {
  context.angular_velocity = twist.w_W.dot(e_y);
  context.forward_velocity = twist.v_W.dot(e_f);
  rim_speed = context.angular_velocity * rolling.radius;
  const double v = context.forward_velocity;
  if (rim_speed > 0) context.slip = std::min(1.0, 1.0 - v / rim_speed);
  else if (v > 0 || rim_speed < 0) context.slip = -std::numeric_limits<double>::infinity();
  else context.slip = kept.slip_now;
  const double below = ground.grid_.base(pose.p_W.x(), pose.p_W.y());
  context.sinkage = std::max(0.0, rolling.radius - (pose.p_W.z() - below) * u.z());
  if (params.shear_history != ShearHistory::closed_form) {
    // What the soil feels of slip builds up as the rim passes through half its contact: a wheel that starts from rest has
    // no slip to speak of, whatever its first velocities say, and one that rocks on the spot has none. Rim and axle are
    // averaged along the path, each by itself.
    double rolled = rim_speed, gone = v, path = 0.5 * (std::abs(rim_speed) + std::abs(v)), left = 0.0;
    if (kept.placed && kept.touching) {
      const double length = 0.5 * std::sqrt(2.0 * rolling.radius * context.sinkage) + params.springback;
      rolled = rolling.radius * motion.spin;
      gone = motion.go;
      path = 0.5 * (std::abs(rolled) + std::abs(gone));
      left = std::exp(-path / length);
    } else if (std::max(std::abs(v), std::abs(rim_speed)) <= std::abs(twist.v_W.dot(e_d))) {
      rolled = gone = path;  // set down: on a slope a wheel then moves along it a little without turning
    }
    if (path > 0) {
      const double turned = facing * kept.direction;
      trial.rolled = turned * kept.rolled * left + rolled / path * (1 - left);
      trial.gone = turned * kept.gone * left + gone / path * (1 - left);
    } else if (left == 0) {
      trial.rolled = trial.gone = 1.0;
    }
    trial.slip_now = context.slip;
    constexpr double least = 0.05;  // below any steady motion but a locked wheel's
    const double sense = trial.rolled + trial.gone < 0 ? -1.0 : 1.0;  // backing before the contact has turned
    const double lag = sense * (trial.rolled - trial.gone);
    const double slip = std::clamp(lag / std::max({sense * trial.rolled, lag / kLockedSlip, least}), kLockedSlip, 1.0);
    if (!(std::isinf(context.slip) && slip < 0.99 * kLockedSlip)) context.slip = slip;
  }
  tan_slip_angle = v != 0 ? twist.v_W.dot(e_y) / std::abs(v) : 0.0;
  context.normal_load = kept.load;
  context.position = trial.travel;
  context.time = ground.t_;
  context.travel_length = params.travel_length;
  context.radius = rolling.radius;
  context.width = rolling.width;
  context.unit_weight = params.soil.unit_weight();
  context.wheel_angle = trial.turned;
  shape = {rolling.radius, context.slip, kept.load, 0.0};
  for (const bekker::StressModifier* m : ground.law_.contact) m->contact(context, shape);
  lift = shape.radius - rolling.radius;
  motion.stretch = shape.radius / rolling.radius;
}

// Distance from the arc's centre down to the ground as it lies, at the rim's point (x, y) that is `below` the centre.
double NodeSpringTerrain::Roll::clearance(double x, double y, double below) const {
  const Vec3 at = pose.p_W + x * e_f + y * e_y - (below - lift) * e_d;
  const double z = ground.grid_.height(at.x(), at.y());
  return lift - ((at.x() - pose.p_W.x()) * e_d.x() + (at.y() - pose.p_W.y()) * e_d.y() + (z - pose.p_W.z()) * e_d.z());
}

// theta_f: where R cos(theta) = clearance. Repeated substitution, which on level ground is exact at once; where the
// ground is steeper than the rim, a search from the front and halving.
double NodeSpringTerrain::Roll::entry_of(double y, double R, double guess) const {
  double theta = guess;
  double gap = clearance(R * std::sin(theta), y, R * std::cos(theta));
  for (int i = 0; i < 30 && gap < R; ++i) {
    const double next_theta = std::acos(std::max(gap / R, 0.0));
    const double next = clearance(R * std::sin(next_theta), y, R * std::cos(next_theta));
    if (next == gap || std::abs(next_theta - theta) <= 1e-14 * theta) return next_theta;
    theta = next_theta;
    gap = next;
  }
  if (level && ground.grid_.tile_count() == 0) return 0.0;
  const auto below = [&](double a) { return R * std::cos(a) - clearance(R * std::sin(a), y, R * std::cos(a)); };
  const double step = std::min(0.5 * params.spacing / R, 0.02);
  for (double a = 0.5 * kPi; a > -step; a -= step) {
    if (below(std::max(a, 0.0)) <= 0) continue;
    double lo = std::max(a, 0.0), hi = std::min(a + step, 0.5 * kPi);
    for (int i = 0; i < 60; ++i) (below(0.5 * (lo + hi)) > 0 ? lo : hi) = 0.5 * (lo + hi);
    return 0.5 * (lo + hi);
  }
  return 0.0;
}

void NodeSpringTerrain::Roll::find_entries() {
  entry_max = 0.0;
  for (std::size_t k = 0; k < s.offsets.size(); ++k) {
    const double y = s.offsets[k];
    double theta = entry_of(facing * y, radius_of(y), s.kept_entry[k]);
    // Strips that differ by rounding alone are alike.
    constexpr double rounding = 1e-14;
    if (k > 0 && std::abs(theta - s.entry_angle[0]) <= rounding) theta = s.entry_angle[0];
    s.entry_angle[k] = theta;
    entry_max = std::max(entry_max, theta);
  }
}

// Moving part of the exit angle: towards where the rim's surface neither presses nor parts, tan(theta) = rise / travel of
// the axle over the step, as the springback's worth of relative motion is made. Taken backwards in time: of first order
// where that angle changes, and stable at long steps, where a centred form lags and rings.
void NodeSpringTerrain::Roll::find_exit() {
  if (elastic) {
    trial.exit = 0.0;
    return;
  }
  double target = kept.exit;
  if (!kept.placed) target = -entry_max;  // set down
  else if (motion.go < 0) target = -entry_max;  // backing
  else if (motion.go > 0 || motion.up != 0) target = std::atan2(motion.up, motion.go);
  target = std::clamp(target, -entry_max, entry_max);
  trial.exit = target;
  if (kept.placed && kept.touching) {
    const double go = std::abs(motion.go), path = std::max(0.0, -motion.up) + go * std::sin(entry_max);
    const double left = std::exp(-path / params.springback);
    // Turned, the contact ends where it began.
    const double before = facing == kept.direction ? kept.exit : -entry_max;
    trial.exit += (before - target) * left;
    held_fast = std::exp(-go * std::sin(entry_max) / params.springback);
    const double turning = go * go + motion.up * motion.up;
    exit_gain = turning > 0 ? (1.0 - left) * go / turning : 0.0;
    // Rising, the contact lets go at its rear by less than sinking back restores there: what lies between is lost, and a
    // wheel that shakes on the spot comes to carry on both sides. Nothing is left to lose where it does.
    const double carried = std::max(0.0, entry_max + trial.exit);
    if (motion.up > 0 && entry_max > 0)
      trial.exit += 0.5 * carried * (entry_max - trial.exit) / entry_max * -std::expm1(-motion.up / params.springback);
    exit_gain += held_fast * carried / params.springback;
  }
}

void NodeSpringTerrain::Roll::lay_arcs() {
  s.arcs.clear();
  s.exit_sine.clear();
  s.rear_reach.clear();
  s.rear_end.clear();
  s.rear_share.clear();
  for (std::size_t k = 0; k < s.offsets.size(); ++k) {
    const double theta_f = s.entry_angle[k];
    bekker::ContactShape own = shape;
    own.radius = radius_of(s.offsets[k]);
    if (k > 0 && theta_f == s.entry_angle[k - 1] && own.radius == s.arcs.back().radius) {
      const ContactArc same = s.arcs.back();
      const double sine = s.exit_sine.back(), reach = s.rear_reach.back();
      s.rear_end.push_back(double(s.rear_end.back()));
      s.rear_share.push_back(double(s.rear_share.back()));
      s.arcs.push_back(same);
      s.exit_sine.push_back(sine);
      s.rear_reach.push_back(reach);
      continue;
    }
    own.rear_fraction = 0.0;
    bekker::ContactAngles angles = params.angles;
    const double drop = 1.0 - std::cos(theta_f);  // sinkage over radius
    if (shape.rear_fraction > 0) angles.theta_r = -std::acos(std::max(-1.0, 1.0 - shape.rear_fraction * drop));
    if (params.unloading == Unloading::elastic_plastic && theta_f > 0) {
      const double rebound = ground.springback(ground.soil_, own.radius * drop);
      angles.theta_r = std::min(angles.theta_r, -std::acos(std::max(-1.0, 1.0 - rebound / own.radius)));
    }
    s.rear_reach.push_back(own.radius * std::sin(std::max(angles.theta_r, -theta_f)));
    angles.theta_r = std::clamp(angles.theta_r + trial.exit, -theta_f, 0.999 * theta_f);
    const bool closed = params.shear_history == ShearHistory::closed_form;
    s.arcs.emplace_back(own, angles, closed ? params.skid_shear : bekker::SkidShear::as_printed,
                        params.soil.friction_angle, std::max(theta_f, 1e-12));
    s.exit_sine.push_back(std::sin(angles.theta_r));
    // Behind the peak the contact carries in proportion to its length there.
    const ContactArc& laid = s.arcs.back();
    constexpr double least = 0.1;  // of the contact
    const double pivot = std::max(laid.theta_m, laid.theta_r + least * (laid.theta_f - laid.theta_r));
    s.rear_end.push_back(laid.radius * std::sin(pivot));
    s.rear_share.push_back(pivot > laid.theta_r ? 1.0 / (pivot - laid.theta_r) : 0.0);
    const ContactArc &first = s.arcs.front(), &last = s.arcs.back();
    uniform = uniform && first.theta_f == last.theta_f && first.theta_r == last.theta_r && first.radius == last.radius;
  }
}

void NodeSpringTerrain::Roll::move_shear() {
  if (params.shear_history != ShearHistory::rim) return;
  RimShear::advance(s.shear, s.shear_trial, s.arcs, s.kept_entry, s.offsets, uniform, motion, facing, trial.spin,
                    ground.soil_.shear_modulus);
}

void NodeSpringTerrain::Roll::cell(Cell& out, const Node& node, std::size_t k, double px, double py, double xr, double yr,
                                   double H, double climb, double from, double to, double hold, double gap,
                                   const ShearPath* of_node) const {
  constexpr double gauss[2] = {0.5 - 0.28867513459481288225, 0.5 + 0.28867513459481288225};
  const ContactArc& arc = s.arcs[k];
  const double R = arc.radius, front_end = R * arc.sin_f, rear_end = R * s.exit_sine[k], peak = R * arc.sin_m;
  const bool spread = params.distribution == PressureDistribution::wong_reece;
  const bool split = spread && peak > from && peak < to;
  const int points = plain ? 2 : 4;
  for (int piece = 0; piece < (split ? 2 : 1); ++piece) {
    const double a = piece ? peak : from, b = split && !piece ? peak : to, length = b - a;
    for (int q = 0; q < points; ++q) {
      double x, run;  // place along the travel, and the length of ground it stands for
      if (!plain) {
        x = a + (q + 0.5) * length / points;
        run = length / points;
      } else if (b >= front_end) {
        // Where the contact ends the pressure starts like a broken power of the distance: with the coordinate squared
        // there, two points are enough.
        x = b - length * gauss[q] * gauss[q];
        run = length * gauss[q];
      } else if (a <= rear_end) {
        x = a + length * gauss[q] * gauss[q];
        run = length * gauss[q];
      } else {
        x = a + length * gauss[q];
        run = 0.5 * length;
      }
      double sin_t = x / R, cos_t = std::sqrt(1.0 - sin_t * sin_t), theta, below = R * cos_t - lift;
      Vec3 normal(sin_t, 0.0, -cos_t);  // out of the rim, into the ground
      if (plain) {
        theta = std::asin(sin_t);
      } else {
        const double y = std::clamp(yr, -half_width * (1 - 1e-9), half_width * (1 - 1e-9));
        const Vec3 origin = x * e_f + y * e_y - 2.0 * s.shape->bounding_radius() * e_d;
        const Quat to_body = pose.R_WB.conjugate();
        wheel::RayHit hit;
        if (!s.shape->ray(to_body * origin, to_body * e_d, hit) || hit.side) continue;
        const Vec3 p = pose.R_WB * hit.p_B, n = pose.R_WB * hit.n_B;
        below = -p.dot(e_d);
        normal = Vec3(n.dot(e_f), n.dot(e_y), n.dot(e_d));
        constexpr double steepest = 1e-3;  // walls are not met by lines that run up along them
        if (-normal.z() < steepest) continue;
        const double rho = std::sqrt(x * x + (below + lift) * (below + lift));
        sin_t = x / rho;
        cos_t = (below + lift) / rho;
        theta = std::atan2(x, below + lift);
      }
      // Depth in this contact, below the ground as it lay, and the depth that sets the pressure.
      const double depth = below + lift - H - climb * (x - xr) + node.raised - node.entry;
      if (depth <= 0) continue;
      const double equivalent = spread ? arc.equivalent(theta) : theta;
      const bool front = equivalent == theta;
      const double cos_e = front ? cos_t : std::cos(equivalent);
      const double z = front ? depth : depth + R * (cos_e - cos_t);
      if (z <= 0) continue;
      const double sinkage = z + node.entry;
      // The depth whose pressure counts, and what is left of it: on the way down through ground that was pressed before,
      // and where the node has let go by `gap` since.
      double share = hold, deepest = sinkage + gap;
      if (!elastic && sinkage < node.plastic) {
        share *= z / (node.plastic - node.entry);
        deepest = node.plastic;
      }

      ShearPath j;
      double length_j;
      if (of_node) {
        j = *of_node;
        length_j = std::sqrt(j.along * j.along + j.across * j.across);
      } else if (params.shear_history == ShearHistory::rim) {
        const ShearPath rim = s.shear_trial.at(theta, k, arc);
        j = rim;
        length_j = std::sqrt(j.along * j.along + j.across * j.across);
      } else {
        const double closed = arc.shear_displacement(theta, sin_t);
        const double sign = arc.shear_sign(theta, closed);
        if (std::isinf(closed)) {
          j = {sign, tan_slip_angle};
          length_j = std::numeric_limits<double>::infinity();
        } else {
          j = {sign * std::abs(closed), R * arc.one_minus_s * (arc.theta_f - theta) * tan_slip_angle};
          length_j = std::sqrt(j.along * j.along + j.across * j.across);
        }
      }

      bekker::LocalSoil soil = ground.soil_;
      if (ground.field_) ground.field_->at(px, py, deepest, soil);
      bekker::Stress stress;
      if (ground.law_.plain) {
        stress.sigma = bekker::power_law_pressure(soil, deepest);
        stress.tau = (soil.cohesion + share * stress.sigma * soil.tan_phi) * bekker::janosi_mobilised(soil, length_j);
        stress.sigma *= share;
      } else {
        bekker::Point point;
        point.sinkage = deepest;
        point.depth = depth + node.entry;
        point.theta = theta;
        point.sin_theta = sin_t;
        point.cos_theta = cos_t;
        point.shear_displacement = length_j;
        const double side = context.forward_velocity * tan_slip_angle, slide = rim_speed - context.forward_velocity * cos_t;
        point.slide_speed = std::sqrt(slide * slide + side * side);
        const double sin_e = front ? sin_t : std::sin(equivalent);
        point.penetration_speed = std::max(0.0, context.forward_velocity * sin_e - twist.v_W.dot(e_d) * cos_e);
        bekker::Context own = context;
        own.pass = node.passes + 1;
        stress = bekker::stress_at(soil, ground.law_, own, point);
        // What lets go of the ground lets go of the wheel: the law's shear is for full pressure.
        const double full = soil.cohesion + stress.sigma * soil.tan_phi;
        const double held = soil.cohesion + share * stress.sigma * soil.tan_phi;
        stress.tau *= full > 0 ? held / full : share;
        stress.sigma *= share;
        stress.drive *= share;
        stress.drag *= share;
      }
      if (share <= 0) continue;
      const double area = params.area == NodeArea::arc ? run / -normal.z() : run;
      if (params.damping > 0) {
        const Vec3 v = twist.v_W + twist.w_W.cross(x * e_f + yr * e_y - below * e_d);
        const double press = v.dot(normal.x() * e_f + normal.y() * e_y + normal.z() * e_d);
        const double damped = std::max(0.0, stress.sigma + params.damping * press);
        out.damping_power += area * (damped - stress.sigma) * press;
        stress.tau += (damped - stress.sigma) * soil.tan_phi * bekker::janosi_mobilised(soil, length_j);
        stress.sigma = damped;
      }

      // Shear on the body acts against the displacement of its surface, in the surface's plane.
      Vec3 shear = Vec3::Zero();
      const double direction = std::isinf(length_j) ? std::sqrt(j.along * j.along + j.across * j.across) : length_j;
      if (direction > 0) {
        const double along = stress.tau * j.along / direction, across = stress.tau * j.across / direction;
        if (plain) {
          shear = Vec3(along * cos_t, -across, along * sin_t);
        } else {
          const Vec3 tangent = Vec3(-normal.z(), 0.0, normal.x()).normalized();
          shear = along * tangent - across * normal.cross(tangent);
        }
      }
      const Vec3 arm(x, 0.0, -below);
      const Vec3 push = -area * stress.sigma * normal, drag = area * shear;
      out.normal += push;
      out.normal_moment += arm.cross(push);
      out.shear += drag;
      out.shear_moment += arm.cross(drag);
      out.drive += area * stress.drive;
      out.drag += area * stress.drag;
      out.area += area;
      out.compaction += area * stress.sigma * normal.x();
      const double back = std::max(ground.springback(soil, sinkage), 1e-12);
      if (!elastic) out.stored += 0.5 * area * stress.sigma * share * back;
      out.unload += area * -normal.z() * stress.sigma / back;
      out.load += area * -normal.z() * soil.n * stress.sigma / sinkage;
      const double gripped = area * (soil.cohesion + stress.sigma * soil.tan_phi) / soil.shear_modulus;
      out.slide += gripped;
      out.stick += gripped - area * std::min(stress.tau / soil.shear_modulus, gripped / area);
      if (x < s.rear_end[k]) out.rear += area * -normal.z() * stress.sigma;
      out.max_sinkage = std::max(out.max_sinkage, depth + node.entry - node.raised);
      out.max_shear = std::max(out.max_shear, length_j);
      out.loaded = true;

      const bool edge = std::abs(std::abs(yr) - half_width) <= 0.5 * params.spacing;
      if (params.side_wall == SideWall::hegedus && edge && j.across * yr > 0) {
        const double wedge = bekker::bulldozing_resistance(soil.cohesion, soil.tan_phi, context.unit_weight, depth + node.entry);
        out.side -= std::copysign(run * wedge * bekker::janosi_mobilised(soil, std::abs(j.across)), j.across);
      }
    }
  }
}

void NodeSpringTerrain::Roll::sum(Sums& sums) const {
  // Lattice cells are taken as squares along the wheel's axes.
  const double dx = params.spacing;
  const double hx = 0.5 * dx / std::hypot(e_f.x(), e_f.y()), hy = 0.5 * dx / std::hypot(e_y.x(), e_y.y());
  double x_from = 1e300, x_to = -1e300;
  for (std::size_t k = 0; k < s.arcs.size(); ++k) {
    x_from = std::min(x_from, s.arcs[k].radius * s.exit_sine[k] - hx);
    x_to = std::max(x_to, s.arcs[k].radius * s.arcs[k].sin_f + hx);
  }
  const double bottom = clearance(0.0, 0.0, shape.radius) - lift;
  double bx0 = 1e300, bx1 = -1e300, by0 = 1e300, by1 = -1e300;
  for (const double a : {x_from, x_to})
    for (const double b : {-half_width - hy, half_width + hy}) {
      const Vec3 corner = pose.p_W + a * e_f + b * e_y - bottom * e_d;
      bx0 = std::min(bx0, corner.x());
      bx1 = std::max(bx1, corner.x());
      by0 = std::min(by0, corner.y());
      by1 = std::max(by1, corner.y());
    }
  const auto first = [&](double a) { return static_cast<int>(std::ceil(a / dx)); };
  const auto last = [&](double a) { return static_cast<int>(std::floor(a / dx)); };
  const int ix0 = first(bx0), ix1 = last(bx1), iy0 = first(by0), iy1 = last(by1);

  static const Node virgin{};
  const bool of_ground = params.shear_history == ShearHistory::ground;
  // Untouched nodes side by side under a wheel that runs along the lattice answer alike: the last answer is kept.
  const bool may_repeat = plain && level && uniform && !ground.field_ && !of_ground && params.damping == 0 &&
                          params.side_wall == SideWall::none &&
                          (params.shear_history == ShearHistory::closed_form || s.shear_trial.uniform());
  double last_from = 0.0, last_to = 0.0, last_H = std::numeric_limits<double>::quiet_NaN();
  Cell repeated, own;

  const double strip_width = rolling.width / static_cast<double>(s.arcs.size());
  for (int ix = ix0; ix <= ix1; ++ix) {
    for (int iy = iy0; iy <= iy1; ++iy) {
      const double px = ix * dx, py = iy * dx;
      const NodeSurface base = ground.grid_.surface_at({ix, iy});
      const Vec3 rel(px - pose.p_W.x(), py - pose.p_W.y(), base.z - pose.p_W.z());
      const double xr = rel.dot(e_f), yr = rel.dot(e_y);
      const double cover = std::min(yr + hy, half_width) - std::max(yr - hy, -half_width);
      if (cover <= 1e-9 * dx) continue;
      const double strip = (facing * yr + half_width) / strip_width;
      const std::size_t k = strip <= 0 ? 0 : std::min(static_cast<std::size_t>(strip), s.arcs.size() - 1);
      const ContactArc& arc = s.arcs[k];
      if (arc.theta_f <= 1e-9) continue;
      const double R = arc.radius, rear_end = R * s.exit_sine[k];
      const double from = std::max(xr - hx, rear_end), to = std::min(xr + hx, R * arc.sin_f);
      if (to <= from) continue;
      const Node* found = ground.grid_.find({ix, iy});
      const Node& node = found ? *found : virgin;
      if (node.removed) continue;
      const double H = lift - rel.dot(e_d);  // undisturbed surface below the arc's centre
      const bool in_contact = node.body == s.id;

      // Sinkage of the node's centre under the rim: what it will remember, and by how much it has let go.
      const double xc = std::clamp(xr, -R, R);
      const double centre = std::max(std::sqrt(R * R - xc * xc) - H + node.raised, node.entry);
      double hold = 1.0, gap = 0.0;
      if (!elastic && in_contact && xr >= rear_end) {
        // Where contact reaches behind the lowest point by its law, the rim's rise there is part of that law.
        const double risen = xr < 0 && xr > s.rear_reach[k] ? R - std::sqrt(R * R - xc * xc) : 0.0;
        const double reached = node.reached - risen;
        if (reached > std::max(centre, node.plastic)) {
          const double back = ground.springback(ground.soil_at(px, py, reached), reached);
          gap = reached - std::max(centre, node.plastic);
          hold = std::max(0.0, 1.0 - (reached - centre) / std::max(back, 1e-12));
        }
      }
      s.touches.push_back({{ix, iy}, centre, 0.0, 0.0});
      ShearPath of_node;
      if (of_ground) {
        // Kept by the ground in the body's sense of driving, and across along its axle.
        const double sn = xc / R, c = std::sqrt(1.0 - sn * sn);
        const double along = motion.radius * motion.spin - (motion.go * c + motion.up * sn) + yr * motion.yaw * c;
        BodyState::Touch& touch = s.touches.back();
        const ShearPath before = in_contact ? ShearPath{node.shear_x, node.shear_y} : ShearPath{};
        const ShearPath carried = carried_on(before, {facing * along, facing * (motion.sway + xc * motion.yaw)},
                                             ground.soil_.shear_modulus);
        touch.shear_x = carried.along;
        touch.shear_y = carried.across;
        of_node = {facing * touch.shear_x, facing * touch.shear_y};
      }

      const bool untouched = hold == 1.0 && node.entry == 0 && node.plastic == 0 && node.raised == 0 && node.passes == 0;
      const Cell* c = &repeated;
      if (!(may_repeat && untouched && from == last_from && to == last_to && H == last_H)) {
        double climb = 0.0;  // of the undisturbed surface along e_f, downwards from the frame's plane
        if (!level) {
          climb = -((base.gx * e_f.x() + base.gy * e_f.y()) * e_d.z() + e_f.x() * e_d.x() + e_f.y() * e_d.y());
        }
        Cell& fresh = may_repeat && untouched ? repeated : own;
        fresh = Cell{};
        cell(fresh, node, k, px, py, xr, yr, H, climb, from, to, hold, gap, of_ground ? &of_node : nullptr);
        if (&fresh == &repeated) {
          last_from = from;
          last_to = to;
          last_H = H;
        }
        c = &fresh;
      }
      if (!c->loaded) continue;
      ++sums.count;
      // Moments of the cell's own middle; yr e_y x F adds its place across the width.
      const auto across = [&](const Vec3& F) { return Vec3(yr * F.z(), 0.0, -yr * F.x()); };
      sums.normal += cover * c->normal;
      sums.normal_moment += cover * (c->normal_moment + across(c->normal));
      sums.shear += cover * c->shear;
      sums.shear_moment += cover * (c->shear_moment + across(c->shear));
      if (c->side != 0) {
        // The side wall stands at the edge; its wedge acts at a third of the height.
        const Vec3 side(0.0, c->side, 0.0), arm(xr, yr, -(H - lift) - 2.0 / 3.0 * c->max_sinkage);
        sums.normal += side;
        sums.normal_moment += arm.cross(side);
      }
      sums.drive += cover * c->drive;
      sums.drag += cover * c->drag;
      sums.area += cover * c->area;
      sums.compaction += cover * c->compaction;
      sums.stored += cover * c->stored;
      sums.damping_power += cover * c->damping_power;
      sums.unload_stiffness += cover * c->unload;
      sums.load_stiffness += cover * c->load;
      sums.shear_stiffness += cover * c->slide;
      sums.stick_stiffness += cover * c->stick;
      sums.exit_stiffness += cover * c->rear * s.rear_share[k];
      sums.max_sinkage = std::max(sums.max_sinkage, c->max_sinkage);
      if (record && c->area > 0) {
        PatchNode shown;
        shown.area = cover * c->area;
        const double sigma = c->normal.norm() / c->area;
        const auto world = [&](const Vec3& v) -> Vec3 { return v.x() * e_f + v.y() * e_y + v.z() * e_d; };
        shown.n_W = sigma > 0 ? Vec3(world(-c->normal).normalized()) : Vec3(-u);
        const double x = 0.5 * (from + to);
        shown.p_W = pose.p_W + x * e_f + yr * e_y - (std::sqrt(R * R - x * x) - lift) * e_d;
        shown.pressure = sigma;
        shown.shear_W = world(c->shear) / c->area;
        shown.sinkage = c->max_sinkage;
        shown.shear_displacement = c->max_shear;
        shown.passes = node.passes;
        record->push_back(shown);
      }
    }
  }
}

ContactResult NodeSpringTerrain::Roll::result(const Sums& sums) const {
  ContactResult r;
  const auto world = [&](const Vec3& v) -> Vec3 { return v.x() * e_f + v.y() * e_y + v.z() * e_d; };
  Vec3 normal_moment = sums.normal_moment, shear_moment = sums.shear_moment;
  if (lift != 0) {
    // The rim of a flexible wheel runs along the flattened arc at its own speed: stress along the arc's normals does no
    // work on it, shear has the lever of the rim.
    normal_moment.y() -= lift * sums.normal.x();
    shear_moment.y() = (shear_moment.y() - lift * sums.shear.x()) / motion.stretch;
  }
  Vec3 force = sums.normal + sums.shear, moment = normal_moment + shear_moment;
  // Soil wedges push horizontally: the thrust with its torque, the drag through the axle.
  force.x() += sums.drive - sums.drag;
  moment.y() -= rolling.radius * sums.drive;
  r.wrench = {world(force), world(moment)};
  r.shear = {world(sums.shear + sums.drive * Vec3::UnitX()), world(sums.shear_moment - rolling.radius * sums.drive * Vec3::UnitY())};
  const Vec3 v(twist.v_W.dot(e_f), twist.v_W.dot(e_y), twist.v_W.dot(e_d));
  const Vec3 w(twist.w_W.dot(e_f), twist.w_W.dot(e_y), twist.w_W.dot(e_d));
  r.contact_count = sums.count;
  r.contact_area = sums.area;
  r.compaction_resistance = sums.compaction;
  r.max_sinkage = sums.max_sinkage;
  r.stored_energy = sums.stored;
  r.damping_power = sums.damping_power;
  r.slip_power = -(sums.shear.dot(v) + shear_moment.dot(w)) - sums.drive * (v.x() - rolling.radius * w.y());
  r.plastic_power = -(sums.normal.dot(v) + normal_moment.dot(w)) + sums.drag * v.x() - sums.damping_power;
  if (kept.placed && ground.t_ > kept.time) r.plastic_power -= (sums.stored - kept.stored) / (ground.t_ - kept.time);
  // Loading along the normal and sliding across it act at the lowest point.
  const Mat3 along = u * u.transpose(), pull = sums.load_stiffness * along + sums.shear_stiffness * (Mat3::Identity() - along);
  const Vec3 arm = -rolling.radius * u;
  Mat3 lever;  // arm x
  lever << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
  r.stiffness.topLeftCorner<3, 3>() = pull;
  r.stiffness.bottomLeftCorner<3, 3>() = lever * pull;
  r.stiffness.topRightCorner<3, 3>() = pull * lever.transpose();
  r.stiffness.bottomRightCorner<3, 3>() = lever * pull * lever.transpose();
  r.normal_W = u;
  r.grip_W = arm;
  r.stick_stiffness = sums.stick_stiffness;
  if (!elastic) r.release_stiffness = sums.load_stiffness + held_fast * sums.unload_stiffness + exit_gain * sums.exit_stiffness;
  if (params.damping > 0) r.damping.topLeftCorner<3, 3>() = params.damping * sums.area * (u * u.transpose());
  trial.touching = sums.count > 0;
  trial.load = r.wrench.F_W.dot(u);
  trial.stored = sums.stored;
  return r;
}

bool NodeSpringTerrain::roll(BodyState& s, const Pose& pose, const Twist& twist, std::vector<PatchNode>* record,
                             ContactResult& out) const {
  Roll contact(*this, s, pose, twist, record);
  if (!contact.lay_frame()) return false;
  contact.describe();
  contact.find_entries();
  if (contact.entry_max <= 0) {
    s.shear_trial.clear();
    out = {};
    return true;
  }
  contact.find_exit();
  contact.lay_arcs();
  contact.move_shear();
  Sums sums;
  contact.sum(sums);
  out = contact.result(sums);
  return true;
}

}  // namespace terrode::terrain
