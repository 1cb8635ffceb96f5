#include "wheel/wheel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace terrode::wheel {

Problems WheelShape::validate() const {
  Problems p;
  require(p, "radius", radius, "m", radius > 0, "a length above 0");
  require(p, "width", width, "m", width > 0, "a length above 0");
  require(p, "crown_radius", crown_radius, "m", crown_radius == 0 || crown_radius >= 0.5 * width,
          "0 for a flat rim, or at least half the width");
  if (crown_radius > 0 && crown_radius >= 0.5 * width) {
    const double drop = crown_radius - std::sqrt(crown_radius * crown_radius - 0.25 * width * width);
    require(p, "crown_radius", crown_radius, "m", drop < radius, "one that leaves a rim at the side walls");
  }
  if (grousers.count < 0) p.push_back({{}, 0, 0, "grousers.count", "is " + std::to_string(grousers.count), "0 or more"});
  if (grousers.count > 0) {
    require(p, "grousers.height", grousers.height, "m", grousers.height > 0, "a length above 0");
    require(p, "grousers.thickness", grousers.thickness, "m", grousers.thickness > 0, "a length above 0");
    require(p, "grousers.phase", grousers.phase, "rad", true, "an angle");
    if (grousers.shape == GrouserShape::tapered)
      require(p, "grousers.tip_thickness", grousers.tip_thickness, "m",
              grousers.tip_thickness > 0 && grousers.tip_thickness <= grousers.thickness,
              "above 0 and not above the thickness");
    require(p, "grousers.thickness", grousers.thickness, "m",
            grousers.thickness * grousers.count < 2 * std::numbers::pi * radius, "lugs that fit around the rim");
  }
  return p;
}

Wheel::Wheel(const WheelShape& shape) : shape_(shape) {
  throw_if_any(shape.validate());
  rolling_ = {shape.radius, shape.width, shape.radius + (shape.grousers.count > 0 ? shape.grousers.height : 0.0)};
  const Grousers& g = shape.grousers;
  const double half = 0.5 * shape.width;
  bounding_radius_ = std::hypot(shape.radius, half);
  if (g.count > 0) {
    const double a = 0.5 * g.thickness;
    const double tip = g.shape == GrouserShape::straight ? a : g.shape == GrouserShape::tapered ? 0.5 * g.tip_thickness : 0.0;
    // The root reaches below the rim's lowest radius so that no gap opens between a flat root and the round rim.
    const double drop = shape.crown_radius > 0 ? shape.radius - radius_at(half) : 0.0;
    const double root = std::max(0.25 * shape.radius, shape.radius - drop - a);
    const double top = shape.radius + g.height;
    // Side lines pass through +-a at the rim's radius and +-tip at the tip.
    const double at_root = a + (a - tip) * (shape.radius - root) / g.height;
    std::vector<Eigen::Vector2d> corners;
    if (tip > 0) corners = {{-tip, -top}, {tip, -top}, {at_root, -root}, {-at_root, -root}};
    else corners = {{0.0, -top}, {at_root, -root}, {-at_root, -root}};
    lug_shape_.emplace_back(std::move(corners), half);
    for (int i = 0; i < g.count; ++i) {
      const double angle = g.phase + 2 * std::numbers::pi * i / g.count;
      lugs_.push_back({std::cos(angle), std::sin(angle)});
    }
    bounding_radius_ = std::max(bounding_radius_, lug_shape_[0].bounding_radius());
  }
}

double Wheel::radius_at(double y) const {
  const double C = shape_.crown_radius;
  if (C == 0) return shape_.radius;
  return shape_.radius - (C - std::sqrt(std::max(0.0, C * C - y * y)));
}

