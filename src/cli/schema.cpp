#include <cstdio>
#include <memory>

#include "cli/terminal.h"
#include "scenario/particle_tests.h"
#include "scenario/scenario.h"
#include "scenario/vehicle_file.h"

namespace terrode::cli {

void add_schema(Command& app, Common& common) {
  Command* command = app.add_subcommand("schema", "print the JSON Schema of a scenario, a vehicle scenario, a recording or soil tests on particles, for editors");
  const auto what = std::make_shared<std::string>("scenario");
  const std::vector<std::string> kinds = {"scenario", "vehicle", "recording", "particle_tests"};
  command->add_option("KIND", *what, "what to describe (default: scenario)")->check(is_member(kinds))->type_name("");
  common.words["schema KIND"] = kinds;
  add_common(*command, common, false);
  command->callback([what] {
    const std::string schema = *what == "recording"        ? scenario::recording_schema()
                               : *what == "vehicle"        ? scenario::vehicle_schema()
                               : *what == "particle_tests" ? scenario::particle_tests_schema()
                                                           : scenario::scenario_schema();
    std::fputs(schema.c_str(), stdout);
  });
}

}  // namespace terrode::cli
