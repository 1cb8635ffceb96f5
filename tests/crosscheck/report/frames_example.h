// A small run with known numbers: a wheel moves 0.1 m a frame, the node under it goes 10 mm deeper with each.
#pragma once

#include <cmath>

#include "recording/frames.h"

namespace terrode::report {

inline void write_example(recording::Hdf5File& file, int frames, bool with_particles) {
  recording::FrameLayout layout;
  recording::FrameBody wheel;
  wheel.name = "wheel";
  wheel.radius = 0.13;
  wheel.width = 0.16;
  wheel.grouser_count = 12;
  wheel.grouser_height = 0.01;
  wheel.grouser_thickness = 0.004;
  layout.bodies = {wheel};
  recording::FrameGround ground;
  ground.x0 = -0.5, ground.y0 = -0.25, ground.spacing = 0.05;
  ground.columns = 21, ground.rows = 11;
  ground.undisturbed.assign(21 * 11, 0.0f);
  ground.pressure = true;
  layout.ground = ground;
  if (with_particles) {
    recording::FrameParticles grains;
    for (int i = 0; i < 50; ++i) grains.radius.push_back(0.002f + 0.0001f * static_cast<float>(i % 10));
    grains.low = Vec3(-1, -1, -1);
    grains.high = Vec3(1, 1, 1);
    layout.particles = grains;
  }
  recording::FrameWriter writer(file, layout);
  for (int k = 0; k < frames; ++k) {
    recording::Frame f;
    f.time = k * 0.1;
    recording::FrameBodyState state;
    state.pose.p_W = Vec3(0.1 * k, 0.0, 0.12);
    state.pose.R_WB = Quat(Eigen::AngleAxisd(0.5 * k, Vec3::UnitY()));
    state.soil.F_W = Vec3(10.0, 0.0, 80.0);
    f.bodies = {state};
    f.height.assign(21 * 11, 0.0f);
    f.height[5 * 21 + 10] = -0.01f * static_cast<float>(k);
    f.pressure.assign(21 * 11, 0.0f);
    f.pressure[5 * 21 + 10] = 1e4f;
    if (with_particles)
      for (int i = 0; i < 50; ++i) {
        f.position.push_back(0.01f * static_cast<float>(i));
        f.position.push_back(0.002f * static_cast<float>(i % 7));
        f.position.push_back(-0.02f + 0.001f * static_cast<float>(i % 3) + 0.001f * static_cast<float>(k));
      }
    writer.append(f);
  }
}

}  // namespace terrode::report