bool Wheel::rim_ray(const Vec3& o, const Vec3& d, RayHit& hit) const {
  const double half = 0.5 * shape_.width, r = shape_.radius;
  // Slab of the side walls.
  double in = -std::numeric_limits<double>::infinity(), out = std::numeric_limits<double>::infinity();
  if (d.y() != 0) {
    const double t1 = (-half - o.y()) / d.y(), t2 = (half - o.y()) / d.y();
    in = std::min(t1, t2);
    out = std::max(t1, t2);
  } else if (std::abs(o.y()) > half) {
    return false;
  }
  // Cylinder of the greatest radius.
  const double a = d.x() * d.x() + d.z() * d.z();
  const double bq = o.x() * d.x() + o.z() * d.z();
  const double c = o.x() * o.x() + o.z() * o.z() - r * r;
  double round = -std::numeric_limits<double>::infinity(), round_out = std::numeric_limits<double>::infinity();
  if (a > 0) {
    const double disc = bq * bq - a * c;
    if (disc < 0) return false;
    // The stable pair of roots: no difference of nearly equal numbers.
    const double q = bq >= 0 ? -bq - std::sqrt(disc) : -bq + std::sqrt(disc);
    const double r1 = q / a, r2 = q != 0 ? c / q : r1;
    round = std::min(r1, r2);
    round_out = std::max(r1, r2);
  } else if (c > 0) {
    return false;
  }
  double enter = std::max(in, round);
  double leave = std::min(out, round_out);
  if (enter > leave || leave < 0) return false;
  const bool flat = shape_.crown_radius == 0;
  if (flat) {
    if (enter < 0) return false;
    hit.distance = enter;
    hit.p_B = o + enter * d;
    hit.side = in > round;
    if (hit.side) hit.n_B = Vec3(0.0, d.y() > 0 ? -1.0 : 1.0, 0.0);
    else hit.n_B = Vec3(hit.p_B.x(), 0.0, hit.p_B.z()) / std::hypot(hit.p_B.x(), hit.p_B.z());
    return true;
  }
  // Crowned: f(t) = rho(t) - R(y(t)) is convex in t (a distance less a concave profile), so that Newton's method from
  // the entry into the enclosing cylinder runs monotonically to the first root.
  const double C = shape_.crown_radius;
  const auto f = [&](double t, double& slope) {
    const Vec3 p = o + t * d;
    const double rho = std::hypot(p.x(), p.z());
    const double root = std::sqrt(std::max(C * C - p.y() * p.y(), 1e-300));
    slope = (p.x() * d.x() + p.z() * d.z()) / std::max(rho, 1e-300) + p.y() * d.y() / root;
    return rho - (r - C + root);
  };
  double t = enter, slope = 0.0;
  double value = f(t, slope);
  if (value <= 0) {  // enters through a side wall, inside the profile there
    if (enter < 0 || in < round) return false;
    hit.distance = t;
    hit.p_B = o + t * d;
    hit.side = true;
    hit.n_B = Vec3(0.0, d.y() > 0 ? -1.0 : 1.0, 0.0);
    return true;
  }
  for (int i = 0; i < 100; ++i) {
    if (slope >= 0) return false;
    const double next = t - value / slope;
    if (next > leave) return false;
    if (next <= t) break;  // converged to rounding
    t = next;
    value = f(t, slope);
    if (value <= 0) break;
  }
  if (t < 0) return false;
  hit.distance = t;
  hit.p_B = o + t * d;
  hit.side = false;
  const double rho = std::hypot(hit.p_B.x(), hit.p_B.z());
  // The profile's normal points from the crown's centre (rho = r - C, y = 0).
  const double nr = rho - (r - C), ny = hit.p_B.y(), len = std::hypot(nr, ny);
  hit.n_B = Vec3(hit.p_B.x() / rho * nr / len, ny / len, hit.p_B.z() / rho * nr / len);
  return true;
}

bool Wheel::ray(const Vec3& o, const Vec3& d, RayHit& hit) const {
  bool any = rim_ray(o, d, hit);
  for (const Lug& lug : lugs_) {
    RayHit h;
    if (!lug_shape_[0].ray(to_lug(lug, o), to_lug(lug, d), h)) continue;
    if (any && h.distance >= hit.distance) continue;
    any = true;
    hit.distance = h.distance;
    hit.p_B = from_lug(lug, h.p_B);
    hit.n_B = from_lug(lug, h.n_B);
    hit.side = h.side;
  }
  return any;
}

