// Ground as it lies before anything touches it: planes, functions, fractals, grids of heights.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/problem.h"
#include "terrain/surface.h"

namespace terrode::terrain {

// A plane through (0, 0, height) that climbs by tan(angle) towards the direction `azimuth` [rad, from x to y].
class SlopeSurface final : public Surface {
 public:
  SlopeSurface(double angle, double azimuth = 0.0, double height = 0.0);
  double height(double x, double y) const override { return height_ + gx_ * x + gy_ * y; }
  Eigen::Vector2d gradient(double, double) const override { return {gx_, gy_}; }

 private:
  double height_, gx_, gy_;
};

// Heights from a function; slopes by central differences over 2 `step`.
class FunctionSurface final : public Surface {
 public:
  explicit FunctionSurface(std::function<double(double x, double y)> height, double step = 1e-4)
      : height_(std::move(height)), step_(step) {}
  double height(double x, double y) const override { return height_(x, y); }
  Eigen::Vector2d gradient(double x, double y) const override {
    return {(height_(x + step_, y) - height_(x - step_, y)) / (2 * step_),
            (height_(x, y + step_) - height_(x, y - step_)) / (2 * step_)};
  }

 private:
  std::function<double(double, double)> height_;
  double step_;
};

// Self-affine rough ground: a sum of waves with random directions and phases, wavelengths spread evenly in their
// logarithm, amplitude ~ wavelength^hurst (a power spectrum of profiles ~ wavenumber^-(2 hurst + 1)). Unbounded, the same
// for the same seed on every machine up to the library's sine.
struct FractalParams {
  double rms_height = 0.01;         // [m]
  double hurst = 0.8;               // 0 rough to 1 smooth
  double longest = 2.0;             // [m] wavelength
  double shortest = 0.05;           // [m]
  int waves = 96;
  std::uint64_t seed = 1;

  Problems validate() const;
};
class FractalSurface final : public Surface {
 public:
  explicit FractalSurface(const FractalParams& params);
  double height(double x, double y) const override;
  Eigen::Vector2d gradient(double x, double y) const override;

 private:
  struct Wave {
    double kx, ky, phase, amplitude;
  };
  std::vector<Wave> waves_;
};

// Heights on a rectangular grid, bilinear between them, continued flat beyond its edges.
struct HeightGrid {
  int columns = 0, rows = 0;          // along x, along y
  double x0 = 0.0, y0 = 0.0;          // [m] of the first column and row
  double cell = 1.0;                  // [m]
  std::vector<double> heights;        // [m], row by row from y0 up

  Problems validate() const;
};
class GridSurface final : public Surface {
 public:
  explicit GridSurface(HeightGrid grid);
  double height(double x, double y) const override;
  Eigen::Vector2d gradient(double x, double y) const override;
  const HeightGrid& grid() const { return grid_; }

 private:
  HeightGrid grid_;
};

// Reads a grey PNG of 8 or 16 bits: black lies at `black`, white at `white` [m], a pixel is `cell` wide; the image's
// lower left pixel is at (x0, y0), its upper edge towards +y. Throws InputError naming the file and what is wrong.
HeightGrid read_png_heights(const std::string& path, double cell, double black, double white, double x0 = 0.0, double y0 = 0.0);

// Reads an ESRI ASCII grid (ncols, nrows, xllcorner or xllcenter, yllcorner or yllcenter, cellsize, NODATA_value, rows
// from the top). Throws InputError naming file, line and what is wrong; missing values are refused.
HeightGrid read_ascii_heights(const std::string& path);

}  // namespace terrode::terrain
