// The commands of `terrode`: one file each in this room, one line each in the list of commands.cpp.
//
// A command file defines `void add_NAME(Command& app, Common& common)`: it makes the subcommand, its options, and a
// callback that does the work. The callback throws InputError (exit status 2), RunError (1) or Interrupted (130), or
// sets common.status; results go to standard output, everything else to standard error (terminal.h).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "cli/arguments.h"

namespace terrode::cli {

// Options that every command takes; filled by CLI11 before a command runs.
struct Common {
  bool json = false;         // one JSON document on standard output
  int threads = 0;           // -j N; 0: all cores
  unsigned long seed = 1;    // --seed N
  bool quiet = false;        // no progress, no notes
  std::string report;        // --report FILE.html, for commands with a picture

  Option* seed_option = nullptr;  // of the command that runs
  bool seed_given() const;
  int status = 0;            // exit status of a command that ends without an exception
  std::string command_line;  // as typed, for reports and result files

  // Words that complete the value of an option or argument ("sweep --method"), for the shell.
  std::map<std::string, std::vector<std::string>> words;
};

// Adds the common options to a subcommand (with --report only where `with_report`).
void add_common(Command& command, Common& common, bool with_report);

// The whole command line, unparsed; `app` and `common` must outlive the parsing.
void build(Command& app, Common& common);

// Builds the command line, runs the command named, returns the exit status: 0 done, 1 the work failed, 2 input wrong,
// 130 interrupted.
int run(int argc, char** argv);

}  // namespace terrode::cli
