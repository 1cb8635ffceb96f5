// The published plate and shear tests as docs/calibration.md tells of them; skipped where they are not beside the project.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "calibration/soil_tests.h"
#include "scenario/recording_file.h"

namespace terrode::calibration {
namespace {

namespace fs = std::filesystem;

fs::path sources() {
  for (fs::path at = fs::path(TERRODE_SOURCE_DIR); at.has_relative_path(); at = at.parent_path())
    if (fs::exists(at.parent_path() / "shared" / "recordings")) return at.parent_path() / "shared" / "recordings";
  return {};
}

// The published sets as recordings, made once.
class PublishedSoils : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (sources().empty()) return;
    folder_ = fs::temp_directory_path() / ("terrode_published_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    const std::string command = "python3 '" + std::string(TERRODE_SOURCE_DIR) + "/tools/bevameter_recordings' '" + sources().string() + "' '" + folder_.string() + "' > /dev/null 2>&1";
    if (std::system(command.c_str()) != 0) fs::remove_all(folder_);
  }
  static void TearDownTestSuite() {
    if (!folder_.empty()) fs::remove_all(folder_);
  }
  static bool there(const std::string& name) { return !folder_.empty() && fs::exists(folder_ / name); }
  static fs::path folder_;
};
fs::path PublishedSoils::folder_;

bool surely_negative(const Estimate& e) { return e.high < 0; }

TEST_F(PublishedSoils, PavlovsSandHasANegativeCohesiveModulus) {
  const fs::path folder = sources() / "cmu-pavlov-single-wheel";
  if (sources().empty() || !fs::exists(folder)) GTEST_SKIP() << "no shared recordings here";
  const recording::Recording r = scenario::load_recording(folder.string());
  const ModuliFit fit = fit_bekker_moduli(r.pressure_sinkage);
  EXPECT_TRUE(surely_negative(*fit.find("kc")));
  EXPECT_NEAR(fit.value("n"), 1.43, 0.05);
  // The modulus grows with the plate: at the same sinkage the larger one meets more pressure.
  for (std::size_t i = 1; i < fit.plates.size(); ++i) EXPECT_GT(fit.plates[i].modulus, fit.plates[i - 1].modulus);
  EXPECT_TRUE(std::any_of(fit.warnings.begin(), fit.warnings.end(), [](const Warning& w) { return w.id == "negative" && w.parameter == "kc"; }));
}

TEST_F(PublishedSoils, Grc1HasTheOppositeTrendAndWongsWayIsNearThePublishedFit) {
  if (!there("grc1")) GTEST_SKIP() << "no shared recordings here";
  const recording::Recording r = scenario::load_recording((folder_ / "grc1").string());
  const ModuliFit fit = fit_bekker_moduli(r.pressure_sinkage);
  // Oravec (2009): n = 0.806, kc = 9.7e4, kphi = 1.74e6, with weights.
  EXPECT_NEAR(fit.wong_n, 0.806, 0.05);
  EXPECT_NEAR(fit.wong_kc, 9.7e4, 0.5 * 9.7e4);
  EXPECT_NEAR(fit.wong_kphi, 1.74e6, 0.2 * 1.74e6);
  EXPECT_LT(fit.find("kc")->low, 0);
  EXPECT_GT(fit.find("kc")->high, 0);
}

TEST_F(PublishedSoils, Kls1AgreesWithThePublishedValuesWithinItsIntervals) {
  if (!there("kls1")) GTEST_SKIP() << "no shared recordings here";
  const recording::Recording r = scenario::load_recording((folder_ / "kls1").string());
  const ModuliFit fit = fit_bekker_moduli(r.pressure_sinkage);
  // Lim et al. (2021).
  for (const auto& [name, published] : {std::pair{"n", 1.259}, std::pair{"kc", -4.41e4}, std::pair{"kphi", 3.58e6}}) {
    EXPECT_LE(fit.find(name)->low, published) << name;
    EXPECT_GE(fit.find(name)->high, published) << name;
  }
}

TEST_F(PublishedSoils, CullinanSandsDensityAloneChangesTheShearModulus) {
  if (!there("cullinan_shear")) GTEST_SKIP() << "no shared recordings here";
  const recording::Recording r = scenario::load_recording((folder_ / "cullinan_shear").string());
  SoilTestOptions o;
  o.maximum_shear_displacement = 0.04;
  const ShearFit fit = fit_direct_shear(r.direct_shear, o);
  EXPECT_FALSE(fit.find("cohesion")->identified);  // one normal stress
  double least = 1e9, most = 0;
  for (const TestCurve& c : fit.curves) least = std::min(least, c.own_shape), most = std::max(most, c.own_shape);
  EXPECT_GT(most, 2.5 * least);
  // Relaxation at stops is no unloading.
  const recording::Recording plates = scenario::load_recording((folder_ / "cullinan_densest").string());
  EXPECT_TRUE(fit_unloading(plates.pressure_sinkage).loops.empty());
}

}  // namespace
}  // namespace terrode::calibration
