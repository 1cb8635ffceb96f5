#include "wheel/convex.h"

#include <ccd/ccd.h>
#include <ccd/quat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace terrode::wheel {

Prism::Prism(std::vector<Eigen::Vector2d> corners, double half_width)
    : corners_(std::move(corners)), half_width_(half_width) {
  if (corners_.size() < 3) throw InputError("a prism needs three corners or more");
  if (!(half_width > 0) || !std::isfinite(half_width)) throw InputError("a prism needs a width above 0");
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const Eigen::Vector2d a = corners_[i], b = corners_[(i + 1) % corners_.size()], c = corners_[(i + 2) % corners_.size()];
    if (!a.allFinite()) throw InputError("a corner of a prism is not finite");
    const Eigen::Vector2d e = b - a, f = c - b;
    if (!(e.x() * f.y() - e.y() * f.x() > 0)) throw InputError("the corners of a prism must turn counter-clockwise");
    normals_.push_back(Eigen::Vector2d(e.y(), -e.x()).normalized());
    bounding_radius_ = std::max(bounding_radius_, std::hypot(a.norm(), half_width));
  }
}

bool Prism::ray(const Vec3& o, const Vec3& d, RayHit& hit) const {
  double in = -std::numeric_limits<double>::infinity(), out = std::numeric_limits<double>::infinity();
  Vec3 n = Vec3::Zero();
  bool side = false;
  const auto cut = [&](double rate, double gap, const Vec3& normal, bool is_side) {
    // Inside where gap + rate t <= 0.
    if (rate == 0) return gap <= 0;
    const double t = -gap / rate;
    if (rate < 0) {
      if (t > in) {
        in = t;
        n = normal;
        side = is_side;
      }
    } else {
      out = std::min(out, t);
    }
    return in <= out;
  };
  if (!cut(d.y(), o.y() - half_width_, Vec3::UnitY(), true)) return false;
  if (!cut(-d.y(), -o.y() - half_width_, -Vec3::UnitY(), true)) return false;
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const Vec3 normal(normals_[i].x(), 0.0, normals_[i].y());
    const double gap = normals_[i].x() * (o.x() - corners_[i].x()) + normals_[i].y() * (o.z() - corners_[i].y());
    if (!cut(normal.x() * d.x() + normal.z() * d.z(), gap, normal, false)) return false;
  }
  if (in < 0 || in > out) return false;
  hit = {in, o + in * d, n, side};
  return true;
}

Closest Prism::closest(const Vec3& p) const {
  const Eigen::Vector2d q(p.x(), p.z());
  // In the plane: greatest gap over the edges is the distance inside; outside, the nearest edge segment.
  double greatest = -std::numeric_limits<double>::infinity();
  std::size_t edge = 0;
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const double gap = normals_[i].dot(q - corners_[i]);
    if (gap > greatest) {
      greatest = gap;
      edge = i;
    }
  }
  const double over = std::abs(p.y()) - half_width_;
  const double sign_y = p.y() >= 0 ? 1.0 : -1.0;
  Closest out;
  if (greatest <= 0 && over <= 0) {
    if (greatest >= over) {
      out.distance = greatest;
      out.n_B = Vec3(normals_[edge].x(), 0.0, normals_[edge].y());
    } else {
      out.distance = over;
      out.n_B = Vec3(0.0, sign_y, 0.0);
    }
    out.p_B = p - out.distance * out.n_B;
    return out;
  }
  Eigen::Vector2d nearest = q;
  if (greatest > 0) {
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const Eigen::Vector2d a = corners_[i], e = corners_[(i + 1) % corners_.size()] - a;
      const Eigen::Vector2d c = a + e * std::clamp((q - a).dot(e) / e.squaredNorm(), 0.0, 1.0);
      const double distance = (q - c).squaredNorm();
      if (distance < best) {
        best = distance;
        nearest = c;
      }
    }
  }
  out.p_B = Vec3(nearest.x(), std::clamp(p.y(), -half_width_, half_width_), nearest.y());
  const Vec3 gap = p - out.p_B;
  out.distance = gap.norm();
  if (out.distance > 0) out.n_B = gap / out.distance;
  else out.n_B = Vec3(normals_[edge].x(), 0.0, normals_[edge].y());
  return out;
}

