// A machine in YAML: bodies, joints, wheels with their drives, sensors; or a URDF file with a sidecar that says which
// links are wheels and how they drive. docs/formats-vehicle.md lists the keys.
#pragma once

#include <string>
#include <vector>

#include "scenario/reader.h"
#include "scenario/table.h"
#include "vehicle/vehicle.h"

namespace terrode::scenario {

// Reads the map of a machine; problems and notes (what a URDF import took and what not) go to `source`.
vehicle::VehicleSpec read_machine(const Node& node, const std::string& key, Source& source);

// A machine alone: the map below the key `vehicle`, or a file that holds one. Throws InputError with every problem.
vehicle::VehicleSpec parse_machine(const std::string& text, const std::string& file);

// JSON Schema of that map: a machine in place, or the sidecar of a URDF file.
Json machine_schema();

// The machine as YAML that parse_machine() reads back (of inertias the moments about the axes alone).
std::string to_yaml(const vehicle::VehicleSpec& machine);

struct MachineFile {
  vehicle::VehicleSpec machine;
  std::vector<std::string> notes;
};
MachineFile load_machine(const std::string& path);

}  // namespace terrode::scenario
