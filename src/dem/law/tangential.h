// Tangential parts. History: the tangential displacement of the contact [m], three numbers.
#pragma once

#include "dem/law/contact.h"

namespace terrode::dem {

struct NoTangential {
  static constexpr const char* name = "none";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw&, Contact<T>& c, T*) {
    c.kt = T(0.0);
    c.ftx = c.fty = c.ftz = T(0.0);
  }
};

// Mindlin without slip, with history, dashpot and Coulomb limit (Eqs. 15-18): kt = 8 G_eff a,
// gt = -2 sqrt(5/6) beta sqrt(kt m_eff). The displacement xi grows by vt dt and is projected on the tangent plane.
// LimitSum false (as LIGGGHTS computes): the limit mu |F_n| acts on the spring, and the dashpot is dropped while
// sliding. LimitSum true (as Eq. 18 is printed, and as LAMMPS does): it caps the sum of spring and dashpot.
template <bool LimitSum>
struct MindlinTangential {
  static constexpr const char* name = LimitSum ? "mindlin_capped_sum" : "mindlin";
  static constexpr int history = 3;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw& law, Contact<T>& c, T* xi) {
    c.kt = T(8.0 * law.shear_eff) * c.contact_radius;
    const T gt = T(law.damping * std::sqrt(8.0 * law.shear_eff)) * c.root_am;
    T x = xi[0] + c.vtx * c.dt, y = xi[1] + c.vty * c.dt, z = xi[2] + c.vtz * c.dt;
    const T along = x * c.nx + y * c.ny + z * c.nz;
    x = x - along * c.nx;
    y = y - along * c.ny;
    z = z - along * c.nz;
    const T limit = T(law.friction) * absolute(c.fn);
    if constexpr (LimitSum) {
      T fx = T(0.0) - c.kt * x - gt * c.vtx, fy = T(0.0) - c.kt * y - gt * c.vty, fz = T(0.0) - c.kt * z - gt * c.vtz;
      const T force = square_root(fx * fx + fy * fy + fz * fz);
      const auto slides = force > limit;
      const T scale = select(slides, limit / larger(force, T(1e-300)), T(1.0));
      fx = fx * scale;
      fy = fy * scale;
      fz = fz * scale;
      // While sliding the spring holds what the capped force leaves after the dashpot.
      const T inverse = T(1.0) / larger(c.kt, T(1e-300));
      xi[0] = select(slides, T(0.0) - (fx + gt * c.vtx) * inverse, x);
      xi[1] = select(slides, T(0.0) - (fy + gt * c.vty) * inverse, y);
      xi[2] = select(slides, T(0.0) - (fz + gt * c.vtz) * inverse, z);
      c.ftx = fx;
      c.fty = fy;
      c.ftz = fz;
    } else {
      const T spring = c.kt * square_root(x * x + y * y + z * z);
      const auto sticks = spring < limit;  // never without friction
      const T scale = select(sticks, T(1.0), limit * (T(1.0) / larger(spring, T(1e-300))));
      xi[0] = x * scale;
      xi[1] = y * scale;
      xi[2] = z * scale;
      const T dashpot = select(sticks, gt, T(0.0));
      c.ftx = T(0.0) - c.kt * xi[0] - dashpot * c.vtx;
      c.fty = T(0.0) - c.kt * xi[1] - dashpot * c.vty;
      c.ftz = T(0.0) - c.kt * xi[2] - dashpot * c.vtz;
    }
  }
};

}  // namespace terrode::dem
