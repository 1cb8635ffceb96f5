#include "bekker/soil.h"

#include <numbers>

namespace terrode::bekker {

Problems Soil::validate() const {
  Problems out;
  require(out, "cohesion", cohesion, "Pa", cohesion >= 0 && cohesion <= 1e7, "a stress from 0 to 1e7 Pa");
  require(out, "friction_angle", friction_angle, "rad", friction_angle >= 0 && friction_angle < 0.49 * std::numbers::pi,
          "an angle from 0 to below 1.54 rad");
  require(out, "shear_modulus", shear_modulus, "m", shear_modulus > 0 && shear_modulus <= 10, "a length above 0, at most 10 m");
  require(out, "k", k, "Pa", k > 0 && k <= 1e15, "above 0, at most 1e15 Pa");
  require(out, "n", n, "-", n > 0 && n <= 5, "above 0, at most 5");
  require(out, "plate_width", plate_width, "m", plate_width > 0 && plate_width <= 100, "a length above 0, at most 100 m");
  require(out, "bulk_density", bulk_density, "kg/m3", bulk_density > 0 && bulk_density <= 2e4, "above 0, at most 20000 kg/m3");
  require(out, "gravity", gravity, "m/s2", gravity > 0 && gravity <= 1e3, "above 0, at most 1000 m/s2");
  return out;
}

double bekker_modulus(double kc, double kphi, double width) { return kc / width + kphi; }

Problems ContactAngles::validate() const {
  Problems out;
  require(out, "a0", a0, "-", a0 >= 0 && a0 <= 1, "from 0 to 1");
  require(out, "a1", a1, "-", a1 >= -1 && a1 <= 2, "from -1 to 2");
  require(out, "theta_r", theta_r, "rad", theta_r <= 0 && theta_r > -0.5 * std::numbers::pi, "from above -pi/2 to 0 rad");
  return out;
}

}  // namespace terrode::bekker
