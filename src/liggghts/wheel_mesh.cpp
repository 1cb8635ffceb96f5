#include "liggghts/wheel_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "core/problem.h"
#include "wheel/wheel.h"

namespace terrode::liggghts {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

void add_rim(const wheel::Wheel& wheel, double tolerance, TriangleMesh& mesh) {
  const wheel::WheelShape& s = wheel.shape();
  // A chord over an angle 2 a dips r a^2/2 below its circle.
  const int n = std::clamp(static_cast<int>(std::ceil(std::numbers::pi * std::sqrt(s.radius / (2.0 * tolerance)))), 24, 720);
  int across = 1;
  if (s.crown_radius > 0.0) {
    const double half = std::asin(std::min(1.0, 0.5 * s.width / s.crown_radius));
    across = std::clamp(static_cast<int>(std::ceil(half * std::sqrt(s.crown_radius / (2.0 * tolerance)))), 1, 100);
  }
  const double a = std::numbers::pi / n;
  const double out = 1.0 + a * a / 3.0;  // the polygon's mean radius is then the circle's
  const auto first = static_cast<int>(mesh.vertices.size());
  for (int k = 0; k <= across; ++k) {
    const double y = s.width * (static_cast<double>(k) / across - 0.5), r = out * wheel.radius_at(y);
    for (int i = 0; i < n; ++i) mesh.vertices.emplace_back(r * std::sin(two_pi * i / n), y, r * std::cos(two_pi * i / n));
  }
  const auto at = [&](int k, int i) { return first + k * n + i % n; };
  const auto left = static_cast<int>(mesh.vertices.size()), right = left + 1;
  mesh.vertices.emplace_back(0.0, 0.5 * s.width, 0.0);
  mesh.vertices.emplace_back(0.0, -0.5 * s.width, 0.0);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < across; ++k) {
      mesh.triangles.push_back({at(k, i), at(k + 1, i + 1), at(k + 1, i)});
      mesh.triangles.push_back({at(k, i), at(k, i + 1), at(k + 1, i + 1)});
    }
    mesh.triangles.push_back({left, at(across, i), at(across, i + 1)});
    mesh.triangles.push_back({right, at(0, i + 1), at(0, i)});
  }
}

void add_lugs(const wheel::Wheel& wheel, double tolerance, TriangleMesh& mesh) {
  const wheel::WheelShape& s = wheel.shape();
  const wheel::Grousers& g = s.grousers;
  if (g.count == 0) return;
  const double half = 0.5 * s.width, a = 0.5 * g.thickness, top = s.radius + g.height;
  const double tip = g.shape == wheel::GrouserShape::straight  ? a
                     : g.shape == wheel::GrouserShape::tapered ? 0.5 * g.tip_thickness
                                                               : 0.0;
  // Just inside the rim where that is lowest; side lines pass through +-a at the rim's radius and +-tip at the tip.
  const double low = wheel.radius_at(half), root = std::sqrt(std::max(0.0, low * low - a * a)) - 2.0 * tolerance;
  const double at_root = a + (a - tip) * (s.radius - root) / g.height;
  std::vector<Eigen::Vector2d> corners;  // x, z, of a lug that points down
  if (tip > 0.0)
    corners = {{-tip, -top}, {tip, -top}, {at_root, -root}, {-at_root, -root}};
  else
    corners = {{0.0, -top}, {at_root, -root}, {-at_root, -root}};
  const auto m = static_cast<int>(corners.size());
  for (int lug = 0; lug < g.count; ++lug) {
    const double angle = g.phase + two_pi * lug / g.count, c = std::cos(angle), sn = std::sin(angle);
    const auto first = static_cast<int>(mesh.vertices.size());
    for (const double y : {-half, half})
      for (const Eigen::Vector2d& q : corners) mesh.vertices.emplace_back(c * q.x() + sn * q.y(), y, -sn * q.x() + c * q.y());
    for (int i = 0; i < m; ++i) {
      const int j = (i + 1) % m;
      mesh.triangles.push_back({first + i, first + m + j, first + j});
      mesh.triangles.push_back({first + i, first + m + i, first + m + j});
    }
    for (int i = 1; i + 1 < m; ++i) {
      mesh.triangles.push_back({first, first + i, first + i + 1});
      mesh.triangles.push_back({first + m, first + m + i + 1, first + m + i});
    }
  }
}

}  // namespace

TriangleMesh mesh_of(const wheel::Body& body, double tolerance) {
  if (!(tolerance > 0.0)) throw InputError("a mesh needs a tolerance above 0");
  const auto* wheel = dynamic_cast<const wheel::Wheel*>(&body);
  if (!wheel) throw InputError({{}, 0, 0, "wheel", "is of shape '" + body.name() + "'", "a wheel with a rim (lugs and crown as may be)"});
  TriangleMesh mesh;
  add_rim(*wheel, tolerance, mesh);
  add_lugs(*wheel, tolerance, mesh);
  return mesh;
}

std::string stl(const TriangleMesh& mesh, const Pose& pose) {
  std::string out = "solid wheel\n";
  for (const auto& triangle : mesh.triangles) {
    Vec3 p[3];
    for (std::size_t k = 0; k < 3; ++k) p[k] = pose.p_W + pose.R_WB * mesh.vertices[static_cast<std::size_t>(triangle[k])];
    const Vec3 n = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    fmt::format_to(std::back_inserter(out), "facet normal {:.9g} {:.9g} {:.9g}\nouter loop\n", n.x(), n.y(), n.z());
    for (const Vec3& v : p) fmt::format_to(std::back_inserter(out), "vertex {:.17g} {:.17g} {:.17g}\n", v.x(), v.y(), v.z());
    out += "endloop\nendfacet\n";
  }
  return out + "endsolid wheel\n";
}

}  // namespace terrode::liggghts
