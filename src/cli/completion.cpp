// Shell completion and the manual page, both made from the command line as it is declared.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "cli/terminal.h"
#include "core/version.h"

namespace terrode::cli {
namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  std::vector<const CLI::App*> out;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!command->get_group().empty()) out.push_back(command);
  return out;
}

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& w : words) out += (out.empty() ? "" : " ") + w;
  return out;
}

std::string bash_completion() {
  CLI::App app{"", "terrode"};
  Common common;
  Command root(app);
  build(root, common);
  std::string names, cases, values;
  for (const CLI::App* command : commands_of(app)) {
    names += (names.empty() ? "" : " ") + command->get_name();
    std::vector<std::string> options;
    std::string words;
    for (const CLI::Option* option : command->get_options()) {
      for (const std::string& s : option->get_snames()) options.push_back("-" + s);
      for (const std::string& l : option->get_lnames()) {
        options.push_back("--" + l);
        const auto found = common.words.find(command->get_name() + " --" + l);
        if (found != common.words.end()) values += fmt::format("    \"{} --{}\") words=\"{}\" ;;\n", command->get_name(), l, joined(found->second));
      }
      if (option->get_positional()) {
        const auto found = common.words.find(command->get_name() + " " + option->get_name());
        if (found != common.words.end()) words = joined(found->second);
      }
    }
    cases += fmt::format("    {}) options=\"{}\" arguments=\"{}\" ;;\n", command->get_name(), joined(options), words);
  }
  return fmt::format(R"(# bash completion of terrode {version}:  source <(terrode completion bash)
_terrode() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}} command=${{COMP_WORDS[1]}}
  local commands="{names}" options="" arguments="" words=""
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "$commands --help --version" -- "$current"))
    return
  fi
  case "$command" in
{cases}  esac
  case "$command $previous" in
{values}  esac
  if [ -n "$words" ]; then
    COMPREPLY=($(compgen -W "$words" -- "$current"))
  elif [ "${{current#-}}" != "$current" ]; then
    COMPREPLY=($(compgen -W "$options" -- "$current"))
  elif [ -n "$arguments" ]; then
    COMPREPLY=($(compgen -W "$arguments" -- "$current"))
  else
    COMPREPLY=($(compgen -f -- "$current"))
  fi
}}
complete -o filenames -o bashdefault -F _terrode terrode
)",
                     fmt::arg("version", version()), fmt::arg("names", names), fmt::arg("cases", cases), fmt::arg("values", values));
}

std::string troff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
  }
  return out.starts_with(".") || out.starts_with("'") ? "\\&" + out : out;
}

std::string manual() {
  CLI::App app{"predicts how a wheel pulls, sinks and takes torque on deformable soil", "terrode"};
  Common common;
  Command root(app);
  build(root, common);
  std::string out = fmt::format(".TH TERRODE 1 \"\" \"terrode {}\" \"User Commands\"\n.SH NAME\nterrode \\- {}\n", version(),
                                troff(app.get_description()));
  out += ".SH SYNOPSIS\n.B terrode\n.I COMMAND\n[\\fIARGUMENTS\\fR] [\\fIOPTIONS\\fR]\n.SH COMMANDS\n";
  for (const CLI::App* command : commands_of(app)) {
    std::string synopsis = "\\fBterrode " + troff(command->get_name()) + "\\fR";
    for (const CLI::Option* option : command->get_options())
      if (option->get_positional()) synopsis += " \\fI" + troff(option->get_name()) + "\\fR";
    out += fmt::format(".SS {}\n{}.\n", synopsis, troff(command->get_description()));
    for (const CLI::Option* option : command->get_options()) {
      std::string name = option->get_positional() ? option->get_name() : option->get_name(false, true);
      const std::string type = option->get_positional() ? "" : option->get_type_name();
      if (!type.empty() && option->get_items_expected() > 0) name += " " + type;
      out += fmt::format(".TP\n\\fB{}\\fR\n{}\n", troff(name), troff(option->get_description()));
    }
  }
  out += ".SH EXIT STATUS\n0 done; 1 the work failed; 2 the input or the command line is wrong; 130 interrupted.\n";
  out += ".SH ENVIRONMENT\n.TP\n\\fBNO_COLOR\\fR\nNo colours in messages.\n";
  return out;
}

}  // namespace

void add_completion(Command& app, Common& common) {
  Command* command = app.add_subcommand("completion", "print the shell completion: source <(terrode completion bash)");
  const auto shell = std::make_shared<std::string>();
  const std::vector<std::string> shells = {"bash"};
  command->add_option("SHELL", *shell, "bash")->required()->check(is_member(shells))->type_name("");
  common.words["completion SHELL"] = shells;
  add_common(*command, common, false);
  command->callback([shell] { std::fputs(bash_completion().c_str(), stdout); });
}

void add_man(Command& app, Common& common) {
  Command* command = app.add_subcommand("man", "print the manual page: terrode man | man -l -");
  add_common(*command, common, false);
  command->callback([] { std::fputs(manual().c_str(), stdout); });
}

}  // namespace terrode::cli
