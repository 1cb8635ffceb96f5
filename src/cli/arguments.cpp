#include "cli/arguments.h"

#include <CLI/CLI.hpp>
#include <optional>
#include <utility>

namespace terrode::cli {

Check is_member(std::vector<std::string> words) { return std::make_shared<CLI::IsMember>(std::move(words)); }
Check range(double least, double most) { return std::make_shared<CLI::Range>(least, most); }
Check range(int least, int most) { return std::make_shared<CLI::Range>(least, most); }
Check positive_number() { return std::make_shared<CLI::Validator>(CLI::PositiveNumber); }
Check non_negative_number() { return std::make_shared<CLI::Validator>(CLI::NonNegativeNumber); }

Option* Option::required() {
  option_->required();
  return this;
}

Option* Option::check(const Check& check) {
  option_->check(*check);
  return this;
}

Option* Option::type_name(const std::string& name) {
  option_->type_name(name);
  return this;
}

Option* Option::hidden() {
  option_->group("");
  return this;
}

Option* Option::delimiter(char c) {
  option_->delimiter(c);
  return this;
}

std::size_t Option::count() const { return option_->count(); }

Option* Command::keep(CLI::Option* option) { return options_.emplace_back(std::make_unique<Option>(option)).get(); }

Command* Command::add_subcommand(const std::string& name, const std::string& description) {
  return commands_.emplace_back(std::make_unique<Command>(*app_.add_subcommand(name, description))).get();
}

Option* Command::add_flag(const std::string& names, bool& value, const std::string& description) {
  return keep(app_.add_flag(names, value, description));
}

void Command::callback(std::function<void()> work) { app_.callback(std::move(work)); }
void Command::parse_complete(std::function<void()> work) { app_.parse_complete_callback(std::move(work)); }

template <typename T>
Option* Command::add_option(const std::string& names, T& value, const std::string& description) {
  return keep(app_.add_option(names, value, description));
}

template Option* Command::add_option(const std::string&, std::string&, const std::string&);
template Option* Command::add_option(const std::string&, std::vector<std::string>&, const std::string&);
template Option* Command::add_option(const std::string&, std::vector<int>&, const std::string&);
template Option* Command::add_option(const std::string&, std::vector<double>&, const std::string&);
template Option* Command::add_option(const std::string&, bool&, const std::string&);
template Option* Command::add_option(const std::string&, int&, const std::string&);
template Option* Command::add_option(const std::string&, std::size_t&, const std::string&);
template Option* Command::add_option(const std::string&, double&, const std::string&);
template Option* Command::add_option(const std::string&, std::optional<double>&, const std::string&);

}  // namespace terrode::cli
