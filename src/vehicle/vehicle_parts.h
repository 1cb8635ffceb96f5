// Inside of Vehicle, shared by its sources.
#pragma once

#include "vehicle/vehicle.h"

namespace terrode::vehicle {

struct Vehicle::WheelParts {
  multibody::Body* body = nullptr;
  multibody::Hinge* axle = nullptr;
  multibody::Hinge* steering = nullptr;
  multibody::Slider* strut = nullptr;
  double radius = 0.0;
  double command = 0.0, target_angle = 0.0, energy = 0.0;
  double axle_rate = 0.0, steering_rate = 0.0;  // at the step's beginning
  bool voltage_limited = false;
};

// A wheel has sunk to its axle: within run() the machine has dug itself in.
class Buried : public RunError {
 public:
  using RunError::RunError;
};

inline Problem vehicle_problem(std::string key, std::string message, std::string expected) {
  return {{}, 0, 0, std::move(key), std::move(message), std::move(expected)};
}

}  // namespace terrode::vehicle
