// The list of effects for people: what `terrode effects` prints and docs/effects.md holds. Everything comes from Info
// and from the steady wheel.
#pragma once

#include <string>
#include <vector>

#include "effects/effect.h"
#include "effects/steady_reading.h"

namespace terrode::effects {

// Wheel, soil and operating point that Fingerprint speaks of.
bekker::WheelSize reference_wheel();
bekker::Soil reference_soil();
bekker::Operating reference_operating();

// What an effect at its typical strength changes in the steady means there: with the effect less without it [N, N m, m].
Reading reference_change(const EffectType& type);

// "speed, position", or "" where it varies with nothing.
std::string varies_with(const Fingerprint& fingerprint);
const char* scale_name(Scale scale);

// A table of all (one line each), and one effect in full, as text.
std::vector<std::vector<std::string>> catalogue_rows();
std::string catalogue_entry(const EffectType& type);

// docs/effects.md.
std::string catalogue_markdown();

}  // namespace terrode::effects
