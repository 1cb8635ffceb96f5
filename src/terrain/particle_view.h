#pragma once

#include <vector>

namespace terrode::terrain {

// What a ground made of particles shows of itself; a terrain that has them derives from this, too.
class ParticleView {
 public:
  virtual ~ParticleView() = default;
  // Centres x y z [m, world] one after another and radii [m], always in the same order; a ground that is laid as bodies
  // reach it adds new ones at the end.
  virtual void particles(std::vector<float>& position, std::vector<float>& radius) const = 0;
};

}  // namespace terrode::terrain
