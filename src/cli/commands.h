// The commands of `terrode`: one file each in this room, one line each in the list of commands.cpp.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace terrode::cli {

// Options that every command takes; filled by CLI11 before a command runs.
struct Common {
  bool json = false;         // one JSON document on standard output
  int threads = 0;           // -j N; 0: all cores
  unsigned long seed = 1;    // --seed N
  bool quiet = false;        // no progress, no notes
  std::string report;        // --report FILE.html, for commands with a picture
};

// Adds the common options to a subcommand (with --report only where `with_report`).
void add_common(CLI::App& command, Common& common, bool with_report);

// Builds the command line, runs the command named, returns the exit status: 0 done, 1 the work failed, 2 input wrong.
int run(int argc, char** argv);

}  // namespace terrode::cli
