// What the instruments of a rig show of what acted: rig and sensor effects on the channels of a simulated run.
#pragma once

#include "effects/effect.h"
#include "recording/recording.h"
#include "wheel/body.h"

namespace terrode::vehicle {

// Applies every measure() of the set to drawbar_pull, driving_torque, sinkage and normal_load, sample by sample in
// time. `run` needs the channels that a Rig gives.
void apply_instruments(const effects::EffectSet& effects, const wheel::Rolling& rim, recording::Run& run);

}  // namespace terrode::vehicle
