// Soil files: what a calibration leaves behind for scenarios.
#pragma once

#include <string>

#include "recording/recording.h"

namespace terrode::calibration {

// The soil as YAML that a scenario takes by its name (`soil: FILE`); each line of `comment` becomes a comment at its head.
std::string soil_yaml(const recording::SoilBelief& soil, const std::string& comment);

}  // namespace terrode::calibration