Vec3 Prism::support(const Vec3& d) const {
  std::size_t best = 0;
  const auto along = [&](std::size_t i) { return corners_[i].x() * d.x() + corners_[i].y() * d.z(); };
  for (std::size_t i = 1; i < corners_.size(); ++i)
    if (along(i) > along(best)) best = i;
  return {corners_[best].x(), d.y() >= 0 ? half_width_ : -half_width_, corners_[best].y()};
}

std::shared_ptr<const Body> make_box(double x, double y, double z) {
  if (!(x > 0 && y > 0 && z > 0)) throw InputError("a box needs three lengths above 0");
  return std::make_shared<PrismBody>(
      Prism({{-0.5 * x, -0.5 * z}, {0.5 * x, -0.5 * z}, {0.5 * x, 0.5 * z}, {-0.5 * x, 0.5 * z}}, 0.5 * y));
}

Sphere::Sphere(double radius) : radius_(radius) {
  if (!(radius > 0) || !std::isfinite(radius)) throw InputError("a sphere needs a radius above 0");
}

bool Sphere::ray(const Vec3& o, const Vec3& d, RayHit& hit) const {
  const double b = o.dot(d), c = o.squaredNorm() - radius_ * radius_, disc = b * b - c;
  if (disc < 0 || c < 0) return false;
  const double far = -b + std::sqrt(disc);
  if (far <= 0) return false;
  const double t = c / far;
  hit = {t, o + t * d, (o + t * d) / radius_, false};
  return true;
}

Closest Sphere::closest(const Vec3& p) const {
  const double len = p.norm();
  const Vec3 n = len > 0 ? Vec3(p / len) : Vec3(-Vec3::UnitZ());
  return {len - radius_, n * radius_, n};
}

Vec3 Sphere::support(const Vec3& d) const {
  const double len = d.norm();
  return len > 0 ? Vec3(d * (radius_ / len)) : Vec3(0.0, 0.0, -radius_);
}

namespace {

struct Ball {
  Vec3 centre;
  double radius;
};
struct Rod {
  Vec3 from, to;
};

Vec3 vec(const ccd_vec3_t* v) { return {v->v[0], v->v[1], v->v[2]}; }
void store(ccd_vec3_t* out, const Vec3& p) { ccdVec3Set(out, p.x(), p.y(), p.z()); }

Vec3 hull_support(const std::vector<Vec3>& points, const Vec3& d) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < points.size(); ++i)
    if (points[i].dot(d) > points[best].dot(d)) best = i;
  return points[best];
}

void piece_support(const void* obj, const ccd_vec3_t* dir, ccd_vec3_t* out) {
  store(out, hull_support(static_cast<const ConvexPieces::Piece*>(obj)->points, vec(dir)));
}
void piece_centre(const void* obj, ccd_vec3_t* out) { store(out, static_cast<const ConvexPieces::Piece*>(obj)->centre); }
void ball_support(const void* obj, const ccd_vec3_t* dir, ccd_vec3_t* out) {
  const auto* b = static_cast<const Ball*>(obj);
  const Vec3 d = vec(dir);
  const double len = d.norm();
  store(out, len > 0 ? Vec3(b->centre + d * (b->radius / len)) : b->centre);
}
void ball_centre(const void* obj, ccd_vec3_t* out) { store(out, static_cast<const Ball*>(obj)->centre); }
void rod_support(const void* obj, const ccd_vec3_t* dir, ccd_vec3_t* out) {
  const auto* r = static_cast<const Rod*>(obj);
  store(out, (r->to - r->from).dot(vec(dir)) > 0 ? r->to : r->from);
}
void rod_centre(const void* obj, ccd_vec3_t* out) {
  const auto* r = static_cast<const Rod*>(obj);
  store(out, 0.5 * (r->from + r->to));
}

