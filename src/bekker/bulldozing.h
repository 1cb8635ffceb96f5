// Passive earth pressure in front of something that pushes into soil.
#pragma once

#include <cmath>

namespace terrode::bekker {

// Force per width [N/m] on a blade sunk to `depth` [m] that pushes soil with a flat wedge of destruction angle
// Xc = 45 deg - phi/2 (Hegedus 1960, as Ishigami et al. 2007 use it at the side of a wheel):
//   R = (cot Xc + tan(Xc + phi)) [ h c + rho g h^2/2 (cot Xc + cot^2 Xc / cot phi) ]
// cohesion [Pa], tan_phi [-], unit_weight rho g [N/m3]. Zero at depth 0.
inline double bulldozing_resistance(double cohesion, double tan_phi, double unit_weight, double depth) {
  const double phi = std::atan(tan_phi), Xc = 0.25 * 3.14159265358979323846 - 0.5 * phi;
  const double cot = 1.0 / std::tan(Xc);
  return (cot + std::tan(Xc + phi)) * depth * (cohesion + 0.5 * unit_weight * depth * (cot + cot * cot * tan_phi));
}

}  // namespace terrode::bekker
