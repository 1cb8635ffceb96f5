#include "dem/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <sstream>

#include <Eigen/Geometry>

#include "core/problem.h"
#include "wheel/body.h"

namespace terrode::dem {

namespace {

// A point and the normal to it from the surface point q; falls back to `if_on_it` when p lies on the surface.
SurfacePoint from_point(const Vec3& p, const Vec3& q, const Vec3& if_on_it, int facet) {
  const Vec3 d = p - q;
  const double length = d.norm();
  if (length > 0.0) return {length, d / length, facet};
  return {0.0, if_on_it, facet};
}

class Plane : public Surface {
 public:
  Plane(const Vec3& normal, double offset) : normal_(normal.normalized()), offset_(offset / normal.norm()) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    const double d = normal_.dot(p) - offset_;
    if (d >= reach) return 0;
    out[0] = {d, normal_, 0};
    return 1;
  }
  double extent() const override { return std::numeric_limits<double>::infinity(); }

 private:
  Vec3 normal_;
  double offset_;
};

class Plate : public Surface {
 public:
  Plate(const Vec3& centre, const Vec3& u, const Vec3& v)
      : centre_(centre), u_(u.normalized()), v_(v.normalized()), n_(u_.cross(v_)), lu_(u.norm()), lv_(v.norm()) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    const Vec3 d = p - centre_;
    const double a = std::clamp(d.dot(u_), -lu_, lu_), b = std::clamp(d.dot(v_), -lv_, lv_);
    const Vec3 q = centre_ + a * u_ + b * v_;
    if ((p - q).squaredNorm() >= reach * reach) return 0;
    out[0] = from_point(p, q, n_, 0);
    return 1;
  }
  double extent() const override { return centre_.norm() + std::hypot(lu_, lv_); }

 private:
  Vec3 centre_, u_, v_, n_;
  double lu_, lv_;
};

class Block : public Surface {
 public:
  explicit Block(const Vec3& half) : half_(half) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    const Vec3 q = p.cwiseMax(-half_).cwiseMin(half_);
    if ((p - q).squaredNorm() >= reach * reach) return 0;
    if (q != p) {
      out[0] = from_point(p, q, Vec3::UnitZ(), 0);
      return 1;
    }
    int axis = 0;
    double depth = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k)
      if (half_[k] - std::abs(p[k]) < depth) {
        depth = half_[k] - std::abs(p[k]);
        axis = k;
      }
    Vec3 n = Vec3::Zero();
    n[axis] = p[axis] < 0.0 ? -1.0 : 1.0;
    out[0] = {-depth, n, 0};
    return 1;
  }
  double extent() const override { return half_.norm(); }

 private:
  Vec3 half_;
};

class BoxInside : public Surface {
 public:
  explicit BoxInside(const Vec3& half) : half_(half) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    int n = 0;
    for (int k = 0; k < 3; ++k)
      for (const double side : {-1.0, 1.0}) {
        const double d = half_[k] - side * p[k];
        if (d >= reach) continue;
        Vec3 normal = Vec3::Zero();
        normal[k] = -side;
        out[n++] = {d, normal, 2 * k + (side > 0.0)};
      }
    return n;
  }
  double extent() const override { return half_.norm(); }

 private:
  Vec3 half_;
};

class CylinderInside : public Surface {
 public:
  CylinderInside(int axis, double radius) : axis_(axis), radius_(radius) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    Vec3 d = p;
    d[axis_] = 0.0;
    const double r = d.norm();
    if (radius_ - r >= reach) return 0;
    if (r == 0.0) return 0;
    out[0] = {radius_ - r, -d / r, 0};
    return 1;
  }
  // Turning about its own axis moves nothing, which is what drums do.
  double extent() const override { return radius_; }

 private:
  int axis_;
  double radius_;
};

