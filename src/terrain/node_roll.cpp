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

  bool lay_frame();
  void describe();
  double radius_of(double y) const {
    if (!plain && !s.wheel) return rolling.outer + lift;
    double r = plain ? shape.radius : s.wheel->radius_at(y) + lift;
    if (s.wheel && s.wheel->shape().grousers.count > 0) r += s.wheel->shape().grousers.height;
    return r;
  }
  double clearance(double x, double y, double below) const;
  double entry_of(double y, double R, double guess) const;
  void find_entries();
  void find_exit();
  void lay_arcs();
  void move_shear();
  // A node as the quadrature meets it.
  struct Place {
    const Node& node;
    std::size_t strip;
    double px, py;     // in the world [m]
    double xr, yr;     // in the contact's frame [m]
    double H, climb;   // ground below the arc's centre [m], its slope along e_f
    double hold, gap;  // what is left of the pressure; how far the node has let go [m]
    const ShearPath* of_node;
  };
  void cell(RollCell& out, const Place& at, double from, double to) const;
  void point(RollCell& out, const Place& at, double x, double run) const;
  void lay_panels(const Place& like) const;
  // Spreads a node's part of the contact over the panels it lies in; `record` gets what it gives per metre of width.
  void spread(double from, double to, double cover, double yr, RollCell* shown) const;
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
    // The entry angle of the middle of the step, as motion and target are: of second order while the step is short
    // against the springback.
    const double entry_before = *std::max_element(s.kept_entry.begin(), s.kept_entry.end());
    const double go = std::abs(motion.go), path = std::max(0.0, -motion.up) + go * std::sin(0.5 * (entry_max + entry_before));
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
      const double rebound = ground.springback(ground.soil_at(pose.p_W.x(), pose.p_W.y(), own.radius * drop), own.radius * drop, s.width);
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

void NodeSpringTerrain::Roll::cell(RollCell& out, const Place& at, double from, double to) const {
  constexpr double gauss[2] = {0.5 - 0.28867513459481288225, 0.5 + 0.28867513459481288225};
  const ContactArc& arc = s.arcs[at.strip];
  const double R = arc.radius, front_end = R * arc.sin_f, rear_end = R * s.exit_sine[at.strip], peak = R * arc.sin_m;
  const bool split = params.distribution == PressureDistribution::wong_reece && peak > from && peak < to;
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
      point(out, at, x, run);
    }
  }
}

