// Normal parts. The null part gives no force (and no stiffness for the others to scale with).
#pragma once

#include "dem/law/contact.h"

namespace terrode::dem {

struct NoNormal {
  static constexpr const char* name = "none";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw&, Contact<T>& c, T*) {
    c.kn = T(0.0);
    c.fn = T(0.0);
  }
};

// Hertz with viscoelastic damping (Tsuji et al. 1992; Eqs. 12-14): F_n = kn overlap - gn vn, kn = 4/3 Y_eff a,
// gn = -2 sqrt(5/6) beta sqrt(2 Y_eff a m_eff), a = sqrt(R_eff overlap). Not clipped: it may pull while separating.
struct HertzNormal {
  static constexpr const char* name = "hertz";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw& law, Contact<T>& c, T*) {
    c.kn = T(4.0 / 3.0 * law.young_eff) * c.contact_radius;
    const T gn = T(law.damping * std::sqrt(2.0 * law.young_eff)) * c.root_am;
    c.fn = c.kn * c.overlap - gn * c.vn;
  }
};

}  // namespace terrode::dem