class Cylinder : public Surface {
 public:
  Cylinder(int axis, double radius, double half_length) : axis_(axis), radius_(radius), half_(half_length) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    Vec3 radial = p;
    radial[axis_] = 0.0;
    const double r = radial.norm(), along = p[axis_];
    const double over_rim = r - radius_, over_end = std::abs(along) - half_;
    if (std::max(over_rim, over_end) >= reach) return 0;
    Vec3 end = Vec3::Zero();
    end[axis_] = along < 0.0 ? -1.0 : 1.0;
    const Vec3 out_radial = r > 0.0 ? Vec3(radial / r) : Vec3(Vec3::Unit((axis_ + 1) % 3));
    if (over_rim <= 0.0 && over_end <= 0.0) {
      out[0] = over_rim > over_end ? SurfacePoint{over_rim, out_radial, 0} : SurfacePoint{over_end, end, 0};
      return 1;
    }
    Vec3 q = out_radial * std::min(r, radius_);
    q[axis_] = std::clamp(along, -half_, half_);
    if ((p - q).squaredNorm() >= reach * reach) return 0;
    out[0] = from_point(p, q, out_radial, 0);
    return 1;
  }
  double extent() const override { return std::hypot(radius_, half_); }

 private:
  int axis_;
  double radius_, half_;
};

class Mesh : public Surface {
 public:
  Mesh(std::vector<Vec3> vertices, std::vector<std::array<int, 3>> triangles)
      : vertices_(std::move(vertices)), triangles_(std::move(triangles)) {
    Problems problems;
    if (triangles_.empty()) problems.push_back({{}, 0, 0, "triangles", "there are none", "at least one"});
    for (const auto& t : triangles_)
      for (const int v : t)
        if (v < 0 || v >= static_cast<int>(vertices_.size())) {
          problems.push_back({{}, 0, 0, "triangles", "names vertex " + std::to_string(v), "an index of the vertices"});
          break;
        }
    throw_if_any(problems);
    order_.resize(triangles_.size());
    std::iota(order_.begin(), order_.end(), 0);
    tree_.reserve(2 * triangles_.size());
    split(0, static_cast<int>(triangles_.size()));
    for (const Vec3& v : vertices_) extent_ = std::max(extent_, v.norm());
  }
  // The contacts are the local minima of the distance over the whole mesh: a triangle's nearest point counts unless it
  // also lies on a triangle that has a nearer one. A flat mesh then acts like a plane however it is divided, and a
  // concave edge gives two contacts.
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    struct Candidate {
      double distance2;
      int triangle;
      Vec3 q;
    };
    const auto nearer = [](const Candidate& a, const Candidate& b) {
      return a.distance2 != b.distance2 ? a.distance2 < b.distance2 : a.triangle < b.triangle;
    };
    // The nearest ones, as a heap with the farthest of them on top once it is full.
    constexpr int most = 64;
    Candidate found[most];
    int n_found = 0;
    double within = reach * reach;
    int open[kDeepest], n_open = 0;
    open[n_open++] = 0;
    while (n_open > 0) {
      const Node& node = tree_[static_cast<std::size_t>(open[--n_open])];
      if (node.box.squaredExteriorDistance(p) >= within) continue;
      if (node.right > 0) {
        open[n_open++] = node.right;
        open[n_open++] = static_cast<int>(&node - tree_.data()) + 1;
        continue;
      }
      for (int i = node.first; i < node.end; ++i) {
        const int k = order_[static_cast<std::size_t>(i)];
        const Vec3 q = closest(p, static_cast<std::size_t>(k));
        const double d2 = (p - q).squaredNorm();
        if (d2 >= within) continue;
        if (n_found == most) std::pop_heap(found, found + n_found--, nearer);
        found[n_found++] = {d2, k, q};
        std::push_heap(found, found + n_found, nearer);
        if (n_found == most) within = std::nextafter(found[0].distance2, reach * reach);
      }
    }
    std::sort(found, found + n_found, nearer);
    int n = 0;
    for (int k = 0; k < n_found && n < max_surface_points; ++k) {
      bool covered = false;
      for (int m = 0; m < k && !covered; ++m)
        covered = (closest(found[k].q, static_cast<std::size_t>(found[m].triangle)) - found[k].q).squaredNorm() <
                  1e-18 * extent_ * extent_;
      if (covered) continue;
      const auto& t = triangles_[static_cast<std::size_t>(found[k].triangle)];
      const Vec3& a = vertices_[std::size_t(t[0])];
      const Vec3 normal = (vertices_[std::size_t(t[1])] - a).cross(vertices_[std::size_t(t[2])] - a).normalized();
      out[n++] = from_point(p, found[k].q, normal, found[k].triangle);
    }
    return n;
  }
  double extent() const override { return extent_; }

 private:
  std::vector<Vec3> vertices_;
  std::vector<std::array<int, 3>> triangles_;
  Vec3 closest(const Vec3& p, std::size_t k) const {
    const auto& t = triangles_[k];
    return closest_on_triangle(p, vertices_[std::size_t(t[0])], vertices_[std::size_t(t[1])],
                               vertices_[std::size_t(t[2])]);
  }
  // A tree of boxes over the triangles, each node before its left child.
  struct Node {
    Eigen::AlignedBox3d box;
    int right = 0;           // index of the right child; 0: a leaf, of order_[first, end)
    int first = 0, end = 0;
  };
  static constexpr int kLeaf = 4, kDeepest = 64;  // halves: more triangles than memory holds would be needed
  void split(int first, int end) {
    const std::size_t here = tree_.size();
    tree_.emplace_back();
    Eigen::AlignedBox3d box, centres;
    for (int i = first; i < end; ++i) {
      for (const int v : triangles_[static_cast<std::size_t>(order_[static_cast<std::size_t>(i)])]) box.extend(vertices_[static_cast<std::size_t>(v)]);
      centres.extend(centre(order_[static_cast<std::size_t>(i)]));
    }
    tree_[here].box = box;
    tree_[here].first = first;
    tree_[here].end = end;
    if (end - first <= kLeaf) return;
    int axis = 0;
    centres.sizes().maxCoeff(&axis);
    const int middle = first + (end - first) / 2;
    std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + end, [&](int a, int b) {
      const double ca = centre(a)[axis], cb = centre(b)[axis];
      return ca != cb ? ca < cb : a < b;
    });
    split(first, middle);
    tree_[here].right = static_cast<int>(tree_.size());
    split(middle, end);
  }
  Vec3 centre(int k) const {
    const auto& t = triangles_[static_cast<std::size_t>(k)];
    return (vertices_[std::size_t(t[0])] + vertices_[std::size_t(t[1])] + vertices_[std::size_t(t[2])]) / 3.0;
  }
  std::vector<int> order_;
  std::vector<Node> tree_;
  double extent_ = 0.0;
};

