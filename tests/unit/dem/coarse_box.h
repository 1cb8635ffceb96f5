// A shear box of a few coarse grains, its bed kept between tests of one program.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

#include "dem/soil_tests.h"

namespace terrode::dem {

inline std::string cache() {
  static const std::string folder =
      (std::filesystem::temp_directory_path() / ("terrode_soil_" + std::to_string(::getpid()))).string();
  return folder;
}

inline DirectShearSettings coarse_box() {
  DirectShearSettings s;
  s.soil.width = s.soil.length = 0.04;
  s.soil.height = 0.04;
  s.soil.sizes.smallest = 5e-3;
  s.soil.sizes.largest = 7e-3;
  s.rate = 0.05;
  s.travel = 4e-3;
  s.samples = 20;
  s.seating = 0.05;
  s.time_step = 2e-5;
  s.cache = cache();
  return s;
}

}  // namespace terrode::dem
