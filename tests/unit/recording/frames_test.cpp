#include "recording/frames.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace terrode::recording {
namespace {

class Frames : public testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::temp_directory_path() /
            ("terrode-frames-" + std::to_string(getpid()) + "-" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".h5");
  }
  void TearDown() override { std::filesystem::remove(path_); }
  std::filesystem::path path_;
};

FrameLayout layout() {
  FrameLayout l;
  FrameBody wheel;
  wheel.name = "wheel";
  wheel.radius = 0.13;
  wheel.width = 0.16;
  wheel.grouser_count = 12;
  wheel.grouser_height = 0.01;
  wheel.grouser_thickness = 0.003;
  FrameBody box;
  box.name = "a_body";  // before "wheel" in the alphabet, after it in order
  box.shape = FrameBody::Shape::box;
  box.size = Vec3(0.4, 0.3, 0.1);
  l.bodies = {wheel, box};
  FrameGround g;
  g.x0 = -0.1, g.y0 = -0.05, g.spacing = 0.05;
  g.columns = 5, g.rows = 3;
  g.undisturbed.assign(15, 0.0f);
  g.pressure = true;
  l.ground = g;
  FrameParticles p;
  p.radius = {0.002f, 0.003f};
  p.low = Vec3(-1, -2, -3);
  p.high = Vec3(1, 2, 3);
  p.periodic = {false, true, false};
  p.velocity = true;
  l.particles = p;
  return l;
}

Frame frame(double t) {
  Frame f;
  f.time = t;
  f.bodies.resize(2);
  f.bodies[0].pose.p_W = Vec3(t, 0.0, 0.125);
  f.bodies[0].pose.R_WB = Quat(Eigen::AngleAxisd(t, Vec3::UnitY()));
  f.bodies[0].soil.F_W = Vec3(10.0, 0.0, 80.0);
  f.bodies[0].soil.M_W = Vec3(0.0, -2.0, 0.0);
  f.height.assign(15, 0.0f);
  f.height[7] = static_cast<float>(-0.01 * t);
  f.pressure.assign(15, 0.0f);
  f.pressure[7] = 1e4f;
  f.position = {0.0f, 0.0f, static_cast<float>(t), 0.25f, 0.5f, 0.75f};
  f.velocity = {0, 0, 1, 0, 0, 0};
  return f;
}

TEST_F(Frames, ComeBackAsWritten) {
  {
    Hdf5File file = Hdf5File::create(path_.string());
    FrameWriter writer(file, layout());
    file.start_appending();
    for (double t : {0.0, 0.5, 1.0}) writer.append(frame(t));
    file.close();
  }
  const Hdf5File file = Hdf5File::open(path_.string());
  const FrameReader reader(file);
  EXPECT_EQ(reader.times(), (std::vector<double>{0.0, 0.5, 1.0}));
  ASSERT_EQ(reader.layout().bodies.size(), 2u);
  EXPECT_EQ(reader.layout().bodies[0].name, "wheel");
  EXPECT_EQ(reader.layout().bodies[0].grouser_count, 12);
  EXPECT_EQ(reader.layout().bodies[1].size, Vec3(0.4, 0.3, 0.1));
  EXPECT_EQ(reader.layout().ground->columns, 5u);
  EXPECT_EQ(reader.layout().ground->rows, 3u);
  EXPECT_DOUBLE_EQ(reader.layout().ground->spacing, 0.05);
  EXPECT_TRUE(reader.layout().particles->periodic[1]);
  EXPECT_EQ(reader.layout().particles->high, Vec3(1, 2, 3));
  const Frame wanted = frame(0.5), got = reader.read(1);
  constexpr double kFloat = 1e-6;  // stored with seven digits
  EXPECT_TRUE(got.bodies[0].pose.p_W.isApprox(wanted.bodies[0].pose.p_W, kFloat));
  EXPECT_LT(got.bodies[0].pose.R_WB.angularDistance(wanted.bodies[0].pose.R_WB), kFloat);
  EXPECT_TRUE(got.bodies[0].soil.M_W.isApprox(wanted.bodies[0].soil.M_W, kFloat));
  EXPECT_EQ(got.height, wanted.height);
  EXPECT_EQ(got.pressure, wanted.pressure);
  EXPECT_EQ(got.position, wanted.position);
  EXPECT_EQ(got.velocity, wanted.velocity);
  EXPECT_THROW(reader.read(3), InputError);
}

TEST_F(Frames, AreReadAsTheDocumentSays) {
  if (std::system("/usr/bin/python3 -c 'import h5py' 2>/dev/null") != 0) GTEST_SKIP() << "python3-h5py is not installed";
  {
    Hdf5File file = Hdf5File::create(path_.string());
    FrameWriter writer(file, layout());
    for (double t : {0.0, 0.5, 1.0}) writer.append(frame(t));
    file.close();
  }
  // The lines of the document, with the file's own name.
  std::ifstream in(std::string(TERRODE_SOURCE_DIR) + "/docs/formats-frames.md");
  std::string code;
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    if (line == "```python") inside = true;
    else if (line == "```") inside = false;
    else if (inside) code += line + "\n";
  }
  ASSERT_FALSE(code.empty());
  code.replace(code.find("run.h5"), 6, path_.string());
  code += "    assert abs(rut[1, 2] - 0.01) < 1e-7 and abs(axle - t).max() < 1e-6\n"
          "    assert list(f['/h5md'].attrs['version']) == [1, 1]\n"
          "    assert [b.decode() if isinstance(b, bytes) else b for b in f['/particles/soil/box/boundary'][:]] == ['none', 'periodic', 'none']\n"
          "    assert f['/particles/soil/position/value'].shape == (3, 2, 3)\n";
  const auto script = path_.string() + ".py";
  std::ofstream(script) << code;
  EXPECT_EQ(std::system(("/usr/bin/python3 " + script).c_str()), 0);
  std::filesystem::remove(script);
}

TEST_F(Frames, WrongLayoutsAndFramesAreRefused) {
  FrameLayout bad;
  EXPECT_EQ(bad.validate().size(), 1u);
  bad = layout();
  bad.bodies[0].name = "a/b";
  bad.bodies[0].radius = -1.0;
  bad.ground->undisturbed.pop_back();
  bad.particles->radius[0] = 0.0f;
  EXPECT_EQ(bad.validate().size(), 4u) << "every problem is named";

  Hdf5File file = Hdf5File::create(path_.string());
  EXPECT_THROW(FrameWriter(file, bad), InputError);
  FrameWriter writer(file, layout());
  writer.append(frame(1.0));
  EXPECT_THROW(writer.append(frame(1.0)), InputError) << "time must rise";
  Frame f = frame(2.0);
  f.height[0] = std::nanf("");
  EXPECT_THROW(writer.append(f), InputError);
  f = frame(2.0);
  f.position.pop_back();
  EXPECT_THROW(writer.append(f), InputError);
  EXPECT_EQ(writer.count(), 1u);
}

TEST_F(Frames, FilesWithoutFramesAreRefused) {
  Hdf5File file = Hdf5File::create(path_.string());
  EXPECT_FALSE(FrameReader::has_frames(file));
  EXPECT_THROW(FrameReader{file}, InputError);
}

}  // namespace
}  // namespace terrode::recording
