// Rolling parts. History: the torque of the rolling spring [N m], three numbers. All oppose the relative rotation.
#pragma once

#include "dem/law/contact.h"

namespace terrode::dem {

// The coefficient in force: mu_r, or min(mu_r v_t^2, 1) of Eq. 23 with v_t the relative surface velocity at the
// contact.
template <class T>
TERRODE_KERNEL T rolling_coefficient(const PairLaw& law, const Contact<T>& c) {
  if (law.rolling_rate > 0.0)
    return smaller(T(law.rolling_rate) * (c.vtx * c.vtx + c.vty * c.vty + c.vtz * c.vtz), T(1.0));
  return T(law.rolling_friction);
}

struct NoRolling {
  static constexpr const char* name = "none";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw&, Contact<T>& c, T*) {
    c.mx = c.my = c.mz = T(0.0);
  }
};

// Constant directional torque (Ai et al. 2011, type A): mu_r R_eff |F_n| against the relative rolling spin.
// (LIGGGHTS' cdt takes the spring's part of F_n and divides by the spin with its part about n.)
struct ConstantTorque {
  static constexpr const char* name = "cdt";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw& law, Contact<T>& c, T*) {
    const T w = square_root(c.wx * c.wx + c.wy * c.wy + c.wz * c.wz);
    const T scale = rolling_coefficient(law, c) * c.radius_eff * absolute(c.fn) / larger(w, T(1e-300));
    const T on = select(w > T(0.0), scale, T(0.0));
    c.mx = T(0.0) - on * c.wx;
    c.my = T(0.0) - on * c.wy;
    c.mz = T(0.0) - on * c.wz;
  }
};

// Elastic-plastic spring-dashpot (Ai et al. 2011, type C; Eqs. 19-23). The spring's torque grows by kr w dt, is
// projected on the tangent plane like the tangential displacement, and is limited to mu_r R_eff |F_n|. Stiffness:
//   epsd   kr = 2.25 kn (mu_r R_eff)^2, dashpot 2 eta sqrt(I kr) w while below the limit
//   epsd2  kr = kt R_eff^2, no dashpot (Wensrich & Katterfeld 2012)
//   epsd_capped_sum  as epsd, with the limit on the sum of spring and dashpot as Eq. 19 is printed
//   epsd_unprojected, epsd2_unprojected  as LIGGGHTS computes them, without the projection. When the contact turns, a
//     part of the torque then stays along its normal, where nothing resists: a grain between its neighbours can be spun
//     up without end (5,700 rad/s were seen in a poured bed on a smooth floor).
enum class RollingForm { epsd, epsd2, epsd_capped_sum };

template <RollingForm Form, bool Project = true>
struct SpringDashpotRolling {
  static constexpr const char* name = Form == RollingForm::epsd    ? (Project ? "epsd" : "epsd_unprojected")
                                      : Form == RollingForm::epsd2 ? (Project ? "epsd2" : "epsd2_unprojected")
                                                                   : "epsd_capped_sum";
  static constexpr int history = 3;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw& law, Contact<T>& c, T* m) {
    const T mu = rolling_coefficient(law, c);
    const T limit = mu * c.radius_eff * absolute(c.fn);
    T kr;
    if constexpr (Form == RollingForm::epsd2)
      kr = c.kt * c.radius_eff * c.radius_eff;
    else
      kr = T(2.25) * c.kn * (mu * c.radius_eff) * (mu * c.radius_eff);
    const T rate = kr * c.dt;
    T x = m[0] + rate * c.wx, y = m[1] + rate * c.wy, z = m[2] + rate * c.wz;
    if constexpr (Project) {
      const T along = x * c.nx + y * c.ny + z * c.nz;
      x = x - along * c.nx;
      y = y - along * c.ny;
      z = z - along * c.nz;
    }
    const T size = square_root(x * x + y * y + z * z);
    const auto holds = size < limit;
    const T scale = select(holds, T(1.0), limit * (T(1.0) / larger(size, T(1e-300))));
    m[0] = x * scale;
    m[1] = y * scale;
    m[2] = z * scale;
    if constexpr (Form == RollingForm::epsd2) {
      c.mx = T(0.0) - m[0];
      c.my = T(0.0) - m[1];
      c.mz = T(0.0) - m[2];
    } else {
      const T gr = T(2.0 * law.rolling_damping) * square_root(c.inertia_eff * kr);
      const T dashpot = Form == RollingForm::epsd ? select(holds, gr, T(0.0)) : gr;
      T tx = m[0] + dashpot * c.wx, ty = m[1] + dashpot * c.wy, tz = m[2] + dashpot * c.wz;
      if constexpr (Form == RollingForm::epsd_capped_sum) {
        const T sum = square_root(tx * tx + ty * ty + tz * tz);
        const T cap = select(sum > limit, limit / larger(sum, T(1e-300)), T(1.0));
        tx = tx * cap;
        ty = ty * cap;
        tz = tz * cap;
      }
      c.mx = T(0.0) - tx;
      c.my = T(0.0) - ty;
      c.mz = T(0.0) - tz;
    }
  }
};

}  // namespace terrode::dem