ccd_t settings() {
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = piece_support;
  ccd.center1 = piece_centre;
  ccd.max_iterations = 200;
  ccd.mpr_tolerance = 0.1 * ConvexPieces::accuracy;
  return ccd;
}

// Every plane through three points that has all others on one side.
std::vector<std::pair<Vec3, double>> faces_of(const ConvexPieces::Piece& piece) {
  constexpr std::size_t most_points = 48;
  const std::vector<Vec3>& p = piece.points;
  std::vector<std::pair<Vec3, double>> out;
  if (p.size() > most_points) return out;
  const double close = 1e-10 * piece.radius;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t j = i + 1; j < p.size(); ++j)
      for (std::size_t k = j + 1; k < p.size(); ++k) {
        Vec3 n = (p[j] - p[i]).cross(p[k] - p[i]);
        if (!(n.norm() > 1e-12 * piece.radius * piece.radius)) continue;
        n.normalize();
        if (n.dot(p[i] - piece.centre) < 0) n = -n;
        const double d = n.dot(p[i]);
        const bool face = std::all_of(p.begin(), p.end(), [&](const Vec3& q) { return n.dot(q) <= d + close; });
        const bool known = std::any_of(out.begin(), out.end(), [&](const auto& f) { return f.first.dot(n) > 1.0 - 1e-12; });
        if (face && !known) out.emplace_back(n, d);
      }
  return out;
}

}  // namespace

ConvexPieces::ConvexPieces(std::vector<std::vector<Vec3>> pieces, std::optional<Rolling> rim) : rim_(rim) {
  if (rim_) rim_->outer = 0.0;
  if (pieces.empty()) throw InputError("a body of convex pieces needs at least one");
  for (auto& points : pieces) {
    Piece piece;
    if (points.size() < 4) throw InputError("a convex piece needs four points or more");
    for (const Vec3& p : points) {
      if (!p.allFinite()) throw InputError("a point of a convex piece is not finite");
      piece.centre += p / static_cast<double>(points.size());
      bounding_radius_ = std::max(bounding_radius_, p.norm());
      if (rim_) rim_->outer = std::max(rim_->outer, std::hypot(p.x(), p.z()));
    }
    Mat3 spread = Mat3::Zero();
    for (const Vec3& p : points) {
      piece.radius = std::max(piece.radius, (p - piece.centre).norm());
      spread += (p - piece.centre) * (p - piece.centre).transpose();
    }
    constexpr double flat = 1e-12;  // of the greatest spread cubed: points in a plane leave only rounding
    if (!(spread.determinant() > flat * std::pow(spread.trace(), 3))) throw InputError("the points of a convex piece lie in a plane");
    piece.points = std::move(points);
    piece.faces = faces_of(piece);
    pieces_.push_back(std::move(piece));
  }
}

std::vector<std::vector<Vec3>> around_axle(const std::vector<std::vector<Vec3>>& pieces, int count) {
  std::vector<std::vector<Vec3>> out;
  for (int i = 0; i < count; ++i) {
    const Eigen::AngleAxisd turn(2.0 * std::numbers::pi * i / count, Vec3::UnitY());
    for (const auto& points : pieces) {
      out.emplace_back();
      for (const Vec3& p : points) out.back().push_back(turn * p);
    }
  }
  return out;
}

Vec3 ConvexPieces::support(const Vec3& d) const {
  Vec3 best = hull_support(pieces_[0].points, d);
  for (const Piece& piece : pieces_) {
    const Vec3 p = hull_support(piece.points, d);
    if (p.dot(d) > best.dot(d)) best = p;
  }
  return best;
}

namespace {

// Normal of the piece at the point nearest to a point `gap` outside it: a ball that reaches in by little is pushed out
// along it.
Vec3 normal_near(const ConvexPieces::Piece& piece, const Vec3& p, double gap, const Vec3& otherwise) {
  ccd_t ccd = settings();
  ccd.support2 = ball_support;
  ccd.center2 = ball_centre;
  const Ball ball{p, gap + 1e-4 * piece.radius};
  ccd_real_t depth = 0;
  ccd_vec3_t dir, pos;
  if (ccdMPRPenetration(&piece, &ball, &ccd, &depth, &dir, &pos) != 0 || !(depth > 0)) return otherwise;
  return vec(&dir).normalized();
}

}  // namespace

