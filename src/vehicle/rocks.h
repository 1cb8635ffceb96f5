// Rocks on the ground: rigid spheres and boxes, loose on the soil or fixed in it, that wheels and bodies of a machine
// climb, push or are held by.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/frames.h"
#include "core/problem.h"
#include "multibody/collisions.h"

namespace terrode::vehicle {

struct RockSpec {
  std::string name;
  multibody::ShapeKind shape = multibody::ShapeKind::sphere;  // or box
  double radius = 0.05;           // m, of a sphere
  Vec3 size = Vec3::Constant(0.1);  // m, edges of a box
  double x = 0.0, y = 0.0;        // m
  double heading = 0.0;           // rad about z
  double density = 2700.0;        // kg/m3
  bool fixed = false;             // part of the ground: does not move
  double buried = 0.0;            // m below the undisturbed surface, of its lowest point; fixed rocks alone

  double height() const;          // m, from its lowest to its highest point as it lies
  double reach() const;           // m, of a circle about (x, y) that holds it
  double mass() const;            // kg
  double distance(double px, double py) const;  // m in plan, from its edge; 0 inside
  Problems validate(const std::string& key) const;
};

// Rocks strewn over a rectangle: their diameters D follow N(>D) ~ D^-exponent between `smallest` and `largest` (the
// size-frequency law of fragments; exponents of 2 to 3 are usual on planetary surfaces), places are uniform, none
// overlaps another or the circle of `clear_radius` about (clear_x, clear_y).
struct RockField {
  int count = 0;
  double x0 = 0.0, y0 = 0.0, x1 = 0.0, y1 = 0.0;  // m
  double smallest = 0.04, largest = 0.15;         // m, diameters
  double exponent = 2.5;
  double density = 2700.0;     // kg/m3
  bool fixed = false;
  double buried_share = 0.3;   // of the diameter, of fixed rocks
  double clear_x = 0.0, clear_y = 0.0, clear_radius = 0.0;  // m
  std::uint64_t seed = 1;
  Problems validate(const std::string& key) const;
};

// Throws InputError where the rectangle does not hold them all.
std::vector<RockSpec> scatter(const RockField& field);

}  // namespace terrode::vehicle
