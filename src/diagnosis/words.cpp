#include "diagnosis/words.h"

#include <fmt/format.h>

namespace terrode::diagnosis {

std::string plural(const std::vector<std::string>& ids) {
  std::string out;
  for (std::size_t i = 0; i < ids.size(); ++i) out += (i == 0 ? "" : i + 1 == ids.size() ? " or " : ", ") + ids[i];
  return out;
}

std::string strength_text(const std::map<std::string, Estimate>& parameters) {
  std::string out;
  for (const auto& [name, e] : parameters) {
    out += fmt::format("{}{} = {:.3g}", out.empty() ? "" : ", ", name, e.value);
    if (e.deviation > 0) out += fmt::format(" +- {:.2g}", e.deviation);  // a form of the law is chosen, not fitted
    if (e.unit != "-") out += " " + e.unit;
  }
  return out;
}

}  // namespace terrode::diagnosis
