#include "recording/recording.h"

namespace terrode::recording {

namespace channel {

std::optional<std::string> unit_of(const std::string& name) {
  static const std::map<std::string, std::string> units = {
      {"time", "s"},        {"slip", ""},           {drawbar_pull, "N"},         {driving_torque, "N m"},
      {sinkage, "m"},       {normal_load, "N"},     {angular_velocity, "rad/s"}, {forward_velocity, "m/s"}};
  const auto found = units.find(name);
  if (found == units.end()) return std::nullopt;
  return found->second;
}

const std::vector<std::string>& names() {
  static const std::vector<std::string> all = {drawbar_pull, driving_torque,   sinkage,
                                               normal_load,  angular_velocity, forward_velocity};
  return all;
}

}  // namespace channel

const Channel* Run::find(const std::string& name) const {
  for (const Channel& c : channels)
    if (c.name == name) return &c;
  return nullptr;
}

}  // namespace terrode::recording
