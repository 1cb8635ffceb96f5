// Geometry and kinematics of the arc in contact: Eqs. 6-8 and 11 of Smith et al., shared by the steady wheel, its tests
// and the node-spring terrain.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "bekker/steady_wheel.h"

namespace terrode::bekker {

struct ContactArc {
  double radius, one_minus_s;
  bool locked, skid_split;   // skid_split: s < 0, j in two branches that meet at theta_m with j = 0
  bool along_displacement;   // the shear's sign is j's
  double theta_f, theta_m, theta_r;
  bool peak_clamped = false;
  double sin_f, cos_f, sin_m, chord;

  // Lays the arc for an entry angle theta_f > 0. tan_phi enters the transition angle of towed wheels only.
  ContactArc(const ContactShape& shape, const ContactAngles& angles, SkidShear skid, double friction_angle, double entry)
      : radius(shape.radius), one_minus_s(1.0 - shape.slip), locked(std::isinf(shape.slip)), skid_split(shape.slip < 0),
        along_displacement(skid == SkidShear::along_displacement), theta_f(entry) {
    sin_f = std::sin(theta_f);
    cos_f = std::cos(theta_f);
    theta_r = angles.theta_r;
    if (shape.rear_fraction > 0) theta_r = -std::acos(std::max(-1.0, 1.0 - shape.rear_fraction * (1.0 - cos_f)));
    double wanted;
    if (locked) {
      wanted = theta_r;
    } else if (skid_split && along_displacement) {
      wanted = transition_angle(friction_angle);
    } else {
      wanted = (angles.a0 + angles.a1 * shape.slip) * theta_f;
    }
    theta_m = std::clamp(wanted, theta_r, theta_f);
    peak_clamped = theta_m != wanted;
    sin_m = std::sin(theta_m);
    chord = theta_f > theta_m ? (sin_f - sin_m) / (theta_f - theta_m) : 0.0;
  }

  // The angle whose depth sets the pressure at theta: itself in front of theta_m, Eq. 8 behind.
  double equivalent(double theta) const {
    if (theta >= theta_m) return theta;
    return theta_f - (theta_f - theta_m) * (theta - theta_r) / (theta_m - theta_r);
  }

  // Shear displacement j [m] of Eq. 11, signed; +-infinity for a locked wheel away from its entry.
  double shear_displacement(double theta, double sin_theta) const {
    if (locked) return -std::numeric_limits<double>::infinity();
    if (!skid_split) return radius * ((theta_f - theta) - one_minus_s * (sin_f - sin_theta));
    if (theta >= theta_m) return radius * one_minus_s * ((theta_f - theta) * chord - sin_f + sin_theta);
    return radius * ((theta_m - theta) - one_minus_s * (sin_m - sin_theta));
  }

  // Sign of the thrust that shear gives at theta.
  double shear_sign(double theta, double j) const {
    if (!skid_split) return 1.0;
    if (locked) return -1.0;
    if (along_displacement) return j < 0 ? -1.0 : 1.0;
    return theta >= theta_m ? -1.0 : 1.0;
  }

  // theta_0 of a towed wheel (Wong & Reece 1967, part II), from (1 - s) - cos = t sin, t = tan(45 deg - phi/2): the
  // smaller root; theta_f where there is none within the arc.
  double transition_angle(double friction_angle) const {
    const double t = std::tan(0.25 * 3.14159265358979323846 - 0.5 * friction_angle);
    // cos + t sin = q cos(theta - delta), q = sqrt(1 + t^2), delta = atan t.
    const double c = one_minus_s / std::sqrt(1.0 + t * t);
    if (c > 1.0) return theta_f;
    return std::atan(t) - std::acos(c);
  }
};

}  // namespace terrode::bekker
