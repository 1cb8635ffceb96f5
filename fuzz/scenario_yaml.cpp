// Scenarios of a rig: from text to what methods take, and back to text.
#include "harness.h"
#include "scenario/methods.h"
#include "scenario/scenario.h"

FUZZ(scenario_yaml) {
  using namespace terrode;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const scenario::Scenario s = scenario::parse_scenario(text, "fuzz/scenario.yaml");
  (void)scenario::to_yaml(s);
  (void)s.operating_points();
  (void)scenario::effect_set(s);
  (void)s.wheel_shape();
  (void)scenario::rig_spec(s).validate();
  (void)scenario::rig_motion(s).validate();
}
