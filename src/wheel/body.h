// Immutable shapes that touch the ground. Body axes: origin at the body's reference point (a wheel's centre), y along a
// wheel's axle, lengths in metres. All answers are in double precision from closed forms (crowned rims: Newton's method
// to rounding), never from a mesh.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/frames.h"
#include "core/problem.h"

namespace terrode::wheel {

// Where a line first meets a surface: its parameter [m along the unit direction], the point, the outward unit normal.
struct RayHit {
  double distance = 0.0;
  Vec3 p_B = Vec3::Zero();
  Vec3 n_B = Vec3::UnitZ();
  bool side = false;  // true on a wheel's side wall (flat cap)
};

// The nearest point of a surface: distance [m], negative inside; the point; the outward unit normal there.
struct Closest {
  double distance = 0.0;
  Vec3 p_B = Vec3::Zero();
  Vec3 n_B = Vec3::UnitZ();
};

// A rim that rolls about body y: the radius that slip and sinkage refer to, the width, and the radius that nothing of the
// body lies beyond, lugs and paddles included [m].
struct Rolling {
  double radius = 0.0;
  double width = 0.0;
  double outer = 0.0;
};

class Body {
 public:
  virtual ~Body() = default;

  // First point of the surface along origin + distance * direction, distance >= 0, entering from outside; false where
  // the line misses. `direction_B` has length 1 and `origin_B` lies outside.
  virtual bool ray(const Vec3& origin_B, const Vec3& direction_B, RayHit& hit) const = 0;

  virtual Closest closest(const Vec3& p_B) const = 0;

  // The body's point furthest along a direction (any length above 0); for shapes of several pieces, of all.
  virtual Vec3 support(const Vec3& direction_B) const = 0;

  // Radius [m] about the origin of a sphere that holds the body.
  virtual double bounding_radius() const = 0;

  // The rim, for bodies that roll; nothing for others.
  virtual const Rolling* rolling() const { return nullptr; }

  // Radius [m] about body y of a circle that nothing of the body lies beyond.
  double outer_radius() const {
    const Rolling* rim = rolling();
    return rim ? rim->outer : bounding_radius();
  }

  // True where nothing but a smooth circular cylinder touches (no crown, no grousers): its lower surface and contact
  // angle are then known without rays.
  virtual bool plain_cylinder() const { return false; }

  virtual std::string name() const = 0;
};

}  // namespace terrode::wheel
