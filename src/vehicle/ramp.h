// How commanded speeds rise, and below which speed a rim stands.
#pragma once

namespace terrode::vehicle {

inline constexpr double standstill = 1e-9;  // m/s of the rim, below which slip has no meaning

// 0 to 1 for u from 0 to 1, with continuous acceleration: 10 u^3 - 15 u^4 + 6 u^5.
inline double smooth_step(double u) {
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 1.0;
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

}  // namespace terrode::vehicle
