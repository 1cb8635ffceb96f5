// Rigid surfaces that particles touch: analytic shapes, triangle meshes, convex bodies. A surface is fixed to a body
// (dem/simulation.h) and described in that body's axes.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/frames.h"

namespace terrode::wheel {
class Body;
}

namespace terrode::dem {

// Where a surface is near a point.
struct SurfacePoint {
  double distance = 0.0;        // m, from the point to the surface; negative behind it
  Vec3 normal = Vec3::UnitZ();  // from the surface to the point's side, unit
  int facet = 0;                // which face: a contact keeps its history as long as it stays on one
};

// At most this many contacts of one particle with one surface.
inline constexpr int max_surface_points = 6;

class Surface {
 public:
  virtual ~Surface() = default;
  // Writes the surface's points nearest to `p` that are closer than `reach` (one a face), returns their number.
  virtual int near(const Vec3& p, double reach, SurfacePoint* out) const = 0;
  // Largest distance of the surface from the body's origin [m]; infinite for a plane.
  virtual double extent() const = 0;
};

using SurfacePtr = std::shared_ptr<const Surface>;

// The half-space n . x < offset is solid. `normal` need not be of unit length.
SurfacePtr make_plane(const Vec3& normal, double offset);
// A rectangle of no thickness, both sides solid: centre, two half-edges at right angles. Edges and corners count.
SurfacePtr make_plate(const Vec3& centre, const Vec3& half_edge_u, const Vec3& half_edge_v);
// A solid block, centred at the origin.
SurfacePtr make_block(const Vec3& half_size);
// The inside of a box, centred at the origin: six faces.
SurfacePtr make_box_inside(const Vec3& half_size);
// The inside of a cylinder about `axis` (0 x, 1 y, 2 z), without end faces.
SurfacePtr make_cylinder_inside(int axis, double radius);
// A solid cylinder about `axis` with flat ends, centred at the origin.
SurfacePtr make_cylinder(int axis, double radius, double half_length);
// A triangle mesh, both sides solid; vertices in the body's axes, three indices a triangle.
SurfacePtr make_mesh(std::vector<Vec3> vertices, std::vector<std::array<int, 3>> triangles);
// The mesh in an STL file, ASCII or binary, in metres times `scale`. Throws InputError when it cannot be read.
SurfacePtr load_stl(const std::string& path, double scale);
// Any shape of the wheel room as a solid: wheels with crown and grousers in closed form, convex pieces by libccd. One
// contact a particle, at the nearest point.
SurfacePtr make_shape(std::shared_ptr<const wheel::Body> body);

// The point of triangle abc nearest to p.
Vec3 closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace terrode::dem
