#include "vehicle/frame_recorder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "terrain/node_spring.h"
#include "wheel/wheel.h"

namespace terrode::vehicle {
namespace {

// The default soil: the one of Smith et al., Table 1.
terrain::NodeSpringParams soft_ground() {
  terrain::NodeSpringParams p;
  p.spacing = 0.01;
  return p;
}

TEST(FrameRecorder, ShowsTheRutThatTheRigLeaves) {
  RigSpec spec;
  spec.normal_load = 80.0;
  RigMotion motion;
  motion.slip = 0.3;
  motion.distance = 0.1;
  wheel::WheelShape shape;
  Rig rig(spec, motion, std::make_shared<wheel::Wheel>(shape), std::make_unique<terrain::NodeSpringTerrain>(soft_ground()));
  std::optional<FrameRecorder> recorder;
  rig.set_observer([&](Rig& r) {
    if (!recorder) recorder.emplace(frame_settings(r, 10));
    recorder->observe(r.last().time, r.simulation());
  });
  const recording::Run run = rig.run();
  Rig unseen(spec, motion, std::make_shared<wheel::Wheel>(shape), std::make_unique<terrain::NodeSpringTerrain>(soft_ground()));
  EXPECT_EQ(unseen.run().find("drawbar_pull")->values, run.find("drawbar_pull")->values) << "looking changes nothing";
  ASSERT_TRUE(recorder);
  EXPECT_GE(recorder->count(), 10u);
  EXPECT_LE(recorder->count(), 12u);
  const auto& layout = recorder->layout();
  ASSERT_TRUE(layout.ground);
  EXPECT_DOUBLE_EQ(layout.bodies.at(0).radius, shape.radius);

  const recording::Frame& last = recorder->frames().back();
  double deepest = 0.0, pressed = 0.0;
  for (std::size_t i = 0; i < last.height.size(); ++i) {
    deepest = std::max(deepest, static_cast<double>(layout.ground->undisturbed[i] - last.height[i]));
    pressed = std::max(pressed, static_cast<double>(last.pressure[i]));
  }
  // The rut is about as deep as the wheel sinks: the frames show the same ground as the channels.
  const double sinkage = run.find("sinkage")->values.back();
  EXPECT_NEAR(deepest, sinkage, 0.25 * sinkage);
  EXPECT_GT(pressed, 0.0);
  EXPECT_NEAR(last.bodies.at(0).soil.F_W.z(), 80.0, 8.0) << "the ground carries the load";

  const auto path = std::filesystem::temp_directory_path() / ("terrode-recorder-" + std::to_string(getpid()) + ".h5");
  {
    auto file = recording::Hdf5File::create(path.string());
    recorder->write(file);
    file.close();
  }
  const auto file = recording::Hdf5File::open(path.string());
  EXPECT_EQ(recording::FrameReader(file).count(), recorder->count());
  std::filesystem::remove(path);
}

TEST(FrameRecorder, RefusesAnEmptyStretch) {
  FrameSettings s;
  s.interval = 0.0;
  EXPECT_EQ(s.validate().size(), 3u);
  EXPECT_THROW(FrameRecorder{s}, InputError);
}

}  // namespace
}  // namespace terrode::vehicle
