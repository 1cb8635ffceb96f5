// What a rig shows of a steady wheel with effects: the steady solution with the soil's and the wheel's effects in its
// stress law, then what the bed does to a wheel that follows it slowly, then rig and sensors.
//
// `wheel` must have been built with the modifiers of the same set (PointLaw::modifiers = effects.modifiers()).
#pragma once

#include "bekker/steady_wheel.h"
#include "effects/effect.h"

namespace terrode::effects {

// The means of a run. Effects that are periodic in wheel angle, position or time take the average over their phase (a
// ripple is zero, whatever the operating point's angle), and effects of the run's start have settled; trends along the
// bed or in time are taken at `operating.position` and `operating.time`. Averages are of first order in a ripple: what
// the soil's nonlinearity makes of its square is not counted. Throws what SteadyWheel::solve does.
Reading steady_reading(const bekker::SteadyWheel& wheel, const EffectSet& effects, bekker::Operating operating);

// One instant: every effect at the operating point's time, position and wheel angle, as if the wheel were in
// equilibrium there. Sensors have settled (no lag). Throws what SteadyWheel::solve does.
Reading reading_at(const bekker::SteadyWheel& wheel, const EffectSet& effects, const bekker::Operating& operating);

// The same from a state that was solved before at the same operating point, for points that differ in nothing that
// soil or wheel feel (see EffectSet::soil_varies).
Reading reading_of(const bekker::SteadyWheel& wheel, const EffectSet& effects, const bekker::Operating& operating,
                   const bekker::SteadyState& state);

}  // namespace terrode::effects
