#include "cli/commands.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <exception>

#include "cli/terminal.h"
#include "core/problem.h"
#include "core/progress.h"
#include "core/system_error.h"
#include "core/version.h"
#include "liggghts/ranks.h"

// One line a command: X(name) stands for add_name() of src/cli/name.cpp. In the order in which help lists them.
#define TERRODE_COMMANDS(X) \
  X(run)                    \
  X(sweep)                  \
  X(drive)                  \
  X(converge)               \
  X(diagnose)               \
  X(oscillation)            \
  X(compare)                \
  X(calibrate)              \
  X(calibrate_dem)          \
  X(dem_to_bekker)          \
  X(export)                 \
  X(view)                   \
  X(validate)               \
  X(schema)                 \
  X(completion)             \
  X(effects)                \
  X(man)

namespace terrode::cli {

#define TERRODE_DECLARE(name) void add_##name(Command& app, Common& common);
TERRODE_COMMANDS(TERRODE_DECLARE)
#undef TERRODE_DECLARE

namespace {

std::string quoted(const std::string& word) {
  if (!word.empty() && word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%") == std::string::npos)
    return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

// CLI11's message with the nearest known option or command added where one was mistyped.
std::string command_line_error(const CLI::App& app, const std::string& message) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) known.push_back(command->get_name());
  for (const CLI::App* command : app.get_subcommands())
    for (const CLI::Option* option : command->get_options())
      for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  const std::size_t colon = message.rfind(": ");
  if (message.find("not expected") == std::string::npos || colon == std::string::npos) return message;
  std::string word = message.substr(colon + 2);
  if (const std::size_t dash = word.find("--"); dash != std::string::npos) word = word.substr(dash);
  word = word.substr(0, word.find_first_of(" ="));
  const std::string near = nearest_word(word, known);
  return near.empty() || near == word ? message : fmt::format("{} (did you mean '{}'?)", message, near);
}

void say(const Common& common, const Problems& problems, const std::string& what) {
  if (common.json) print_json(error_json(what, problems));
  for (const Problem& p : problems) std::fprintf(stderr, "%s%s\n", p.file.empty() ? "terrode: " : "", p.text().c_str());
  if (problems.empty()) std::fprintf(stderr, "terrode: %s\n", what.c_str());
}

// What went to standard output must have arrived there.
int flushed(int status) {
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return status;
  if (errno == EPIPE) return status;  // the reader has seen enough
  std::fprintf(stderr, "terrode: cannot write to standard output: %s\n", system_error_text(errno).c_str());
  return status == 0 ? 1 : status;
}

}  // namespace

bool Common::seed_given() const { return seed_option != nullptr && seed_option->count() > 0; }

void add_common(Command& command, Common& common, bool with_report) {
  command.add_flag("--json", common.json, "one JSON document on standard output");
  command.add_option("-j,--threads", common.threads, "number of threads (default: all cores)")
      ->check(range(0, 1024))
      ->type_name("N");
  Option* seed = command.add_option("--seed", common.seed, "seed of everything random (default: the scenario's, else 1)")
                          ->check(range(0, 2147483647))
                          ->type_name("N");
  command.add_flag("--quiet", common.quiet, "no progress and no notes");
  if (with_report)
    command.add_option("--report", common.report, "write a report page to this HTML file")->type_name("FILE.html");
  command.parse_complete([seed, &common] { common.seed_option = seed; });
}

void build(Command& app, Common& common) {
  app.app().set_version_flag("--version", std::string("terrode ") + version() + " (" + commit() + ")");
  app.app().require_subcommand(1);
  app.app().footer("Exit status: 0 done, 1 the work failed, 2 the input or the command line is wrong, 130 interrupted.");
#define TERRODE_ADD(name) add_##name(app, common);
  TERRODE_COMMANDS(TERRODE_ADD)
#undef TERRODE_ADD
}

int run(int argc, char** argv) {
  if (const auto status = liggghts::serve()) return *status;  // started by mpirun to help rank 0
  // A file must not take the place of a standard stream that the caller closed.
  for (int fd = 0; fd < 3; ++fd)
    if (fcntl(fd, F_GETFD) < 0 && errno == EBADF && ::open("/dev/null", fd == 0 ? O_RDONLY : O_WRONLY) != fd) return 1;
  CLI::App app{"Terrode: predicts how a wheel pulls, sinks and takes torque on deformable soil", "terrode"};
  Common common;
  common.command_line = "terrode";
  for (int i = 1; i < argc; ++i) common.command_line += " " + quoted(argv[i]);
  Command root(app);
  build(root, common);
  catch_interrupts();
  try {
    app.parse(argc, argv);
    return flushed(common.status);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return flushed(app.exit(e));  // --help, --version
    if (app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-') {
      std::vector<std::string> names;
      for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) names.push_back(command->get_name());
      const std::string near = nearest_word(argv[1], names);
      std::fprintf(stderr, "terrode: '%s' is not a command%s (see 'terrode --help')\n", argv[1],
                   near.empty() ? "" : fmt::format(" (did you mean '{}'?)", near).c_str());
      return 2;
    }
    if (common.json) print_json(error_json(e.what(), {}));
    std::string hint = "terrode";
    for (const CLI::App* command : app.get_subcommands()) hint += " " + command->get_name();
    std::fprintf(stderr, "terrode: %s (see '%s --help')\n", command_line_error(app, e.what()).c_str(), hint.c_str());
    return 2;
  } catch (const InputError& e) {
    say(common, e.problems(), e.what());
    return 2;
  } catch (const Interrupted& e) {
    std::fprintf(stderr, "terrode: interrupted. %s\n", e.what());
    return 130;
  } catch (const std::bad_alloc&) {
    say(common, {}, "not enough memory");
    return 1;
  } catch (const std::exception& e) {
    say(common, {}, e.what());
    return 1;
  }
}

}  // namespace terrode::cli
