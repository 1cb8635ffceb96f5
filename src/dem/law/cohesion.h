// Cohesion parts, last in order: they do not raise the limits of friction and rolling, as in LIGGGHTS.
#pragma once

#include "dem/law/contact.h"

namespace terrode::dem {

struct NoCohesion {
  static constexpr const char* name = "none";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw&, Contact<T>&, T*) {}
};

// Simplified Johnson-Kendall-Roberts: an attraction proportional to the contact area pi a^2 = pi R_eff overlap.
struct AreaCohesion {
  static constexpr const char* name = "area";
  static constexpr int history = 0;
  template <class T>
  TERRODE_KERNEL static void apply(const PairLaw& law, Contact<T>& c, T*) {
    c.fn = c.fn - T(law.attraction * 3.14159265358979323846) * c.contact_radius * c.contact_radius;
  }
};

}  // namespace terrode::dem
