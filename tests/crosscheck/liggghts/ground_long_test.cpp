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
  using Of = std::function<double(const Phases&)>;
  const auto compare = [&](const char* name, const Of& of, const Of& scale) {
    double mean = 0.0, square = 0.0, size = 0.0, reference = 0.0;
    for (std::size_t k = 0; k < places; ++k) {
      const double d = of(a[k]) - of(b[k]);
      mean += d / places;
      square += d * d / places;
      size += of(b[k]) / places;
      reference += scale(b[k]) / places;
    }
    const double sem = std::sqrt(std::max(0.0, square - mean * mean) / (places - 1));
    std::printf("%s: ours %.4g, theirs more by %.2g +- %.2g\n", name, size, mean, sem);
    EXPECT_LT(std::abs(mean), 3.0 * sem) << name;
    EXPECT_LT(sem, std::abs(reference) / 3.0) << name << " scatters too much to say anything";
  };
  const Of pressed = [](const Phases& f) { return f.pressed.z(); };
  const Of held = [](const Phases& f) { return f.held.z(); };
  const Of rolled = [](const Phases& f) { return f.rolled.z(); };
  const Of torque = [](const Phases& f) { return f.torque; };
  compare("force while pressed in [N]", pressed, pressed);
  compare("force at rest [N]", held, pressed);  // of some beds next to nothing is left
  compare("load while rolling [N]", rolled, rolled);
  compare("torque while rolling [N m]", torque, torque);
}

}  // namespace
}  // namespace terrode::liggghts
