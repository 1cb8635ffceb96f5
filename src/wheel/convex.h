// Convex pieces: polygons drawn along y (grousers, plates, boxes) in closed form, and any convex hull of points by
// libccd's support functions.
#pragma once

#include <optional>

#include "wheel/body.h"

namespace terrode::wheel {

// A convex polygon in the x-z plane (counter-clockwise seen from -y, that is x to the right and z up) drawn from
// y = -half_width to y = +half_width.
class Prism {
 public:
  // Throws InputError unless there are three corners or more, in convex counter-clockwise order, and half_width > 0.
  Prism(std::vector<Eigen::Vector2d> corners, double half_width);
  bool ray(const Vec3& origin, const Vec3& direction, RayHit& hit) const;
  Closest closest(const Vec3& p) const;
  Vec3 support(const Vec3& direction) const;
  double bounding_radius() const { return bounding_radius_; }
  const std::vector<Eigen::Vector2d>& corners() const { return corners_; }
  double half_width() const { return half_width_; }

 private:
  std::vector<Eigen::Vector2d> corners_;
  std::vector<Eigen::Vector2d> normals_;  // outward, of the edge from corner i to i + 1
  double half_width_;
  double bounding_radius_ = 0.0;
};

// A plate, box or leg: one prism as a body of its own.
class PrismBody final : public Body {
 public:
  explicit PrismBody(Prism prism) : prism_(std::move(prism)) {}
  bool ray(const Vec3& o, const Vec3& d, RayHit& hit) const override { return prism_.ray(o, d, hit); }
  Closest closest(const Vec3& p) const override { return prism_.closest(p); }
  Vec3 support(const Vec3& d) const override { return prism_.support(d); }
  double bounding_radius() const override { return prism_.bounding_radius(); }
  std::string name() const override { return "prism"; }

 private:
  Prism prism_;
};

// A box of these full lengths [m] about the origin (a plate of a pressure-sinkage test, a rock, a foot).
std::shared_ptr<const Body> make_box(double length_x, double length_y, double length_z);

class Sphere final : public Body {
 public:
  explicit Sphere(double radius);
  bool ray(const Vec3& o, const Vec3& d, RayHit& hit) const override;
  Closest closest(const Vec3& p) const override;
  Vec3 support(const Vec3& d) const override;
  double bounding_radius() const override { return radius_; }
  std::string name() const override { return "sphere"; }

 private:
  double radius_;
};

// The union of convex hulls of point clouds. Nearest points come from libccd (Minkowski portal refinement on support
// functions: Snethen 2008), good to `accuracy`; rays from the faces of hulls of up to 48 points, else from libccd.
class ConvexPieces final : public Body {
 public:
  static constexpr double accuracy = 1e-9;  // [m]
  // With `rim` they are a wheel about y (paddles, legs, a polygon); its `outer` radius is that of the pieces' points.
  // Throws InputError for no pieces, fewer than four points in one, or points that are not finite or lie in a plane.
  explicit ConvexPieces(std::vector<std::vector<Vec3>> pieces, std::optional<Rolling> rim = {});
  bool ray(const Vec3& o, const Vec3& d, RayHit& hit) const override;
  Closest closest(const Vec3& p) const override;
  Vec3 support(const Vec3& d) const override;
  double bounding_radius() const override { return bounding_radius_; }
  const Rolling* rolling() const override { return rim_ ? &*rim_ : nullptr; }
  std::string name() const override { return "convex-pieces"; }

  struct Piece {
    std::vector<Vec3> points;
    Vec3 centre = Vec3::Zero();
    double radius = 0.0;  // about the centre
    // Faces of the hull, n . x = d with n outward; none where it has so many points that they are not looked for.
    std::vector<std::pair<Vec3, double>> faces = {};
  };

 private:
  std::vector<Piece> pieces_;
  std::optional<Rolling> rim_;
  double bounding_radius_ = 0.0;
};

// The pieces `count` times around the axle (body y), evenly.
std::vector<std::vector<Vec3>> around_axle(const std::vector<std::vector<Vec3>>& pieces, int count);

}  // namespace terrode::wheel
