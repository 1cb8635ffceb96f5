// Takes frames of a simulation at regular times: wheels, the force of the ground on them, the ground's surface and
// pressure on a grid, and its particles where it has any.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "recording/frames.h"
#include "vehicle/rig.h"
#include "vehicle/simulation.h"

namespace terrode::vehicle {

struct FrameSettings {
  double interval = 0.05;      // s between frames
  double x_min = 0.0, x_max = 0.0, y_min = 0.0, y_max = 0.0;  // m, the part of the ground that is kept
  double spacing = 0.005;      // m between its nodes
  std::vector<std::string> names;  // of the bodies on the ground, in their order; missing ones are numbered
  // Further bodies to be drawn, as boxes: they do not touch the ground.
  struct Box {
    std::string name;
    const multibody::Body* body = nullptr;
    Vec3 size = Vec3::Zero();  // m
  };
  std::vector<Box> boxes;

  Problems validate() const;
};

// The stretch that a rig will drive over, with half a wheel around it, at most 400 nodes along, and about `frames`
// frames over the whole run.
FrameSettings frame_settings(const Rig& rig, std::size_t frames);

// The rectangle that holds `path` and a machine about it, at most 400 nodes along its longer side; the machine's bodies
// and loose rocks.
class Vehicle;
FrameSettings frame_settings(Vehicle& vehicle, const std::vector<Eigen::Vector2d>& path, double duration, std::size_t frames);

// Frames are kept in memory until write(): a few hundred thousand numbers each.
class FrameRecorder {
 public:
  // Throws InputError with every problem.
  explicit FrameRecorder(const FrameSettings& settings);

  // Call between steps; takes a frame when `time` [s] has reached the next one. The first call takes one.
  void observe(double time, Simulation& simulation);

  std::size_t count() const { return frames_.size(); }
  // Bodies and ground; particles are laid out by write().
  const recording::FrameLayout& layout() const { return layout_; }
  const std::vector<recording::Frame>& frames() const { return frames_; }

  // All frames taken so far, for a checkpoint; a recorder of the same settings that takes them up goes on as if never
  // left. take_up() throws InputError for bytes of another recorder.
  std::vector<std::uint8_t> state() const;
  void take_up(const std::vector<std::uint8_t>& state, Simulation& simulation);

  // Writes /frames (and /particles) into an open file; particles that were laid on the way lie in earlier frames where
  // they were first seen. Throws RunError.
  void write(recording::Hdf5File& file) const;

 private:
  void lay_out(Simulation& simulation);

  FrameSettings settings_;
  recording::FrameLayout layout_;           // without particles: their number may grow until the end
  std::vector<recording::Frame> frames_;
  std::vector<float> radius_;               // m, of the particles so far
  double next_ = 0.0;
};

}  // namespace terrode::vehicle
