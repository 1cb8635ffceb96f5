#include "vehicle/frame_recorder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <optional>

#include "terrain/node_spring.h"
#include "terrain/particle_view.h"
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

// Three grains, a fourth once the wheel has moved 0.05 m; all rise by 1 mm a look.
class Grains final : public terrain::Terrain, public terrain::ParticleView {
 public:
  terrain::BodyId add_body(std::shared_ptr<const wheel::Body> shape) override { return ground_.add_body(std::move(shape)); }
  terrain::Sampling sampling() const override { return ground_.sampling(); }
  void begin_step(double t, double h) override { ground_.begin_step(t, h); }
  void set_motion(terrain::BodyId b, const Pose& p, const Twist& v) override { ground_.set_motion(b, p, v); }
  terrain::ContactResult wrench(terrain::BodyId b, const Pose& p, const Twist& v) override {
    x_ = p.p_W.x();
    return ground_.wrench(b, p, v);
  }
  void end_step() override { ground_.end_step(); }
  double height(double x, double y) const override { return ground_.height(x, y); }
  double undisturbed_height(double x, double y) const override { return ground_.undisturbed_height(x, y); }
  std::vector<std::uint8_t> snapshot() const override { return ground_.snapshot(); }
  void restore(std::span<const std::uint8_t> bytes) override { ground_.restore(bytes); }
  std::string name() const override { return "grains"; }
  void particles(std::vector<float>& position, std::vector<float>& radius) const override {
    const int n = x_ > 0.05 ? 4 : 3;
    for (int i = 0; i < n; ++i) {
      position.insert(position.end(), {0.1f * static_cast<float>(i), 0.0f, 0.001f * static_cast<float>(looks_)});
      radius.push_back(0.002f);
    }
    ++looks_;
  }

 private:
  terrain::NodeSpringTerrain ground_{soft_ground()};
  double x_ = 0.0;
  mutable int looks_ = 0;
};

TEST(FrameRecorder, ParticlesLaidOnTheWayLieWhereTheyWereFirstSeen) {
  RigSpec spec;
  RigMotion motion;
  motion.distance = 0.1;
  Rig rig(spec, motion, std::make_shared<wheel::Wheel>(wheel::WheelShape{}), std::make_unique<Grains>());
  std::optional<FrameRecorder> recorder;
  rig.set_observer([&](Rig& r) {
    if (!recorder) recorder.emplace(frame_settings(r, 5));
    recorder->observe(r.last().time, r.simulation());
  });
  rig.run();
  const auto path = std::filesystem::temp_directory_path() / ("terrode-grains-" + std::to_string(getpid()) + ".h5");
  {
    auto file = recording::Hdf5File::create(path.string());
    recorder->write(file);
    file.close();
  }
  const auto file = recording::Hdf5File::open(path.string());
  const recording::FrameReader reader(file);
  ASSERT_TRUE(reader.layout().particles);
  EXPECT_EQ(reader.layout().particles->radius.size(), 4u);
  const auto first = reader.read(0), last = reader.read(reader.count() - 1);
  ASSERT_EQ(first.position.size(), 12u);
  EXPECT_FLOAT_EQ(first.position[2], 0.0f);
  EXPECT_FLOAT_EQ(first.position[9], 0.3f) << "the fourth grain, not laid yet";
  EXPECT_GT(first.position[11], 0.0f) << "where it was first seen";
  EXPECT_LT(first.position[11], last.position[11]);
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
