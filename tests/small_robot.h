// A robot of 4 kg on four wheels of 60 mm, the beginning of a vehicle scenario; what comes next is its ground.
#pragma once

#include <string>
#include <vector>

namespace terrode {

inline const std::string kSmallRobot = R"(vehicle:
  name: small-robot
  bodies:
    - {name: frame, mass: 3 kg, position: [0, 0, 0.1], size: [0.2, 0.12, 0.06]}
  wheels:
    - {name: fl, parent: frame, centre: [0.08, 0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
    - {name: fr, parent: frame, centre: [0.08, -0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
    - {name: rl, parent: frame, centre: [-0.08, 0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
    - {name: rr, parent: frame, centre: [-0.08, -0.08, 0.06], mass: 0.25 kg, radius: 60 mm, width: 40 mm, drive: {kind: speed, max_torque: 3 N m}}
)";

inline double mean_of_second_half(const std::vector<double>& v) {
  double sum = 0.0;
  for (std::size_t i = v.size() / 2; i < v.size(); ++i) sum += v[i];
  return sum / static_cast<double>(v.size() - v.size() / 2);
}

}  // namespace terrode
