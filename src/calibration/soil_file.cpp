#include "calibration/soil_file.h"

#include <sstream>

#include "scenario/reader.h"
#include "scenario/section.h"

namespace terrode::calibration {

std::string soil_yaml(const recording::SoilBelief& soil, const std::string& comment) {
  std::string out;
  std::istringstream lines(comment);
  for (std::string line; std::getline(lines, line);) out += line.empty() ? "#\n" : "# " + line + "\n";
  return out + scenario::to_yaml(scenario::soil_table().write(soil));
}

}  // namespace terrode::calibration
