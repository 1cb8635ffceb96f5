// Robots in URDF, with the sidecar of scenarios/machines/scout.yaml in short.
#include "harness.h"
#include "scenario/urdf_file.h"

FUZZ(urdf) {
  using namespace terrode;
  scenario::UrdfSidecar sidecar;
  sidecar.file = fuzz::as_file("robot.urdf", data, size);
  for (const char* link : {"front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"}) {
    scenario::UrdfWheel wheel;
    wheel.link = link;
    sidecar.wheels.push_back(wheel);
  }
  sidecar.locked = {"camera_pan"};
  (void)scenario::import_urdf(sidecar);
}
