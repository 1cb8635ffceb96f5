// Drives of machines, and machines in files of their own.
#include "harness.h"
#include "scenario/vehicle_file.h"

FUZZ(vehicle_yaml) {
  using namespace terrode;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    (void)scenario::parse_machine(text, "fuzz/machine.yaml");
  } catch (const InputError&) {
  }
  const scenario::DriveScenario d = scenario::parse_drive(text, "fuzz/drive.yaml");
  (void)d.make_controller();
}
