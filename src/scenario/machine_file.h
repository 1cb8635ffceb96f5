// A machine in YAML: bodies, joints, wheels with their drives, sensors; or a URDF file with a sidecar that says which
// links are wheels and how they drive. docs/formats-vehicle.md lists the keys.
#pragma once

#include <string>
#include <vector>

#include "scenario/reader.h"
#include "vehicle/vehicle.h"

namespace terrode::scenario {

// Reads the map of a machine; problems and notes (what a URDF import took and what not) go to `source`.
vehicle::VehicleSpec read_machine(const Node& node, const std::string& key, Source& source);

// A machine alone: the map below the key `vehicle`, or a file that holds one. Throws InputError with every problem.
vehicle::VehicleSpec parse_machine(const std::string& text, const std::string& file);

struct MachineFile {
  vehicle::VehicleSpec machine;
  std::vector<std::string> notes;
};
MachineFile load_machine(const std::string& path);

}  // namespace terrode::scenario
