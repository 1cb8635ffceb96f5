// The parts a contact law can be composed of. A new part is a struct with `name`, `history` and `apply`, in a file of
// its own, and its name in one of these lists. Every family begins with its null part. Lanes of a pack that do not
// touch are evaluated too, with zero overlap and history: a part gives no force there.
#pragma once

#include "dem/law/cohesion.h"
#include "dem/law/normal.h"
#include "dem/law/rolling.h"
#include "dem/law/tangential.h"

namespace terrode::dem {

template <class... P>
struct Parts {
  static constexpr int count = sizeof...(P);
  static constexpr const char* names[] = {P::name...};
  static constexpr int histories[] = {P::history...};

  // Runs the part numbered `which`: the same for all lanes, so the branch costs once per pack.
  template <class T>
  TERRODE_KERNEL static void apply(int which, const PairLaw& law, Contact<T>& c, T* history) {
    int k = 0;
    ((which == k++ ? P::apply(law, c, history) : void()), ...);
  }
};

using NormalParts = Parts<NoNormal, HertzNormal>;
using TangentialParts = Parts<NoTangential, MindlinTangential<false>, MindlinTangential<true>>;
using RollingParts =
    Parts<NoRolling, ConstantTorque, SpringDashpotRolling<RollingForm::epsd>, SpringDashpotRolling<RollingForm::epsd2>,
          SpringDashpotRolling<RollingForm::epsd_capped_sum>, SpringDashpotRolling<RollingForm::epsd, false>,
          SpringDashpotRolling<RollingForm::epsd2, false>>;
using CohesionParts = Parts<NoCohesion, AreaCohesion>;

TERRODE_KERNEL int history_size(const PairLaw& law) {
  return TangentialParts::histories[law.tangential] + RollingParts::histories[law.rolling];
}

// The whole law. Geometry and motion of `c` are given; forces, torque and history come out.
template <class T>
TERRODE_KERNEL void evaluate(const PairLaw& law, Contact<T>& c, T* history) {
  c.contact_radius = square_root(c.radius_eff * c.overlap);
  c.root_am = square_root(c.contact_radius * c.mass_eff);
  c.kn = c.kt = c.fn = c.ftx = c.fty = c.ftz = c.mx = c.my = c.mz = T(0.0);
  NormalParts::apply(law.normal, law, c, history);
  TangentialParts::apply(law.tangential, law, c, history);
  RollingParts::apply(law.rolling, law, c, history + TangentialParts::histories[law.tangential]);
  CohesionParts::apply(law.cohesion, law, c, history);
}

}  // namespace terrode::dem
