#include "terrain/surfaces.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "terrain/node_grid.h"

namespace terrode::terrain {
namespace {

std::string scratch(const std::string& name) {
  return (std::filesystem::path(testing::TempDir()) / ("terrode_surfaces_" + name)).string();
}

void expect_gradient(const Surface& surface, double x, double y, double step, double close) {
  const Eigen::Vector2d g = surface.gradient(x, y);
  EXPECT_NEAR(g.x(), (surface.height(x + step, y) - surface.height(x - step, y)) / (2 * step), close);
  EXPECT_NEAR(g.y(), (surface.height(x, y + step) - surface.height(x, y - step)) / (2 * step), close);
}

TEST(Surfaces, SlopesClimbTowardsTheirAzimuth) {
  const SlopeSurface slope(0.2, std::acos(-1.0) / 2, 1.0);
  EXPECT_NEAR(slope.height(5, 0), 1.0, 1e-12);
  EXPECT_NEAR(slope.height(0, 2), 1.0 + 2 * std::tan(0.2), 1e-12);
  expect_gradient(slope, 1, 2, 1e-3, 1e-9);
  EXPECT_THROW(SlopeSurface(1.7), InputError);
}

TEST(Surfaces, FractalGroundHasItsHeightItsSlopeAndItsSeed) {
  FractalParams p;
  p.rms_height = 0.02;
  const FractalSurface a(p), same(p);
  p.seed = 2;
  const FractalSurface other(p);
  EXPECT_EQ(a.height(1.23, -4.5), same.height(1.23, -4.5));
  EXPECT_NE(a.height(1.23, -4.5), other.height(1.23, -4.5));
  double sum = 0, squares = 0;
  constexpr int n = 300;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double z = a.height(i * 0.217, j * 0.193);
      sum += z;
      squares += z * z;
    }
  const double rms = std::sqrt(squares / (n * n));
  constexpr double sampling = 0.1;  // 60 m of ground hold about thirty of the longest waves
  EXPECT_NEAR(rms, 0.02, sampling * 0.02);
  EXPECT_NEAR(sum / (n * n), 0.0, sampling * 0.02);
  expect_gradient(a, 0.3, 0.7, 1e-5, 1e-7);
  p.waves = 0;
  p.hurst = 3;
  EXPECT_EQ(p.validate().size(), 2u);
}

TEST(Surfaces, NodesKeepUnevenGroundAsItIs) {
  const auto surface = std::make_shared<FractalSurface>(FractalParams{});
  NodeGrid grid(0.01, surface);
  EXPECT_EQ(grid.surface_at({-40, 7}).z, surface->height(-0.4, 0.07));
  EXPECT_NEAR(grid.base(0.123, 0.456), surface->height(0.123, 0.456), 1e-4);  // bilinear over 10 mm of 50 mm waves
  EXPECT_EQ(grid.tile_count(), 0u);
}

TEST(Surfaces, AGreyPngIsAHeightfield) {
  for (const bool deep : {false, true}) {
    const std::string path = scratch(deep ? "16.png" : "8.png");
    // Two rows: upper 0 and full, lower a quarter and a half.
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = 2;
    image.height = 2;
    image.format = deep ? PNG_FORMAT_LINEAR_Y : PNG_FORMAT_GRAY;
    const png_byte low[4] = {0, 255, 64, 128};
    const png_uint_16 high[4] = {0, 65535, 16384, 32768};
    ASSERT_NE(png_image_write_to_file(&image, path.c_str(), 0, deep ? static_cast<const void*>(high) : low, 0, nullptr), 0);
    const GridSurface s(read_png_heights(path, 0.5, -1.0, 1.0, 10.0, 20.0));
    const double full = deep ? 65535.0 : 255.0, quarter = deep ? 16384 : 64;
    EXPECT_NEAR(s.height(10.0, 20.0), -1 + 2 * quarter / full, 1e-12);
    EXPECT_NEAR(s.height(10.0, 20.5), -1.0, 1e-12);
    EXPECT_NEAR(s.height(10.5, 20.5), 1.0, 1e-12);
    EXPECT_NEAR(s.height(10.25, 20.5), 0.0, 1e-12);
    EXPECT_NEAR(s.height(99.0, 99.0), 1.0, 1e-12);  // flat beyond the edge
    expect_gradient(s, 10.2, 20.3, 1e-4, 1e-9);
    std::filesystem::remove(path);
  }
  const std::string broken = scratch("broken.png");
  std::ofstream(broken) << "no picture";
  EXPECT_THROW(read_png_heights(broken, 0.5, 0, 1), InputError);
  EXPECT_THROW(read_png_heights(scratch("absent.png"), 0.5, 0, 1), InputError);
  EXPECT_THROW(read_png_heights(broken, -0.5, 0, 1), InputError);
  // A picture that breaks off.
  const std::string cut = scratch("cut.png");
  std::ofstream(cut, std::ios::binary).write("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\2", 20);
  EXPECT_THROW(read_png_heights(cut, 0.5, 0, 1), InputError);
  std::filesystem::remove(broken);
  std::filesystem::remove(cut);
}

TEST(Surfaces, AnAsciiGridIsAHeightfield) {
  const std::string path = scratch("grid.asc");
  std::ofstream(path) << "ncols 3\nnrows 2\nxllcorner 1\nyllcorner 2\ncellsize 2\nNODATA_value -9999\n1 2 3\n4 5 6\n";
  const GridSurface s(read_ascii_heights(path));
  EXPECT_NEAR(s.height(2, 3), 4.0, 1e-12);  // centre of the lower left cell
  EXPECT_NEAR(s.height(6, 5), 3.0, 1e-12);
  EXPECT_NEAR(s.height(3, 4), 3.0, 1e-12);
  std::ofstream(path) << "ncols 3\nnrows 2\ncellsize 2\nNODATA_value -9999\n1 2 -9999\n4 x 6\n";
  try {
    read_ascii_heights(path);
    FAIL();
  } catch (const InputError& e) {
    ASSERT_EQ(e.problems().size(), 2u);
    EXPECT_EQ(e.problems()[0].line, 5);
    EXPECT_EQ(e.problems()[1].line, 6);
  }
  std::ofstream(path) << "ncols 3\nnrows 2\ncellsize 2\n1 2 3\n";
  EXPECT_THROW(read_ascii_heights(path), InputError);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace terrode::terrain
