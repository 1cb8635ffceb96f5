// Ready-made machines. Their numbers are round ones of their class, not of a built example.
#pragma once

#include <string>
#include <vector>

#include "vehicle/vehicle.h"

namespace terrode::vehicle {

// Six-wheel rover, 180 kg: a rocker on either side, pivoted to the body and coupled by a differential bar (two rods of
// ball joints), a bogie at each rocker's rear end; front and rear wheels steered. Wheels r 0.13 m, b 0.16 m.
VehicleSpec rocker_bogie_rover();

// Four-wheel skid-steer robot, 25 kg, no suspension, direct-current motors. Wheels r 0.10 m, b 0.08 m.
VehicleSpec skid_steer_robot();

// Two-axle car, 1200 kg, a strut with spring and damper at each wheel, front wheels steered, rear wheels driven.
// Wheels r 0.32 m, b 0.22 m.
VehicleSpec two_axle_car();

// Single axle of two free wheels under a 60 kg load, with a light third wheel in front that keeps it level. It is
// towed: a hitch pull of -F draws it forward with F. Wheels r 0.20 m, b 0.12 m.
VehicleSpec towed_axle();

// "rocker-bogie-rover", "skid-steer-robot", "two-axle-car", "towed-axle".
const std::vector<std::string>& machine_names();
// Throws InputError for an unknown name, with the nearest.
VehicleSpec machine(const std::string& name);

}  // namespace terrode::vehicle
