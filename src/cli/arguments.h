// The command line as a command declares it. What parses it is CLI11, seen by arguments.cpp, commands.cpp and
// completion.cpp alone: its header takes longer to compile than a command does.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
class Validator;
}

namespace terrode::cli {

// What a value must be; said in the help and in the message about a value that is not.
using Check = std::shared_ptr<const CLI::Validator>;
Check is_member(std::vector<std::string> words);
Check range(double least, double most);
Check range(int least, int most);
Check positive_number();
Check non_negative_number();

// An option or a positional argument; every setter returns it again.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}
  Option* required();
  Option* check(const Check& check);
  Option* type_name(const std::string& name);  // what stands for the value in the help
  Option* delimiter(char c);                   // splits one word into several values
  Option* hidden();                            // left out of the help
  std::size_t count() const;                   // how often it was given

 private:
  CLI::Option* option_;
};

class Command {
 public:
  explicit Command(CLI::App& app) : app_(app) {}
  Command* add_subcommand(const std::string& name, const std::string& description);
  // `names`: "-o,--output" for an option, "RECORDING" for an argument. T: std::string, bool, int, std::size_t (unsigned long),
  // double, std::optional<double>, or a vector of std::string, int or double; another type takes a line at the end of arguments.cpp.
  template <typename T>
  Option* add_option(const std::string& names, T& value, const std::string& description);
  Option* add_flag(const std::string& names, bool& value, const std::string& description);
  void callback(std::function<void()> work);         // once the command line is read
  void parse_complete(std::function<void()> work);   // just before
  CLI::App& app() { return app_; }

 private:
  Option* keep(CLI::Option* option);
  CLI::App& app_;
  std::vector<std::unique_ptr<Command>> commands_;
  std::vector<std::unique_ptr<Option>> options_;
};

}  // namespace terrode::cli