Closest ConvexPieces::closest(const Vec3& p) const {
  Closest best;
  best.distance = std::numeric_limits<double>::infinity();
  ccd_t ccd = settings();
  ccd.support2 = ball_support;
  ccd.center2 = ball_centre;
  for (const Piece& piece : pieces_) {
    const double reach = (p - piece.centre).norm();
    if (reach - piece.radius > best.distance) continue;
    Ball ball{p, 0.0};
    double distance;
    Vec3 n;
    if (ccdMPRIntersect(&piece, &ball, &ccd)) {
      // Inside: the expanding polytope of the hull against the point ends on the nearest face.
      ccd.epa_tolerance = 0.1 * accuracy;
      ccd_real_t depth = 0;
      ccd_vec3_t dir, pos;
      if (ccdGJKPenetration(&piece, &ball, &ccd, &depth, &dir, &pos) != 0 || !(depth > 0)) {
        distance = 0.0;
        n = normal_near(piece, p, 0.0, (p - piece.centre).normalized());
      } else {
        distance = -depth;
        n = vec(&dir).normalized();
      }
    } else {
      double lo = 0.0, hi = reach;
      while (hi - lo > 0.25 * accuracy) {
        ball.radius = 0.5 * (lo + hi);
        (ccdMPRIntersect(&piece, &ball, &ccd) ? hi : lo) = ball.radius;
      }
      distance = hi;
      n = normal_near(piece, p, distance, (p - piece.centre).normalized());
    }
    if (distance < best.distance) {
      best.distance = distance;
      best.n_B = n;
      best.p_B = p - distance * n;
    }
  }
  return best;
}

bool ConvexPieces::ray(const Vec3& o, const Vec3& d, RayHit& hit) const {
  bool any = false;
  ccd_t ccd = settings();
  ccd.support2 = rod_support;
  ccd.center2 = rod_centre;
  for (const Piece& piece : pieces_) {
    const double along = (piece.centre - o).dot(d), off = (o + along * d - piece.centre).norm();
    if (off > piece.radius) continue;
    double lo = along - piece.radius * 1.001, hi = along + piece.radius * 1.001;
    if (hi < 0 || (any && lo >= hit.distance)) continue;
    if (!piece.faces.empty()) {
      // Between where the line comes in through the last face and where it goes out through the first.
      double in = -std::numeric_limits<double>::infinity(), out = -in;
      const Vec3* through = nullptr;
      for (const auto& [n, at] : piece.faces) {
        const double speed = n.dot(d), gap = at - n.dot(o);
        if (speed == 0.0) {
          if (gap < 0) out = -std::numeric_limits<double>::infinity();
        } else if (speed < 0) {
          if (gap / speed > in) {
            in = gap / speed;
            through = &n;
          }
        } else {
          out = std::min(out, gap / speed);
        }
      }
      if (!through || in > out || in < 0 || (any && in >= hit.distance)) continue;
      any = true;
      hit = {in, o + in * d, *through, false};
      continue;
    }
    Rod rod{o + lo * d, o + hi * d};
    if (!ccdMPRIntersect(&piece, &rod, &ccd)) continue;
    const double start = lo;
    // The rod [start, t] touches the piece from the first hit on: halve the bracket down to the accuracy.
    double touch = hi;
    while (touch - lo > 0.25 * accuracy) {
      const double mid = 0.5 * (lo + touch);
      rod = {o + (start - 1e-3 * piece.radius) * d, o + mid * d};
      (ccdMPRIntersect(&piece, &rod, &ccd) ? touch : lo) = mid;
    }
    if (touch < 0 || (any && touch >= hit.distance)) continue;
    any = true;
    hit.distance = touch;
    hit.p_B = o + touch * d;
    hit.side = false;
    const double outside = 1e-4 * piece.radius;
    hit.n_B = normal_near(piece, o + (touch - outside) * d, outside, -d);
  }
  return any;
}

}  // namespace terrode::wheel