class Shape : public Surface {
 public:
  explicit Shape(std::shared_ptr<const wheel::Body> body) : body_(std::move(body)), extent_(body_->bounding_radius()) {}
  int near(const Vec3& p, double reach, SurfacePoint* out) const override {
    const double bound = extent_ + reach;
    if (p.squaredNorm() >= bound * bound) return 0;
    const wheel::Closest c = body_->closest(p);
    if (c.distance >= reach) return 0;
    out[0] = {c.distance, c.n_B, 0};
    return 1;
  }
  double extent() const override { return extent_; }

 private:
  std::shared_ptr<const wheel::Body> body_;
  double extent_;
};

void require_length(Problems& problems, const char* key, double value) {
  require(problems, key, value, "m", value > 0.0, "above 0");
}

}  // namespace

SurfacePtr make_plane(const Vec3& normal, double offset) {
  if (!(normal.norm() > 0.0) || !std::isfinite(offset)) throw InputError("a plane needs a normal and an offset");
  return std::make_shared<Plane>(normal, offset);
}
SurfacePtr make_plate(const Vec3& centre, const Vec3& u, const Vec3& v) {
  Problems problems;
  require_length(problems, "half_edge_u", u.norm());
  require_length(problems, "half_edge_v", v.norm());
  if (problems.empty() && std::abs(u.normalized().dot(v.normalized())) > 1e-9)
    problems.push_back({{}, 0, 0, "half_edge_v", "is not at right angles to half_edge_u", "a right angle"});
  throw_if_any(problems);
  return std::make_shared<Plate>(centre, u, v);
}
static void require_half_size(const Vec3& half) {
  Problems problems;
  for (int k = 0; k < 3; ++k) require_length(problems, "half_size", half[k]);
  throw_if_any(problems);
}
SurfacePtr make_block(const Vec3& half_size) {
  require_half_size(half_size);
  return std::make_shared<Block>(half_size);
}
SurfacePtr make_box_inside(const Vec3& half_size) {
  require_half_size(half_size);
  return std::make_shared<BoxInside>(half_size);
}
SurfacePtr make_cylinder_inside(int axis, double radius) {
  Problems problems;
  require_length(problems, "radius", radius);
  throw_if_any(problems);
  return std::make_shared<CylinderInside>(axis, radius);
}
SurfacePtr make_cylinder(int axis, double radius, double half_length) {
  Problems problems;
  require_length(problems, "radius", radius);
  require_length(problems, "half_length", half_length);
  throw_if_any(problems);
  return std::make_shared<Cylinder>(axis, radius, half_length);
}
SurfacePtr make_mesh(std::vector<Vec3> vertices, std::vector<std::array<int, 3>> triangles) {
  return std::make_shared<Mesh>(std::move(vertices), std::move(triangles));
}
SurfacePtr make_shape(std::shared_ptr<const wheel::Body> body) {
  if (!body) throw InputError("a surface needs a shape");
  return std::make_shared<Shape>(std::move(body));
}

