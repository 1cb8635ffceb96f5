#include <algorithm>

#include "liggghts/law.h"
#include "liggghts/liggghts_terrain.h"

namespace terrode::liggghts {

Problems LiggghtsParams::validate() const {
  Problems problems = bed.validate();
  require(problems, "reach_behind", reach_behind, "m", reach_behind >= 0.0, "0 or more");
  require(problems, "reach_ahead", reach_ahead, "m", reach_ahead >= 0.0, "0 or more");
  std::string known;
  for (const std::string& name : approximations()) known += (known.empty() ? "" : ", ") + name;
  for (const std::string& name : approximate)
    if (std::find(approximations().begin(), approximations().end(), name) == approximations().end())
      problems.push_back({{}, 0, 0, "approximate", "names '" + name + "'", "of " + known});
  const Problems law = law_problems(bed, approximate);
  problems.insert(problems.end(), law.begin(), law.end());
  return problems;
}

}  // namespace terrode::liggghts
