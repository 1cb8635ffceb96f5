// Reads the parameters of a law that is chosen by name.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "core/problem.h"

namespace terrode::bekker {

// A parameter of a law that is chosen by name, for who reads and describes it.
struct LawParameter {
  std::string name, unit, meaning;
  double lower = 0.0, upper = std::numeric_limits<double>::infinity();
  bool lower_open = false, upper_open = false;
  // The unit is N/m^(n + power), n the exponent of the soil; NaN: it is `unit`.
  double power = std::numeric_limits<double>::quiet_NaN();
};

class LawParameters {
 public:
  LawParameters(std::string law, const std::map<std::string, double>& values) : law_(std::move(law)), values_(values) {}

  // NaN, with a problem noted, where the parameter is absent.
  double take(const std::string& name) {
    known_.push_back(name);
    const auto it = values_.find(name);
    if (it != values_.end()) return it->second;
    problems_.push_back({{}, 0, 0, law_ + "." + name, "is missing", "a value in SI units"});
    return std::numeric_limits<double>::quiet_NaN();
  }

  // Throws InputError with what was missing and what nobody took.
  void finish() {
    for (const auto& [name, value] : values_) {
      bool used = false;
      for (const auto& k : known_) used = used || k == name;
      const std::string near = nearest_word(name, known_);
      if (!used)
        problems_.push_back({{}, 0, 0, law_ + "." + name, "is not a parameter of this law",
                             near.empty() ? "one of its own" : "\"" + near + "\", perhaps"});
    }
    throw_if_any(problems_);
  }

  static InputError unknown(const std::string& kind, const std::string& name, const std::vector<std::string>& names) {
    const std::string near = nearest_word(name, names);
    std::string all;
    for (const auto& n : names) all += (all.empty() ? "" : ", ") + n;
    return InputError(Problem{{}, 0, 0, kind, "\"" + name + "\" is not known",
                              near.empty() ? "one of " + all : "\"" + near + "\", perhaps (one of " + all + ")"});
  }

 private:
  std::string law_;
  const std::map<std::string, double>& values_;
  std::vector<std::string> known_;
  Problems problems_;
};

}  // namespace terrode::bekker
