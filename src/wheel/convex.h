// Convex pieces: polygons drawn along y (grousers, plates, boxes) in closed form, and any convex hull of points by
// libccd's support functions.
#pragma once

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

// The union of convex hulls of point clouds. Nearest points and rays come from libccd (Minkowski portal refinement on
// support functions: Snethen 2008), good to `accuracy`.
class ConvexPieces final : public Body {
 public:
  static constexpr double accuracy = 1e-9;  // [m]
  // Throws InputError for no pieces, fewer than four points in one, or points that are not finite or lie in a plane.
  explicit ConvexPieces(std::vector<std::vector<Vec3>> pieces);
  bool ray(const Vec3& o, const Vec3& d, RayHit& hit) const override;
  Closest closest(const Vec3& p) const override;
  Vec3 support(const Vec3& d) const override;
  double bounding_radius() const override { return bounding_radius_; }
  std::string name() const override { return "convex-pieces"; }

  struct Piece {
    std::vector<Vec3> points;
    Vec3 centre = Vec3::Zero();
    double radius = 0.0;  // about the centre
  };

 private:
  std::vector<Piece> pieces_;
  double bounding_radius_ = 0.0;
};

}  // namespace terrode::wheel