namespace {

// Gauss points on [0, 1], and the integrals from 0 to u of the parabolas that are 1 at one of them and 0 at the others.
constexpr double kGauss3[3] = {0.5 - 0.38729833462074168852, 0.5, 0.5 + 0.38729833462074168852};

struct Parabolas {
  double cubic[3], square[3], linear[3];
  constexpr Parabolas() : cubic(), square(), linear() {
    for (int i = 0; i < 3; ++i) {
      const double p = kGauss3[(i + 1) % 3], q = kGauss3[(i + 2) % 3], scale = 1.0 / ((kGauss3[i] - p) * (kGauss3[i] - q));
      cubic[i] = scale / 3.0;
      square[i] = -0.5 * scale * (p + q);
      linear[i] = scale * p * q;
    }
  }
};
constexpr Parabolas kParabolas;
constexpr double kWhole[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

}  // namespace

// A contact whose strips are all alike, over ground that nothing has touched: the stress is the same function of x
// everywhere, and is evaluated once for all nodes, in panels about as long as the nodes are apart.
void NodeSpringTerrain::Roll::lay_panels(const Place& like) const {
  const ContactArc& arc = s.arcs.front();
  const double front = arc.radius * arc.sin_f, rear = arc.radius * s.exit_sine.front();
  const double peak = params.distribution == PressureDistribution::wong_reece ? std::clamp(arc.radius * arc.sin_m, rear, front) : rear;
  s.panels.clear();
  const auto lay = [&](double a, double b) {
    constexpr int fewest = 3;
    if (!(b - a > 1e-12 * arc.radius)) return;
    const int count = std::max(fewest, static_cast<int>(std::ceil((b - a) / params.spacing)));
    for (int i = 0; i < count; ++i) {
      RollPanel p;
      p.length = (b - a) / count;
      p.begin = a + i * p.length;
      p.end = i + 1 == count ? b : a + (i + 1) * p.length;
      p.root = b == front && i + 1 == count ? 1 : a == rear && i == 0 ? -1 : 0;
      for (int q = 0; q < 3; ++q) {
        const double c = kGauss3[q], share = p.root == 0 ? c : p.root > 0 ? 1.0 - c * c : c * c;
        point(p.at[q], like, p.begin + p.length * share, p.length * (p.root == 0 ? 1.0 : 2.0 * c));
      }
      s.panels.push_back(p);
    }
  };
  lay(rear, peak);
  lay(peak, front);
}

void NodeSpringTerrain::Roll::spread(double from, double to, double cover, double yr, RollCell* shown) const {
  // Few panels: from the one that holds `from` on.
  auto p = std::partition_point(s.panels.begin(), s.panels.end(), [&](const RollPanel& q) { return q.end <= from; });
  for (; p != s.panels.end() && p->begin < to; ++p) {
    double w[3] = {kWhole[0], kWhole[1], kWhole[2]};
    // Less what lies before `from` and after `to`.
    const auto less = [&](double x, bool before) {
      const double c = p->coordinate(x);
      const bool below = before == (p->root <= 0);  // in the panel's coordinate
      for (int i = 0; i < 3; ++i) {
        const double part = c * (kParabolas.linear[i] + c * (kParabolas.square[i] + c * kParabolas.cubic[i]));
        w[i] -= below ? part : kWhole[i] - part;
      }
    };
    if (from > p->begin) less(from, true);
    if (to < p->end) less(to, false);
    const double moment = cover * yr;
    for (int i = 0; i < 3; ++i) {
      p->width[i] += cover * w[i];
      p->moment[i] += moment * w[i];
    }
    if (!shown) continue;
    for (int i = 0; i < 3; ++i) {
      shown->add(p->at[i], w[i]);
      shown->loaded = true;
      shown->max_sinkage = std::max(shown->max_sinkage, p->at[i].max_sinkage);
      shown->max_shear = std::max(shown->max_shear, p->at[i].max_shear);
    }
  }
}

// Adds what the point x of a node's strip gives for `run` of ground along the travel.
void NodeSpringTerrain::Roll::point(RollCell& out, const Place& at, double x, double run) const {
  const ContactArc& arc = s.arcs[at.strip];
  const double R = arc.radius;
  const bool spread = params.distribution == PressureDistribution::wong_reece;
  double sin_t = x / R, cos_t = std::sqrt(1.0 - sin_t * sin_t), theta, below = R * cos_t - lift;
  Vec3 normal(sin_t, 0.0, -cos_t);  // out of the rim, into the ground
  if (plain) {
    theta = std::asin(sin_t);
  } else {
    const double y = std::clamp(at.yr, -half_width * (1 - 1e-9), half_width * (1 - 1e-9));
    const Vec3 origin = x * e_f + y * e_y - 2.0 * s.shape->bounding_radius() * e_d;
    const Quat to_body = pose.R_WB.conjugate();
    wheel::RayHit hit;
    if (!s.shape->ray(to_body * origin, to_body * e_d, hit) || hit.side) return;
    const Vec3 p = pose.R_WB * hit.p_B, n = pose.R_WB * hit.n_B;
    below = -p.dot(e_d);
    normal = Vec3(n.dot(e_f), n.dot(e_y), n.dot(e_d));
    constexpr double steepest = 1e-3;  // walls are not met by lines that run up along them
    if (-normal.z() < steepest) return;
    const double rho = std::sqrt(x * x + (below + lift) * (below + lift));
    sin_t = x / rho;
    cos_t = (below + lift) / rho;
    theta = std::atan2(x, below + lift);
  }
  // Depth in this contact, below the ground as it lay, and the depth that sets the pressure.
  const double depth = below + lift - at.H - at.climb * (x - at.xr) + at.node.raised - at.node.entry;
  if (depth <= 0) return;
  // A lug or a crown may lie behind the arc's end, where Eq. 8 has no angle.
  const double equivalent = spread ? arc.equivalent(std::max(theta, arc.theta_r)) : theta;
  const bool front = equivalent == theta;
  const double cos_e = front ? cos_t : std::cos(equivalent);
  const double z = front ? depth : depth + R * (cos_e - cos_t);
  if (z <= 0) return;
  const double sinkage = z + at.node.entry;
  // The depth whose pressure counts, and what is left of it: on the way down through ground that was pressed before,
  // and where the node has let go by `gap` since.
  double share = at.hold, deepest = sinkage + at.gap;
  if (!elastic && sinkage < at.node.plastic) {
    share *= z / (at.node.plastic - at.node.entry);
    deepest = at.node.plastic;
  }

  ShearPath j;
  double length_j;
  if (at.of_node) {
    j = *at.of_node;
    length_j = std::sqrt(j.along * j.along + j.across * j.across);
  } else if (params.shear_history == ShearHistory::rim) {
    const ShearPath rim = s.shear_trial.at(theta, at.strip, arc);
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
  if (ground.field_) ground.field_->at(at.px, at.py, deepest, soil);
  bekker::Stress stress;
  if (ground.law_.plain) {
    stress.sigma = bekker::power_law_pressure(soil, deepest);
    stress.tau = (soil.cohesion + share * stress.sigma * soil.tan_phi) * bekker::janosi_mobilised(soil, length_j);
    stress.sigma *= share;
  } else {
    bekker::Point point;
    point.sinkage = deepest;
    point.depth = depth + at.node.entry;
    point.theta = theta;
    point.sin_theta = sin_t;
    point.cos_theta = cos_t;
    point.shear_displacement = length_j;
    point.entry_angle = arc.theta_f;
    const double side = context.forward_velocity * tan_slip_angle, slide = rim_speed - context.forward_velocity * cos_t;
    point.slide_speed = std::sqrt(slide * slide + side * side);
    const double sin_e = front ? sin_t : std::sin(equivalent);
    point.penetration_speed = std::max(0.0, context.forward_velocity * sin_e - twist.v_W.dot(e_d) * cos_e);
    bekker::Context own = context;
    own.pass = at.node.passes + 1;
    stress = bekker::stress_at(soil, ground.law_, own, point);
    // What lets go of the ground lets go of the wheel: the law's shear is for full pressure.
    const double full = soil.cohesion + stress.sigma * soil.tan_phi;
    const double held = soil.cohesion + share * stress.sigma * soil.tan_phi;
    stress.tau *= full > 0 ? held / full : share;
    stress.sigma *= share;
    stress.drive *= share;
    stress.drag *= share;
  }
  if (share <= 0) return;
  const double area = params.area == NodeArea::arc ? run / -normal.z() : run;
  const double stiffness = ground.exponent(soil, sinkage) * stress.sigma / sinkage;
  if (ground.damps()) {
    const Vec3 v = twist.v_W + twist.w_W.cross(x * e_f + at.yr * e_y - below * e_d);
    const double press = v.dot(normal.x() * e_f + normal.y() * e_y + normal.z() * e_d);
    const double damped = std::max(0.0, stress.sigma + (params.damping + params.damping_time * stiffness) * press);
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
  const double back = std::max(ground.springback(soil, sinkage, s.width), 1e-12);
  if (!elastic) out.stored += 0.5 * area * stress.sigma * share * back;
  out.unload += area * -normal.z() * stress.sigma / back;
  out.load += area * -normal.z() * stiffness;
  const double gripped = area * (soil.cohesion + stress.sigma * soil.tan_phi) / soil.shear_modulus;
  out.slide += gripped;
  out.stick += gripped - area * std::min(stress.tau / soil.shear_modulus, gripped / area);
  if (x < s.rear_end[at.strip]) out.rear += area * -normal.z() * stress.sigma;
  out.max_sinkage = std::max(out.max_sinkage, depth + at.node.entry - at.node.raised);
  out.max_shear = std::max(out.max_shear, length_j);
  out.loaded = true;

  const bool edge = std::abs(std::abs(at.yr) - half_width) <= 0.5 * params.spacing;
  if (params.side_wall == SideWall::hegedus && edge && j.across * at.yr > 0) {
    const double wedge = bekker::bulldozing_resistance(soil.cohesion, soil.tan_phi, context.unit_weight, depth + at.node.entry);
    out.side -= std::copysign(run * wedge * bekker::janosi_mobilised(soil, std::abs(j.across)), j.across);
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
  const bool may_repeat = plain && level && uniform && (!ground.field_ || ground.field_->same_everywhere()) && !of_ground && !ground.damps() &&
                          params.side_wall == SideWall::none &&
                          (params.shear_history == ShearHistory::closed_form || s.shear_trial.uniform());
  double last_from = 0.0, last_to = 0.0, last_H = std::numeric_limits<double>::quiet_NaN();
  // Turned, each node covers another part of the same contact.
  const bool straight = std::abs(e_f.x() * e_f.y()) < 1e-9, upright = std::abs(e_d.x()) + std::abs(e_d.y()) < 1e-9;
  const bool panels = may_repeat && !straight && upright && !s.arcs.empty() && s.arcs.front().theta_f > 1e-9;
  RollCell repeated, own;
  if (panels) {
    const Place like{virgin, 0, 0.0, 0.0, 0.0, 0.0, lift + pose.p_W.z() - *ground.grid_.level(), 0.0, 1.0, 0.0, nullptr};
    lay_panels(like);
    // The deepest place, which no Gauss point meets.
    const double lowest = std::clamp(0.0, s.arcs.front().radius * s.exit_sine.front(), s.arcs.front().radius * s.arcs.front().sin_f);
    point(own, like, lowest, 0.0);
    sums.max_sinkage = std::max(sums.max_sinkage, own.max_sinkage);
  }

  // Adds a part of the contact: `width` of it [m], and the width times its place across [m2].
  const auto take = [&](const RollCell& c, double width, double moment, std::size_t strip) {
    const auto across = [](const Vec3& F) { return Vec3(F.z(), 0.0, -F.x()); };  // e_y x F
    sums.normal += width * c.normal;
    sums.normal_moment += width * c.normal_moment + moment * across(c.normal);
    sums.shear += width * c.shear;
    sums.shear_moment += width * c.shear_moment + moment * across(c.shear);
    sums.drive += width * c.drive;
    sums.drag += width * c.drag;
    sums.area += width * c.area;
    sums.compaction += width * c.compaction;
    sums.stored += width * c.stored;
    sums.damping_power += width * c.damping_power;
    sums.unload_stiffness += width * c.unload;
    sums.load_stiffness += width * c.load;
    sums.shear_stiffness += width * c.slide;
    sums.stick_stiffness += width * c.stick;
    sums.exit_stiffness += width * c.rear * s.rear_share[strip];
  };
  const auto show = [&](const RollCell& c, double cover, double from, double to, double yr, double R, int passes) {
    if (!(c.area > 0)) return;
    PatchNode shown;
    shown.area = cover * c.area;
    const double sigma = c.normal.norm() / c.area;
    const auto world = [&](const Vec3& v) -> Vec3 { return v.x() * e_f + v.y() * e_y + v.z() * e_d; };
    shown.n_W = sigma > 0 ? Vec3(world(-c.normal).normalized()) : Vec3(-u);
    const double x = 0.5 * (from + to);
    shown.p_W = pose.p_W + x * e_f + yr * e_y - (std::sqrt(R * R - x * x) - lift) * e_d;
    shown.pressure = sigma;
    shown.shear_W = world(c.shear) / c.area;
    shown.sinkage = c.max_sinkage;
    shown.shear_displacement = c.max_shear;
    shown.passes = passes;
    record->push_back(shown);
  };

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
          const double back = ground.springback(ground.soil_at(px, py, reached), reached, s.width);
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
      if (panels && untouched) {
        ++sums.count;
        RollCell* shown = nullptr;
        if (record) {
          own = RollCell{};
          shown = &own;
        }
        spread(from, to, cover, yr, shown);
        if (shown) show(*shown, cover, from, to, yr, R, node.passes);
        continue;
      }
      const RollCell* c = &repeated;
      if (!(may_repeat && untouched && from == last_from && to == last_to && H == last_H)) {
        double climb = 0.0;  // of the undisturbed surface along e_f, downwards from the frame's plane
        if (!level) {
          climb = -((base.gx * e_f.x() + base.gy * e_f.y()) * e_d.z() + e_f.x() * e_d.x() + e_f.y() * e_d.y());
        }
        RollCell& fresh = may_repeat && untouched ? repeated : own;
        fresh = RollCell{};
        cell(fresh, {node, k, px, py, xr, yr, H, climb, hold, gap, of_ground ? &of_node : nullptr}, from, to);
        if (&fresh == &repeated) {
          last_from = from;
          last_to = to;
          last_H = H;
        }
        c = &fresh;
      }
      if (!c->loaded) continue;
      ++sums.count;
      take(*c, cover, cover * yr, k);
      if (c->side != 0) {
        // The side wall stands at the edge; its wedge acts at a third of the height.
        const Vec3 side(0.0, c->side, 0.0), arm(xr, yr, -(H - lift) - 2.0 / 3.0 * c->max_sinkage);
        sums.normal += side;
        sums.normal_moment += arm.cross(side);
      }
      sums.max_sinkage = std::max(sums.max_sinkage, c->max_sinkage);
      if (record) show(*c, cover, from, to, yr, R, node.passes);
    }
  }
  if (panels)
    for (const RollPanel& p : s.panels)
      for (int q = 0; q < 3; ++q) take(p.at[q], p.width[q], p.moment[q], 0);
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
  if (ground.damps())
    r.damping.topLeftCorner<3, 3>() = (params.damping * sums.area + params.damping_time * sums.load_stiffness) * (u * u.transpose());
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
