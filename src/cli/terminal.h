// What commands write and how: results on standard output, messages and progress on standard error.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "core/problem.h"
#include "core/progress.h"

namespace terrode::cli {

using Json = nlohmann::ordered_json;

// A number for JSON: null where it is not finite.
Json number(double value);
// Prints one document to standard output.
// The document as text; bytes of a name that are no UTF-8 become U+FFFD, for the library throws on them.
std::string json_text(const Json& document, int indent = -1);
void print_json(const Json& document);
// {"error": ..., "problems": [{file, line, column, key, message, expected}]}.
Json error_json(const std::string& what, const Problems& problems);
Json problem_json(const Problem& problem);

// A line on standard error, unless --quiet.
void note(const Common& common, const std::string& text);

// True where standard error is a terminal; colours where NO_COLOR is not set besides.
bool terminal_messages();
bool colour(int file_descriptor);

// How far long work is: a bar with the time left on a terminal, a line every few seconds elsewhere, nothing with
// --quiet. stop_requested() is true after Ctrl-C. The bar is cleared when the last copy is gone.
Progress show_progress(const Common& common);

// Ctrl-C (SIGINT) and SIGTERM: the first asks the work to stop, the second ends the program.
void catch_interrupts();
bool interrupted();

// Writes a text file in one step: to a name beside it, then renamed. Throws RunError, the old file then untouched.
void write_text_atomically(const std::string& path, const std::string& text);

// A table for people: columns aligned, the first row its head. Numbers go to the right.
std::string aligned(const std::vector<std::vector<std::string>>& rows);

}  // namespace terrode::cli