SurfacePtr load_stl(const std::string& path, double scale) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw InputError(Problem{path, 0, 0, {}, "cannot be read", "an STL file"});
  std::ostringstream whole;
  whole << in.rdbuf();
  const std::string text = whole.str();
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> triangles;
  std::map<std::array<double, 3>, int> known;
  const auto vertex = [&](double x, double y, double z) {
    const auto [it, fresh] = known.try_emplace({x, y, z}, static_cast<int>(vertices.size()));
    if (fresh) vertices.push_back(scale * Vec3(x, y, z));
    return it->second;
  };
  std::uint32_t count = 0;
  if (text.size() >= 84) std::memcpy(&count, text.data() + 80, 4);
  if (text.size() >= 84 && text.size() == 84 + std::size_t{50} * count) {
    for (std::uint32_t k = 0; k < count; ++k) {
      float f[12];
      std::memcpy(f, text.data() + 84 + std::size_t{50} * k, sizeof f);
      std::array<int, 3> t{};
      for (int v = 0; v < 3; ++v)
        t[std::size_t(v)] = vertex(double{f[3 + 3 * v]}, double{f[4 + 3 * v]}, double{f[5 + 3 * v]});
      triangles.push_back(t);
    }
  } else {
    std::istringstream words(text);
    words.imbue(std::locale::classic());
    std::vector<int> corner;
    for (std::string word; words >> word;)
      if (word == "vertex") {
        double x = 0, y = 0, z = 0;
        if (!(words >> x >> y >> z)) throw InputError(Problem{path, 0, 0, {}, "has a broken vertex", "three numbers"});
        corner.push_back(vertex(x, y, z));
        if (corner.size() == 3) {
          triangles.push_back({corner[0], corner[1], corner[2]});
          corner.clear();
        }
      }
  }
  if (triangles.empty()) throw InputError(Problem{path, 0, 0, {}, "holds no triangles", "an STL file"});
  return make_mesh(std::move(vertices), std::move(triangles));
}

Vec3 closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, n = ab.cross(ac);
  const double area = n.squaredNorm();
  if (area > 0.0) {
    const Vec3 ap = p - a;
    const double v = ap.cross(ac).dot(n) / area, w = ab.cross(ap).dot(n) / area;
    if (v > 0.0 && w > 0.0 && v + w < 1.0) {
      return a + v * ab + w * ac;
    }
  }
  const auto on_segment = [&](const Vec3& s, const Vec3& e) -> Vec3 {
    const Vec3 d = e - s;
    const double length = d.squaredNorm();
    return length > 0.0 ? Vec3(s + std::clamp((p - s).dot(d) / length, 0.0, 1.0) * d) : s;
  };
  Vec3 best = on_segment(a, b);
  for (const Vec3& q : {on_segment(b, c), on_segment(c, a)})
    if ((q - p).squaredNorm() < (best - p).squaredNorm()) best = q;
  return best;
}

}  // namespace terrode::dem
