// Wheels as triangles, for engines that know no closed forms.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/frames.h"
#include "wheel/body.h"

namespace terrode::liggghts {

struct TriangleMesh {
  std::vector<Vec3> vertices;  // m
  std::vector<std::array<int, 3>> triangles;
};

// A wheel's surface in its own axes, turned outward: rim (crown included), side walls and each lug as a closed prism. Facets depart from
// the rim by at most `tolerance` [m], half of it inside and half outside on average. Throws InputError for other bodies.
TriangleMesh mesh_of(const wheel::Body& body, double tolerance);

// The mesh at a pose, as the text of an STL file.
std::string stl(const TriangleMesh& mesh, const Pose& pose);

}  // namespace terrode::liggghts
