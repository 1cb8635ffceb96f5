// Quantities, units and lists of slips, as they stand on command lines and in files.
#include "core/units.h"
#include "harness.h"
#include "scenario/scenario.h"

FUZZ(words) {
  using namespace terrode;
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const char* unit : {"m", "N", "rad/s", "Pa", ""}) (void)parse_quantity(text, unit);
  (void)parse_unit(text);
  (void)nearest_word(text, {"normal_load", "angular_velocity"});
  (void)scenario::parse_slips(text);
}
