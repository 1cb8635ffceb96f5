// What the paper says of its shear box (section 3.3): below its rate of 0.66 mm/s the curve does not depend on the rate,
// and a wide range of sizes repeats better than few large grains.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>

#include "core/parallel.h"
#include "dem/soil_tests.h"

namespace terrode::dem {
namespace {

std::string folder() {
  static const std::string path =
      (std::filesystem::temp_directory_path() / ("terrode_soil_long_" + std::to_string(::getpid()))).string();
  return path;
}

// The curves of `seeds` tests [Pa] over the same displacements.
std::vector<std::vector<double>> repeats(DirectShearSettings s, int seeds) {
  s.cache = folder();
  std::vector<std::vector<double>> out(static_cast<std::size_t>(seeds));
  parallel_for(out.size(), 0, [&](std::size_t k) {
    DirectShearSettings one = s;
    one.soil.seed = k + 1;
    out[k] = direct_shear(one).shear_stress;
  });
  return out;
}

std::vector<double> mean_of(const std::vector<std::vector<double>>& curves) {
  std::vector<double> out(curves.front().size(), 0.0);
  for (const auto& c : curves)
    for (std::size_t k = 0; k < out.size(); ++k) out[k] += c[k] / static_cast<double>(curves.size());
  return out;
}

// Deviation between repeats, root mean square over the last half of the curve [Pa].
double scatter(const std::vector<std::vector<double>>& curves) {
  const std::vector<double> mean = mean_of(curves);
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t k = mean.size() / 2; k < mean.size(); ++k)
    for (const auto& c : curves) {
      sum += (c[k] - mean[k]) * (c[k] - mean[k]);
      ++count;
    }
  const double n = static_cast<double>(curves.size());
  return std::sqrt(sum / static_cast<double>(count) * n / (n - 1.0));
}

double late_mean(const std::vector<double>& curve) {
  double sum = 0.0;
  for (std::size_t k = curve.size() / 2; k < curve.size(); ++k) sum += curve[k];
  return sum / static_cast<double>(curve.size() - curve.size() / 2);
}

void print(const char* what, const std::vector<double>& curve) {
  std::cout << "  " << what << " [Pa]:";
  for (std::size_t k = 0; k < curve.size(); k += 5) std::cout << " " << std::lround(curve[k]);
  std::cout << "\n";
}

TEST(DirectShearClaims, SlowerThanThePapersRateTheCurveStays) {
  constexpr int seeds = 3;
  DirectShearSettings s;
  s.normal_stress = 17830;
  s.travel = 1.65e-3;
  s.samples = 30;
  s.time_step = 8e-6;
  s.rate = 0.66e-3;
  const auto paper = repeats(s, seeds);
  s.rate = 0.33e-3;
  const auto slower = repeats(s, seeds);
  const std::vector<double> a = mean_of(paper), b = mean_of(slower);
  print("0.66 mm/s", a);
  print("0.33 mm/s", b);
  const double between = std::max(scatter(paper), scatter(slower));
  double distance = 0.0;
  for (std::size_t k = a.size() / 2; k < a.size(); ++k) distance += (a[k] - b[k]) * (a[k] - b[k]);
  distance = std::sqrt(distance / static_cast<double>(a.size() - a.size() / 2));
  std::cout << "  means differ by " << distance << " Pa (root mean square), seeds scatter by " << between << " Pa\n";
  EXPECT_LT(distance, between);
  EXPECT_LT(distance, 0.1 * late_mean(a));  // far below the scatter of seeds, a quarter here
  EXPECT_GT(late_mean(a), 0.2 * s.normal_stress);
}

TEST(DirectShearClaims, AWideRangeOfSizesRepeatsBetterThanFewLargeGrains) {
  constexpr int seeds = 8;
  DirectShearSettings s;
  s.normal_stress = 17830;
  s.travel = 4e-3;
  s.samples = 40;
  s.rate = 5e-3;
  s.time_step = 8e-6;
  const auto wide = repeats(s, seeds);
  s.soil.sizes.smallest = 12e-3;
  s.soil.sizes.largest = 13e-3;
  s.time_step = 2e-5;
  const auto large = repeats(s, seeds);
  print("2.5 to 10 mm", mean_of(wide));
  print("12 to 13 mm", mean_of(large));
  const double w = scatter(wide) / late_mean(mean_of(wide)), l = scatter(large) / late_mean(mean_of(large));
  std::cout << "  deviation between seeds over mean stress: " << w << " from 2.5 to 10 mm, " << l << " from 12 to 13 mm\n";
  EXPECT_LT(w, l);
  std::filesystem::remove_all(folder());
}

}  // namespace
}  // namespace terrode::dem
