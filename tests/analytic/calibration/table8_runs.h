// Wheel runs made of a known soil, for tests of the fit.
#pragma once

#include <vector>

#include "calibration/wheel_fit.h"
#include "core/random.h"

namespace terrode::calibration {

// Smith et al. Table 8 and its contact angles, the wheel and slips of the paper; two loads more.
inline bekker::Soil table8() {
  bekker::Soil s;
  s.cohesion = 96.24;
  s.friction_angle = 0.606;
  s.shear_modulus = 4.534e-3;
  s.k = 2.305e4;
  s.n = 0.418;
  return s;
}
inline constexpr bekker::ContactAngles kAngles{0.09, 0.90, 0.0};

inline WheelData synthetic(Random& random, double noise, const std::vector<double>& loads = {70, 115, 180}) {
  WheelData data;
  data.radius = 0.13;
  data.width = 0.16;
  const bekker::SteadyWheel wheel({0.13, 0.16}, table8(), kAngles);
  for (const double load : loads)
    for (const double slip : {-0.5, -0.3, -0.1, 0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7}) {
      WheelPoint p;
      p.operating.slip = slip;
      p.operating.normal_load = load;
      const bekker::SteadyState s = wheel.solve(p.operating);
      p.mean = {s.drawbar_pull + 4 * noise * random.normal(), s.driving_torque + 0.5 * noise * random.normal(), s.sinkage + 1e-3 * noise * random.normal()};
      data.points.push_back(p);
    }
  return data;
}

}  // namespace terrode::calibration
