// Forces on a wheel at six places of a bed, by our own particles and by LIGGGHTS.
#include <cmath>
#include <functional>

#include "same_motion.h"

namespace terrode::liggghts {
namespace {

TEST(LiggghtsGroundLong, MeansOverSixPlacesAgreeWithinTheirScatter) {
  SKIP_WITHOUT_LIGGGHTS();
  constexpr int places = 6;
  const LiggghtsParams p = small_ground(0.04);
  std::vector<Phases> a, b;
  for (int k = 0; k < places; ++k) {
    const double x = 0.0049 * k;  // a sixth of the prism, of which the bed is made
    const auto theirs = make_terrain(p);
    a.push_back(drive(*theirs, x));
    dem::DemTerrain ours(p.bed);
    b.push_back(drive(ours, x));
  }
  const auto compare = [&](const char* name, const std::function<double(const Phases&)>& of) {
    double mean = 0.0, square = 0.0, size = 0.0;
    for (std::size_t k = 0; k < places; ++k) {
      const double d = of(a[k]) - of(b[k]);
      mean += d / places;
      square += d * d / places;
      size += of(b[k]) / places;
    }
    const double sem = std::sqrt(std::max(0.0, square - mean * mean) / (places - 1));
    std::printf("%s: ours %.4g, theirs more by %.2g +- %.2g\n", name, size, mean, sem);
    EXPECT_LT(std::abs(mean), 3.0 * sem) << name;
    EXPECT_LT(sem, std::abs(size) / 3.0) << name << " scatters too much to say anything";
  };
  compare("force while pressed in [N]", [](const Phases& f) { return f.pressed.z(); });
  compare("force at rest [N]", [](const Phases& f) { return f.held.z(); });
  compare("load while rolling [N]", [](const Phases& f) { return f.rolled.z(); });
  compare("torque while rolling [N m]", [](const Phases& f) { return f.torque; });
}

}  // namespace
}  // namespace terrode::liggghts
