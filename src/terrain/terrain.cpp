#include "terrain/terrain.h"

#include <cmath>

#include "core/problem.h"

namespace terrode::terrain {

std::uint64_t digest(std::span<const std::uint8_t> bytes) {
  std::uint64_t h = 14695981039346656037ull;
  for (const std::uint8_t b : bytes) h = (h ^ b) * 1099511628211ull;
  return h;
}

std::uint64_t Terrain::hash() const { return digest(snapshot()); }

void require_finite(const Pose& pose, const Twist& twist, const char* who) {
  const bool finite = pose.p_W.allFinite() && pose.R_WB.coeffs().allFinite() && twist.v_W.allFinite() && twist.w_W.allFinite();
  if (!finite) throw RunError(std::string(who) + ": pose or twist of a body is not finite");
  constexpr double slack = 1e-6;  // a rotation integrated in double precision stays far closer to length 1
  if (std::abs(pose.R_WB.squaredNorm() - 1.0) > slack)
    throw RunError(std::string(who) + ": the rotation of a body is not of length 1");
}

}  // namespace terrode::terrain
