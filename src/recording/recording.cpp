#include "recording/recording.h"

namespace terrode::recording {

const Channel* Run::find(const std::string& name) const {
  for (const Channel& c : channels)
    if (c.name == name) return &c;
  return nullptr;
}

}  // namespace terrode::recording