Closest Wheel::rim_closest(const Vec3& p) const {
  const double half = 0.5 * shape_.width, r = shape_.radius, C = shape_.crown_radius;
  const double rho = std::hypot(p.x(), p.z());
  // On the axle every direction is as near: -z is taken.
  const double ux = rho > 0 ? p.x() / rho : 0.0, uz = rho > 0 ? p.z() / rho : -1.0;
  const double edge = radius_at(half);
  const double side_y = p.y() >= 0 ? half : -half;
  // The half-plane (rho, y): a profile from (edge, -half) to (edge, half), closed by |y| = half.
  double q_rho, q_y, n_rho, n_y;
  const bool outside_width = std::abs(p.y()) > half;
  double profile_rho, profile_y, profile_nr, profile_ny;  // nearest point of the profile
  if (C == 0) {
    profile_rho = r;
    profile_y = std::clamp(p.y(), -half, half);
    profile_nr = 1.0;
    profile_ny = 0.0;
  } else {
    const double dr = rho - (r - C), len = std::hypot(dr, p.y());
    profile_nr = len > 0 ? dr / len : 1.0;
    profile_ny = len > 0 ? p.y() / len : 0.0;
    profile_rho = r - C + C * profile_nr;
    profile_y = C * profile_ny;
    if (profile_nr <= 0 || std::abs(profile_y) > half) {
      profile_rho = edge;
      profile_y = side_y;
    }
  }
  const bool inside = !outside_width && rho <= radius_at(p.y());
  const double profile_distance = std::hypot(rho - profile_rho, p.y() - profile_y);
  const double cap_rho = std::min(rho, edge);
  const double cap_distance = std::hypot(rho - cap_rho, p.y() - side_y);
  const bool on_cap = cap_distance < profile_distance;
  q_rho = on_cap ? cap_rho : profile_rho;
  q_y = on_cap ? side_y : profile_y;
  const double distance = std::min(cap_distance, profile_distance);
  Closest out;
  out.distance = inside ? -distance : distance;
  if (distance > 1e-12 * r) {
    const double sign = inside ? -1.0 : 1.0;
    n_rho = sign * (rho - q_rho) / distance;
    n_y = sign * (p.y() - q_y) / distance;
  } else if (on_cap) {
    n_rho = 0.0;
    n_y = side_y > 0 ? 1.0 : -1.0;
  } else {
    n_rho = profile_nr;
    n_y = profile_ny;
  }
  out.p_B = Vec3(ux * q_rho, q_y, uz * q_rho);
  out.n_B = Vec3(ux * n_rho, n_y, uz * n_rho);
  return out;
}

Closest Wheel::closest(const Vec3& p) const {
  Closest best = rim_closest(p);
  for (const Lug& lug : lugs_) {
    const Vec3 q = to_lug(lug, p);
    if (q.z() > 0) continue;  // the far side of the wheel
    const Closest c = lug_shape_[0].closest(q);
    if (c.distance < best.distance) {
      best.distance = c.distance;
      best.p_B = from_lug(lug, c.p_B);
      best.n_B = from_lug(lug, c.n_B);
    }
  }
  return best;
}

Vec3 Wheel::support(const Vec3& d) const {
  const double half = 0.5 * shape_.width, C = shape_.crown_radius;
  const double along = std::hypot(d.x(), d.z());
  const double ux = along > 0 ? d.x() / along : 0.0, uz = along > 0 ? d.z() / along : -1.0;
  double y = d.y() > 0 ? half : d.y() < 0 ? -half : 0.0;
  if (C > 0) y = std::clamp(along > 0 || d.y() != 0 ? C * d.y() / std::hypot(along, d.y()) : 0.0, -half, half);
  const double rho = radius_at(y);
  Vec3 best(ux * rho, y, uz * rho);
  for (const Lug& lug : lugs_) {
    const Vec3 p = from_lug(lug, lug_shape_[0].support(to_lug(lug, d)));
    if (p.dot(d) > best.dot(d)) best = p;
  }
  return best;
}

}  // namespace terrode::wheel
