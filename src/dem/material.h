// Materials, how two of them act on each other, and the time step they allow.
#pragma once

#include <string>
#include <vector>

#include "core/problem.h"
#include "dem/law/contact.h"

namespace terrode::dem {

// What a grain, a wall or a wheel is made of.
struct Material {
  std::string name = "soil";
  double young_modulus = 7.0e7;  // Pa
  double poisson_ratio = 0.35;   // -, 0 to 0.5
  Problems validate() const;
};

// How a pair of materials acts: the parts of the law by name and their coefficients. The defaults are the paper's
// grain on grain (Table 2), with its rolling coefficient at the limit it reaches for anything that moves (mu_r = 1).
struct Interaction {
  std::string normal = "hertz";        // none, hertz
  std::string tangential = "mindlin";  // none, mindlin (limit on the spring), mindlin_capped_sum (Eq. 18 as printed)
  std::string rolling = "epsd";        // none, cdt, epsd, epsd2 and others: dem/law/rolling.h
  std::string cohesion = "none";       // none, area
  double restitution = 0.4;            // -, e in (0, 1]
  double friction = 0.86;              // -, mu_c
  double rolling_friction = 1.0;       // -, mu_r
  double rolling_rate = 0.0;           // s2/m2, mu_r of Eq. 23: mu_r,eff = min(rolling_rate v_t^2, 1); 0: constant mu_r
  double rolling_damping = 1.0;        // -, factor of the critical rolling dashpot
  double cohesion_energy_density = 0.0;  // Pa
  // G_eff with (2 + nu)(1 - nu) as Eq. 17 is printed, instead of Mindlin's (2 - nu)(1 + nu).
  bool printed_shear_modulus = false;
  Problems validate() const;
  // Smooth wall of the paper: no friction, no rolling resistance, e = 0.06.
  static Interaction smooth_wall();
};

// The constants the kernels use (Eqs. 12-23). Throws InputError for invalid parameters.
PairLaw make_pair_law(const Material& a, const Material& b, const Interaction& interaction);

// beta(e) = ln e/sqrt(ln^2 e + pi^2) (Eq. 14).
double damping_ratio(double restitution);

// Rayleigh time pi R sqrt(rho/G)/(0.1631 nu + 0.8766) [s] of a sphere of radius R [m] and density rho [kg/m3]
// (Thornton & Randall 1988): the time a surface wave takes to run around it.
double rayleigh_time(double radius, double density, const Material& material);

// The fraction of the smallest Rayleigh time that is suggested as a time step, and the one above which a step is
// refused.
inline constexpr double suggested_rayleigh_fraction = 0.08;
inline constexpr double largest_rayleigh_fraction = 0.3;

}  // namespace terrode::dem
