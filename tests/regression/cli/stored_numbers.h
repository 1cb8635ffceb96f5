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
      {"node-spring", {-50.82761000793559, -4.2694687980663648, 0.012954564321611246, 26.23026934471299, 5.8208803896590311, 0.01258932708667336, 47.186606301050247, 8.5777329697690909, 0.012705003041297548}},
      {"vehicle", {0.072711613940077566, -0.0075232749839091789, 34.9668760957167, 0.013850482389024411}},
  };
  return numbers;
}

}  // namespace terrode
