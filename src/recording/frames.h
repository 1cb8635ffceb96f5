// Pictures of a run at a series of moments: where the bodies are and what the soil does to them, the shape of the
// ground, the particles. Layout on disk: docs/formats-frames.md. A viewer or an export reads them back.
//
// World axes, SI. Values are stored as 32-bit floats: seven digits, which is what a picture needs; the exact series of
// a run lie beside, under /run.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/frames.h"
#include "core/problem.h"
#include "recording/hdf5_file.h"

namespace terrode::recording {

// A body to be drawn: a wheel about its own y axis, a box, or a ball.
struct FrameBody {
  enum class Shape { wheel, box, sphere };
  std::string name;                  // letters, digits, "_" and "-"
  Shape shape = Shape::wheel;
  double radius = 0.0;               // m, of a wheel's rim without lugs, of a sphere
  double width = 0.0;                // m, of a wheel
  int grouser_count = 0;
  double grouser_height = 0.0;       // m
  double grouser_thickness = 0.0;    // m
  Vec3 size = Vec3::Zero();          // m, edges of a box
};

// The ground as heights over a grid: node (i, j) lies at (x0 + i spacing, y0 + j spacing).
struct FrameGround {
  double x0 = 0.0, y0 = 0.0, spacing = 0.0;  // m
  std::size_t columns = 0, rows = 0;         // along x, along y
  std::vector<float> undisturbed;            // m, row by row (x runs fastest); columns * rows values
  bool pressure = false;                     // frames carry the normal stress at each node
};

struct FrameParticles {
  std::vector<float> radius;                 // m, one each
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  // m, the box they live in
  std::array<bool, 3> periodic{false, false, false};
  bool velocity = false;                     // frames carry velocities
};

// What all frames of a run have in common.
struct FrameLayout {
  std::vector<FrameBody> bodies;
  std::optional<FrameGround> ground;
  std::optional<FrameParticles> particles;

  // Every problem: names that cannot be a path, sizes that do not fit, nothing to show.
  Problems validate() const;
};

struct FrameBodyState {
  Pose pose;
  Wrench soil;                       // of the ground on the body, moment about the body's origin
};

struct Frame {
  double time = 0.0;                 // s
  std::vector<FrameBodyState> bodies;
  std::vector<float> height;         // m, like FrameGround::undisturbed
  std::vector<float> pressure;       // Pa, 0 where nothing presses
  std::vector<float> position;       // m, x y z of each particle
  std::vector<float> velocity;       // m/s
};

// Lays out /frames (and /particles, /h5md by H5MD 1.1) in an open file and then only appends, as files that grow in time
// want it: make the writer, call Hdf5File::start_appending(), then append() and flush().
class FrameWriter {
 public:
  // Throws InputError with every problem of the layout. The file must outlive the writer.
  FrameWriter(Hdf5File& file, FrameLayout layout);

  // Throws InputError when the frame does not fit the layout, holds a number that is not finite, or is not later than
  // the last one.
  void append(const Frame& frame);

  std::size_t count() const { return count_; }
  const FrameLayout& layout() const { return layout_; }

 private:
  Hdf5File* file_;
  FrameLayout layout_;
  std::size_t count_ = 0;
  double last_time_ = 0.0;
};

// Reads frames one at a time, so that a long run need not fit into memory.
class FrameReader {
 public:
  // Throws InputError where the file has no frames or they are not as docs/formats-frames.md says.
  explicit FrameReader(const Hdf5File& file);

  static bool has_frames(const Hdf5File& file);

  const FrameLayout& layout() const { return layout_; }
  const std::vector<double>& times() const { return times_; }
  std::size_t count() const { return times_.size(); }
  Frame read(std::size_t index) const;

 private:
  const Hdf5File* file_;
  FrameLayout layout_;
  std::vector<double> times_;
};

}  // namespace terrode::recording
