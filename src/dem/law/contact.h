// What the parts of a contact law read and write: plain data, the same for one contact (T = double) and for a pack.
#pragma once

#include "dem/law/pack.h"

namespace terrode::dem {

// Most numbers that a law keeps for each contact between steps: tangential part first, then rolling.
inline constexpr int max_history = 6;

// Constants of one pair of materials, as the parts use them. Made by make_pair_law (dem/material.h).
struct PairLaw {
  int normal = 0, tangential = 0, rolling = 0, cohesion = 0;  // which part of each family (dem/law/parts.h)
  double young_eff = 0.0;                                     // Pa, 1/Y_eff = (1-nu1^2)/Y1 + (1-nu2^2)/Y2
  double shear_eff = 0.0;                                     // Pa, G_eff
  double damping = 0.0;                                       // -, -2 sqrt(5/6) beta(e), positive
  double friction = 0.0;                                      // -, Coulomb coefficient mu
  double rolling_friction = 0.0;                              // -, mu_r (constant)
  double rolling_rate = 0.0;                                  // s2/m2, mu_r of Eq. 23; 0: rolling_friction is used
  double rolling_damping = 0.0;                               // -, eta of the rolling dashpot (1: critical)
  double attraction = 0.0;                                    // Pa, cohesion energy density
};

// A contact as it is evaluated. n is the unit normal from j to i; velocities are of i relative to j at the contact.
template <class T>
struct Contact {
  T nx, ny, nz;
  T overlap;         // m
  T radius_eff;      // m, R_i R_j/(R_i + R_j); R for a wall
  T mass_eff;        // kg
  T contact_radius;  // m, sqrt(R_eff overlap)
  T root_am;         // sqrt(contact_radius mass_eff)
  T vn;              // m/s, positive when separating
  T vtx, vty, vtz;   // m/s, tangential, spin included
  T wx, wy, wz;      // rad/s, relative spin without its part about n
  T inertia_eff;     // kg m2, of rolling: 1/I = 1/I_i + 1/I_j, I = 7/5 m R^2
  T dt;              // s
  // Written by the parts, in the order normal, tangential, rolling, cohesion.
  T kn, kt;         // N/m, stiffness of the normal and tangential spring (F = kn overlap)
  T fn;             // N on i along n
  T ftx, fty, ftz;  // N on i, tangential
  T mx, my, mz;     // N m on i, opposite on j
};

}  // namespace terrode::dem
