// A laboratory made of particles: curves of soil tests on grains whose parameters a search is to find.
#pragma once

#include <vector>

#include "calibration/grain_search.h"
#include "core/parallel.h"

namespace terrode::calibration {

inline const GrainValues kHiddenGrains = {{"young_modulus", 5e6}, {"friction", 0.4}, {"rolling_friction", 0.15}};

// Six beds in a shear box at 2 and 8 kPa and under a plate of 30 mm.
inline recording::Recording laboratory_of_hidden_grains(const DemTestSettings& settings, int threads) {
  constexpr std::size_t kRepeats = 6;
  std::vector<TestTarget> conditions(3);
  for (std::size_t t = 0; t < 3; ++t) {
    TestTarget& c = conditions[t];
    c.test = t < 2 ? "direct_shear" : "pressure_sinkage";
    if (t < 2) c.normal_stress = t == 0 ? 2000 : 8000;
    else c.plate_width = c.plate_length = 0.03;
    for (int i = 1; i <= 24; ++i) c.at.push_back((t < 2 ? 5e-3 : 8e-3) * i / 24);
  }
  std::vector<std::vector<std::vector<double>>> curves(kRepeats);
  parallel_for(kRepeats, threads, [&](std::size_t r) { curves[r] = simulate_tests(conditions, settings, kHiddenGrains, 777000 + r); });
  recording::Recording out;
  out.title = "DEM of hidden grains";
  for (const auto& c : curves)
    for (std::size_t t = 0; t < 3; ++t) {
      std::vector<double> x = {0.0}, y = {0.0};
      x.insert(x.end(), conditions[t].at.begin(), conditions[t].at.end());
      y.insert(y.end(), c[t].begin(), c[t].end());
      if (t < 2) {
        recording::DirectShearTest test;
        test.normal_stress = conditions[t].normal_stress;
        test.shear_displacement = x;
        test.shear_stress = y;
        out.direct_shear.push_back(test);
      } else {
        recording::PressureSinkageTest test;
        test.plate_width = test.plate_length = conditions[t].plate_width;
        test.sinkage = x;
        test.pressure = y;
        out.pressure_sinkage.push_back(test);
      }
    }
  return out;
}

}  // namespace terrode::calibration
