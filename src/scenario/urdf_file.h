// Robots in URDF (the Unified Robot Description Format of ROS), read by liburdfdom.
//
// Taken: the tree of links and joints in its zero pose, masses and full inertias; continuous and revolute joints as
// hinges, prismatic ones as sliders; links behind fixed (or locked) joints become one body with their parent. URDF knows
// neither wheels nor drives nor springs: the sidecar names them. What URDF says and a machine has no place for is listed,
// never dropped in silence.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "vehicle/vehicle.h"

namespace terrode::scenario {

struct UrdfWheel {
  std::string link;
  vehicle::VehicleWheelSpec spec;  // shape, drive, steering; place and mass come from the URDF
  // Which of them the sidecar gives; others come from the URDF where it has them (a cylinder's radius and length, a
  // joint's effort, its limits and velocity).
  bool has_radius = false, has_width = false, has_max_torque = false, has_steering_limits = false,
       has_steering_rate = false;
};

struct UrdfSidecar {
  std::string file;  // the URDF
  std::string name;  // empty: the robot's
  std::vector<UrdfWheel> wheels;
  std::map<std::string, vehicle::SpringSpec> springs;  // by joint
  std::set<std::string> locked;                        // joints held at zero
  std::vector<vehicle::JointSpec> joints;              // further ones, which close loops; machine frame
  std::vector<vehicle::SensorSpec> sensors;
  std::optional<Vec3> hitch;                           // m, machine frame
};

struct UrdfImport {
  vehicle::VehicleSpec machine;
  std::vector<std::string> taken, left_out;
};

// The machine's frame is the root link's, moved up or down so that the lowest wheel stands at z = 0. Throws InputError
// with every problem: keys without a file are those of the sidecar.
UrdfImport import_urdf(const UrdfSidecar& sidecar);

}  // namespace terrode::scenario
