// A wheel on particles from a scenario: touchdown, and points of a sweep that go on from where they were kept.
#include "scenario/dem_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "scenario/methods.h"

namespace terrode::scenario {
namespace {

// A few hundred grains, settled for this test alone.
Scenario small_wheel_on_grains() {
  static const std::string cache = (std::filesystem::temp_directory_path() / ("terrode_dem_file_" + std::to_string(::getpid()))).string();
  setenv("TERRODE_CACHE", cache.c_str(), 1);
  return parse_scenario(
      "wheel: {radius: 40 mm, width: 25 mm, mass: 0.1 kg}\n"
      "soil: {bekker: {cohesion: 0, friction_angle: 30 deg, shear_modulus: 10 mm, n: 1, k: 10 kPa, plate_width: 50 mm}}\n"
      "rig: {normal_load: 3 N, angular_velocity: 2, travel: 2 mm, ramp: 0.02}\n"
      "particles: {smallest: 7 mm, largest: 8 mm, prism: 36 mm, depth: 24 mm, width: 36 mm, window_ahead: 36 mm, window_behind: 30 mm,\n"
      "            time_step_fraction: 0.25}\n",
      "small.yaml");
}

TEST(Grains, CarryTheWheelAndPointsGoOnFromWhereTheyWereKept) {
  const Scenario s = small_wheel_on_grains();
  const recording::Condition at = condition_of(s.operating_points({0.3}).front(), s.wheel.radius);
  std::vector<std::shared_ptr<const recording::Checkpoint>> kept;
  std::size_t before_the_run = 0;
  int forgotten = 0;
  MethodSettings settings;
  settings.memory.interval = 0.0;
  settings.memory.save = [&](const recording::Condition&, const recording::Checkpoint& c) {
    kept.push_back(std::make_shared<recording::Checkpoint>(c));
    if (c.number("rig").front() < 2.0) before_the_run = kept.size();
  };
  settings.memory.forget = [&](const recording::Condition&) { ++forgotten; };
  const auto whole = make_method("dem", s, settings).run(at, {}).run;
  EXPECT_EQ(forgotten, 1);
  ASSERT_GT(whole.time.size(), 5u);
  double load = 0.0;
  for (const double v : whole.find(recording::channel::normal_load)->values) load += v / static_cast<double>(whole.time.size());
  EXPECT_NEAR(load, 3.0, 0.5);  // it neither falls nor flies
  ASSERT_GT(before_the_run, 10u);
  ASSERT_GT(kept.size(), before_the_run + 3);
  for (const std::size_t n : {before_the_run / 2, before_the_run - 1, before_the_run + 2}) {
    MethodSettings on;
    on.memory.load = [&](const recording::Condition&) { return kept[n]; };
    const auto rest = make_method("dem", s, on).run(at, {}).run;
    EXPECT_EQ(rest.time, whole.time) << n;
    for (std::size_t c = 0; c < whole.channels.size(); ++c)
      EXPECT_EQ(rest.channels[c].values, whole.channels[c].values) << n << " " << whole.channels[c].name;
  }
}

TEST(Grains, ASliceIsOnePrismAcrossAndAsDenseAsItSettled) {
  Scenario s = small_wheel_on_grains();
  s.particles.prism = 0.06;
  s.particles.prism_across = 0.024;
  s.particles.width = 0.024;
  s.particles.settling_friction = 0.05;
  s.particles.settling_rolling_friction = 0.0;
  const dem::DemTerrainParams slice = particle_params(s);
  EXPECT_EQ(slice.tiles_y, 1);
  EXPECT_DOUBLE_EQ(slice.prism.width, 0.06);   // along the travel
  EXPECT_DOUBLE_EQ(slice.prism.length, 0.024);  // across
  EXPECT_DOUBLE_EQ(slice.soil.friction, s.particles.friction);
  EXPECT_DOUBLE_EQ(slice.soil.rolling_friction, s.particles.rolling_friction);
  EXPECT_EQ(slice.settling_friction, 0.05);
  Scenario loose = s;
  loose.particles.settling_friction = loose.particles.settling_rolling_friction = std::nullopt;
  EXPECT_GT(slice.prism.solid_fraction, particle_params(loose).prism.solid_fraction + 0.02);
  const Scenario again = parse_scenario(to_yaml(s), "again.yaml");
  EXPECT_EQ(again.particles.prism_across, s.particles.prism_across);
  EXPECT_EQ(again.particles.settling_friction, s.particles.settling_friction);
  EXPECT_EQ(again.particles.settling_rolling_friction, s.particles.settling_rolling_friction);
  s.particles.width.reset();
  EXPECT_GE(particle_params(s).tiles_y, 2);
}

}  // namespace
}  // namespace terrode::scenario
