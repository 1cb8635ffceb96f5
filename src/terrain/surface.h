// The ground before anything touched it, as a height over the horizontal plane.
#pragma once

#include <memory>
#include <optional>

#include "core/frames.h"

namespace terrode::terrain {

class Surface {
 public:
  virtual ~Surface() = default;
  // Height [m] at (x, y) [m]; finite everywhere. The same arguments give the same bits.
  virtual double height(double x, double y) const = 0;
  // d(height)/d(x, y) [-].
  virtual Eigen::Vector2d gradient(double x, double y) const = 0;
  // The height where it is the same everywhere: such ground needs no memory until it is touched.
  virtual std::optional<double> level() const { return std::nullopt; }
};

// Unbounded level ground.
class LevelSurface final : public Surface {
 public:
  explicit LevelSurface(double height = 0.0) : height_(height) {}
  double height(double, double) const override { return height_; }
  Eigen::Vector2d gradient(double, double) const override { return Eigen::Vector2d::Zero(); }
  std::optional<double> level() const override { return height_; }

 private:
  double height_;
};

}  // namespace terrode::terrain
