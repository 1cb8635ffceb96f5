#include "cli/commands.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "core/problem.h"
#include "core/progress.h"
#include "core/version.h"

namespace terrode::cli {
namespace {

using AddCommand = void (*)(CLI::App& app, Common& common);

struct Entry {
  const char* name;
  AddCommand add;
};

// One line each: {name, function that adds the subcommand}.
const Entry kCommands[] = {
    {"", nullptr},
};

}  // namespace

void add_common(CLI::App& command, Common& common, bool with_report) {
  command.add_flag("--json", common.json, "one JSON document on standard output");
  command.add_option("-j,--threads", common.threads, "number of threads (default: all cores)")->check(CLI::Range(0, 1024));
  command.add_option("--seed", common.seed, "seed of everything random (default: 1)");
  command.add_flag("--quiet", common.quiet, "no progress and no notes");
  if (with_report) command.add_option("--report", common.report, "write a report page to this HTML file");
}

int run(int argc, char** argv) {
  CLI::App app{"Terrode: predicts how a wheel pulls, sinks and takes torque on deformable soil", "terrode"};
  app.set_version_flag("--version", std::string("terrode ") + version() + " (" + commit() + ")");
  app.require_subcommand(1);
  Common common;
  for (const Entry& e : kCommands)
    if (e.add) e.add(app, common);
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  } catch (const InputError& e) {
    std::fprintf(stderr, "terrode: %s\n", e.what());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "terrode: %s\n", e.what());
    return 1;
  }
}

}  // namespace terrode::cli
