// Files of soil tests on particles: what is read, what is refused, what is run; results do not depend on threads.
#include "scenario/particle_tests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace terrode::scenario {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr const char* small = R"(title: small
seed: 7
particle_tests:
  repeats: 2
  time_step: 10 us
  grains:
    smallest: 5 mm
    largest: 7 mm
    bulk_density: 1.5 g/cm^3
  direct_shear:
    width: 40 mm
    length: 40 mm
    height: 20 mm
    normal_stress: [2 kPa]
    rate: 100 mm/s
    travel: 1 mm
    seating: 10 ms
    samples: 5
)";

std::string problem_of(const std::string& text) {
  try {
    parse_particle_tests(text, "f.yaml");
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

TEST(ParticleTests, ReadsValuesWithUnitsAndKeepsThePapersDefaults) {
  const ParticleTests t = parse_particle_tests(small, "f.yaml");
  EXPECT_EQ(t.seed, 7);
  EXPECT_EQ(t.repeats, 2);
  EXPECT_NEAR(t.time_step, 1e-5, 1e-18);
  EXPECT_NEAR(t.grains.smallest, 5e-3, 1e-15);
  EXPECT_NEAR(t.grains.bulk_density, 1500, 1e-9);
  EXPECT_EQ(t.grains.friction, 0.86);
  ASSERT_TRUE(t.direct_shear);
  EXPECT_EQ(t.direct_shear->normal_stress, std::vector<double>{2000});
  EXPECT_FALSE(t.pressure_sinkage);
  const ParticleTests paper = parse_particle_tests("particle_tests: {direct_shear: {}, pressure_sinkage: {}}", "f.yaml");
  EXPECT_EQ(paper.direct_shear->normal_stress, (std::vector<double>{2080, 5330, 17830}));
  EXPECT_EQ(paper.direct_shear->rate, std::vector<double>{0.66e-3});
  EXPECT_EQ(paper.pressure_sinkage->plate_length, 0.13);
  EXPECT_EQ(planned(paper).size(), 4u);
}

TEST(ParticleTests, WritesWhatItReads) {
  const ParticleTests t = parse_particle_tests(small, "f.yaml");
  const ParticleTests again = parse_particle_tests(to_yaml(t), "g.yaml");
  EXPECT_EQ(to_yaml(again), to_yaml(t));
  EXPECT_EQ(again.direct_shear->travel, t.direct_shear->travel);
  const auto schema = nlohmann::json::parse(particle_tests_schema());
  const auto& keys = schema["properties"]["particle_tests"]["properties"];
  EXPECT_TRUE(keys["grains"]["properties"].contains("rolling_rate"));
  EXPECT_TRUE(keys["direct_shear"]["properties"].contains("normal_stress"));
}

// A bed that settled with little friction must dilate to be sheared: it is several times as stiff.
TEST(ParticleTests, ABedThatSettledSmoothIsSheared) {
  const auto cache = fs::temp_directory_path() / ("terrode_dense_tests_" + std::to_string(::getpid()));
  ::setenv("TERRODE_CACHE", cache.c_str(), 1);
  ParticleTests t = parse_particle_tests(small, "f.yaml");
  t.repeats = 1;
  const double loose = run_particle_tests(t, {}, 1, {}, {}).front().y.back();
  t.grains.settling_friction = 0.05;
  t.grains.settling_rolling_friction = 0.0;
  const ParticleTests written = parse_particle_tests(to_yaml(t), "g.yaml");
  const double dense = run_particle_tests(written, {}, 1, {}, {}).front().y.back();
  EXPECT_GT(loose, 0.0);
  EXPECT_GT(dense, 3.0 * loose);
  fs::remove_all(cache);
}

TEST(ParticleTests, SaysWhatIsWrongAndWhere) {
  EXPECT_THAT(problem_of("particle_tests: {}"), HasSubstr("holds no test"));
  EXPECT_THAT(problem_of("particle_tests:\n  direct_shear:\n    rates: 1\n"), HasSubstr("f.yaml:3:5: particle_tests.direct_shear.rates"));
  EXPECT_THAT(problem_of("particle_tests:\n  direct_shear:\n    travel: 50 mm\n"), HasSubstr("f.yaml:3:13: particle_tests.direct_shear.travel"));
  EXPECT_THAT(problem_of("particle_tests:\n  grains: {smallest: 12 mm}\n  direct_shear: {}\n"), HasSubstr("particle_tests.grains.largest"));
  EXPECT_THAT(problem_of("particle_tests:\n  grains: {rolling: epsd3}\n  direct_shear: {}\n"), HasSubstr("epsd2"));
  EXPECT_THAT(problem_of("seed: 1\n"), HasSubstr("particle_tests"));
}

TEST(ParticleTests, RunsTheSameOnAnyNumberOfThreadsAndGoesOnWithWhatIsKnown) {
  const fs::path cache = fs::temp_directory_path() / ("terrode_particle_tests_" + std::to_string(::getpid()));
  ::setenv("TERRODE_CACHE", cache.c_str(), 1);
  const ParticleTests t = parse_particle_tests(small, "f.yaml");
  std::size_t calls = 0;
  const auto one = run_particle_tests(t, {}, 1, {}, [&](const std::vector<ParticleTest>& ended) { EXPECT_EQ(ended.size(), ++calls); });
  const auto two = run_particle_tests(t, {}, 2, {});
  ASSERT_EQ(one.size(), 2u);
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(calls, 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(one[k].error, "");
    EXPECT_EQ(one[k].x.size(), 6u);
    EXPECT_EQ(one[k].y, two[k].y);
  }
  EXPECT_NE(one[0].y, one[1].y);
  const auto again = run_particle_tests(t, {one[1]}, 1, {}, [&](const std::vector<ParticleTest>&) { ++calls; });
  EXPECT_EQ(calls, 3u);  // the other one only
  EXPECT_EQ(again[1].y, one[1].y);
  EXPECT_EQ(again[0].y, one[0].y);
  const auto means = mean_curves(one);
  ASSERT_EQ(means.size(), 1u);
  EXPECT_EQ(means[0].repeats, 2);
  EXPECT_NEAR(means[0].curve.mean[3], 0.5 * (one[0].y[3] + one[1].y[3]), 1e-9);
  EXPECT_EQ(as_recording(t, one).direct_shear.size(), 2u);
  Progress stopped;
  stopped.stop_requested = [] { return true; };
  EXPECT_THROW(run_particle_tests(t, {}, 1, stopped), Interrupted);
  fs::remove_all(cache);
}

}  // namespace
}  // namespace terrode::scenario
