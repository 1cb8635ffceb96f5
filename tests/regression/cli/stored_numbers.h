// Numbers of one machine (gcc 12, -O3, x86-64 with AVX-512), for others to agree with. A change of physics changes them:
// same_numbers_test.cpp prints the new ones where it fails.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace terrode {

inline const std::map<std::string, std::vector<double>>& stored_numbers() {
  static const std::map<std::string, std::vector<double>> numbers = {
      {"particles", {0.0032267003977123746, 0.27498268765625328, 26.957605284958657, 0.38005220638650788}},
      {"steady", {-40.131685589340435, -1.8548709836692863, 0.016235836220377556, 24.69585227300621, 6.4643331718618287, 0.015172753252264961, 37.210114686170243, 8.45762277048218, 0.016513953881322204}},
      {"node-spring", {-50.827599950612957, -4.2694682204580001, 0.012954561146225743, 26.230261251239249, 5.8208790951148179, 0.012589325947276658, 47.186598511225334, 8.577731859757094, 0.012705002463498066}},
      {"vehicle", {0.07166580491178892, -0.008138912168647811, 37.58397014410654, 0.01583939093435759}},
  };
  return numbers;
}

}  // namespace terrode
