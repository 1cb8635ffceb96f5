// What the ground is made of, as Bekker-type methods see it.
#pragma once

#include "core/problem.h"

namespace terrode::bekker {

// Parameters of a homogeneous soil: pressure-sinkage sigma = k (z/plate_width)^n (Smith et al. Eq. 5), residual shear
// stress tau_res = c + sigma tan(phi) (Mohr-Coulomb, Eq. 10) and shear modulus K of Janosi & Hanamoto (1961).
// Defaults: Mojave Martian Simulant, Smith et al. Table 1.
struct Soil {
  double cohesion = 139.280;          // c, Pa
  double friction_angle = 0.606;      // phi, rad
  double shear_modulus = 5.151e-4;    // K, m
  double k = 2.541e5;                 // Pa
  double n = 1.387;                   // -
  double plate_width = 0.05;          // m
  double bulk_density = 1600.0;       // kg/m3
  double gravity = 9.81;              // m/s2

  // Every parameter outside what makes physical sense.
  Problems validate() const;

  // Unit weight gamma_s = rho g [N/m3].
  double unit_weight() const { return bulk_density * gravity; }
};

// k of sigma = k (z/1 m)^n for Bekker's moduli and a contact of width b [m]: k = kc/b + kphi
// (Bekker 1969; kc in N/m^(n+1), kphi in N/m^(n+2)). Use it with plate_width = 1 m.
double bekker_modulus(double kc, double kphi, double width);

// Where the normal stress peaks and where contact ends: theta_m = (a0 + a1 s) theta_f (Eq. 7), exit angle theta_r
// (0 or negative: behind the lowest point). Defaults: Smith et al. Table 6.
struct ContactAngles {
  double a0 = 0.18;
  double a1 = 0.32;
  double theta_r = 0.0;  // rad

  Problems validate() const;
};

}  // namespace terrode::bekker
