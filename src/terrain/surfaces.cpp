#include "terrain/surfaces.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <numbers>
#include <sstream>

#include "core/random.h"
#include "core/units.h"

namespace terrode::terrain {

SlopeSurface::SlopeSurface(double angle, double azimuth, double height) : height_(height) {
  Problems p;
  require(p, "angle", angle, "rad", std::abs(angle) < 0.5 * std::numbers::pi, "a slope below 90 degrees");
  require(p, "azimuth", azimuth, "rad", true, "a direction");
  require(p, "height", height, "m", true, "a height");
  throw_if_any(p);
  gx_ = std::tan(angle) * std::cos(azimuth);
  gy_ = std::tan(angle) * std::sin(azimuth);
}

Problems FractalParams::validate() const {
  Problems p;
  require(p, "rms_height", rms_height, "m", rms_height >= 0, "0 or more");
  require(p, "hurst", hurst, "-", hurst >= 0 && hurst <= 1, "a number from 0 to 1");
  require(p, "shortest", shortest, "m", shortest > 0, "a wavelength above 0");
  require(p, "longest", longest, "m", longest > shortest, "a wavelength above the shortest");
  if (waves < 1 || waves > 10000) p.push_back({{}, 0, 0, "waves", "is " + std::to_string(waves), "a number from 1 to 10000"});
  return p;
}

FractalSurface::FractalSurface(const FractalParams& params) {
  throw_if_any(params.validate());
  Random random(params.seed);
  double variance = 0.0;
  for (int i = 0; i < params.waves; ++i) {
    const double share = (i + random.uniform()) / params.waves;
    const double length = params.longest * std::pow(params.shortest / params.longest, share);
    const double direction = random.uniform(0.0, 2 * std::numbers::pi), k = 2 * std::numbers::pi / length;
    const double amplitude = std::pow(length / params.longest, params.hurst);
    waves_.push_back({k * std::cos(direction), k * std::sin(direction), random.uniform(0.0, 2 * std::numbers::pi), amplitude});
    variance += 0.5 * amplitude * amplitude;
  }
  for (Wave& w : waves_) w.amplitude *= params.rms_height / std::sqrt(variance);
}

double FractalSurface::height(double x, double y) const {
  double z = 0.0;
  for (const Wave& w : waves_) z += w.amplitude * std::sin(w.kx * x + w.ky * y + w.phase);
  return z;
}

Eigen::Vector2d FractalSurface::gradient(double x, double y) const {
  Eigen::Vector2d g(0, 0);
  for (const Wave& w : waves_) {
    const double c = w.amplitude * std::cos(w.kx * x + w.ky * y + w.phase);
    g += Eigen::Vector2d(w.kx * c, w.ky * c);
  }
  return g;
}

Problems HeightGrid::validate() const {
  Problems p;
  if (columns < 2 || rows < 2)
    p.push_back({{}, 0, 0, "size", "is " + std::to_string(columns) + " x " + std::to_string(rows), "at least 2 x 2 heights"});
  require(p, "cell", cell, "m", cell > 0, "a size above 0");
  require(p, "x0", x0, "m", true, "a coordinate");
  require(p, "y0", y0, "m", true, "a coordinate");
  if (heights.size() != static_cast<std::size_t>(std::max(columns, 0)) * static_cast<std::size_t>(std::max(rows, 0)))
    p.push_back({{}, 0, 0, "heights", "has " + std::to_string(heights.size()) + " values", "columns times rows"});
  for (const double h : heights)
    if (!std::isfinite(h)) {
      p.push_back({{}, 0, 0, "heights", "holds a value that is not finite", "heights"});
      break;
    }
  return p;
}

GridSurface::GridSurface(HeightGrid grid) : grid_(std::move(grid)) { throw_if_any(grid_.validate()); }

namespace {

struct Place {
  std::size_t a, b, c, d;  // corners: (0,0), (1,0), (0,1), (1,1)
  double u, v;
  bool inside_x, inside_y;
};

Place place(const HeightGrid& g, double x, double y) {
  const double u = (x - g.x0) / g.cell, v = (y - g.y0) / g.cell;
  const double cu = std::clamp(u, 0.0, g.columns - 1.0), cv = std::clamp(v, 0.0, g.rows - 1.0);
  const auto i = std::min(static_cast<std::size_t>(cu), static_cast<std::size_t>(g.columns) - 2);
  const auto j = std::min(static_cast<std::size_t>(cv), static_cast<std::size_t>(g.rows) - 2);
  const auto n = static_cast<std::size_t>(g.columns);
  return {j * n + i, j * n + i + 1, (j + 1) * n + i, (j + 1) * n + i + 1, cu - static_cast<double>(i), cv - static_cast<double>(j),
          u == cu, v == cv};
}

// A map of 64 million heights takes half a gigabyte.
constexpr unsigned kMostAcross = 20000;
constexpr std::uint64_t kMostHeights = 64'000'000;
constexpr std::streamsize kLongestLine = 1 << 24;

struct FileCloser {
  void operator()(std::FILE* f) const { std::fclose(f); }
};

}  // namespace

double GridSurface::height(double x, double y) const {
  const Place p = place(grid_, x, y);
  const auto& h = grid_.heights;
  return (1 - p.v) * ((1 - p.u) * h[p.a] + p.u * h[p.b]) + p.v * ((1 - p.u) * h[p.c] + p.u * h[p.d]);
}

Eigen::Vector2d GridSurface::gradient(double x, double y) const {
  const Place p = place(grid_, x, y);
  const auto& h = grid_.heights;
  const double gx = ((1 - p.v) * (h[p.b] - h[p.a]) + p.v * (h[p.d] - h[p.c])) / grid_.cell;
  const double gy = ((1 - p.u) * (h[p.c] - h[p.a]) + p.u * (h[p.d] - h[p.b])) / grid_.cell;
  return {p.inside_x ? gx : 0.0, p.inside_y ? gy : 0.0};
}

HeightGrid read_png_heights(const std::string& path, double cell, double black, double white, double x0, double y0) {
  Problems problems;
  require(problems, "cell", cell, "m", cell > 0, "a size above 0");
  require(problems, "black", black, "m", true, "a height");
  require(problems, "white", white, "m", true, "a height");
  throw_if_any(problems);
  const auto fail = [&](const std::string& what, const std::string& expected) -> InputError {
    return InputError(Problem{path, 0, 0, {}, what, expected});
  };
  // The simplified interface would squeeze 16 bits through a transfer curve: heights are read as the numbers stored.
  const std::unique_ptr<std::FILE, FileCloser> file(std::fopen(path.c_str(), "rb"));
  if (!file) throw fail("cannot be opened", "a grey PNG");
  png_byte signature[8];
  if (std::fread(signature, 1, 8, file.get()) != 8 || png_sig_cmp(signature, 0, 8) != 0)
    throw fail("is not a PNG file", "a grey PNG");
  std::string message;
  png_structp png = png_create_read_struct(
      PNG_LIBPNG_VER_STRING, &message,
      [](png_structp p, png_const_charp text) {
        *static_cast<std::string*>(png_get_error_ptr(p)) = text;
        png_longjmp(p, 1);
      },
      [](png_structp, png_const_charp) {});
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  if (!info) {
    png_destroy_read_struct(&png, nullptr, nullptr);
    throw RunError("libpng has no memory");
  }
  // Everything with a destructor is declared before setjmp, which libpng jumps back to.
  std::vector<png_byte> bytes;
  std::vector<png_bytep> rows;
  png_uint_32 width = 0, height = 0;
  int depth = 0, colour = 0;
  bool grey = true, small = true;
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    throw fail("cannot be read: " + message, "a grey PNG");
  }
  png_init_io(png, file.get());
  png_set_sig_bytes(png, 8);
  png_set_user_limits(png, kMostAcross, kMostAcross);
  png_set_chunk_malloc_max(png, 8u << 20);  // a small file can swell when it is unpacked
  png_read_info(png, info);
  png_get_IHDR(png, info, &width, &height, &depth, &colour, nullptr, nullptr, nullptr);
  grey = colour == PNG_COLOR_TYPE_GRAY || colour == PNG_COLOR_TYPE_GRAY_ALPHA;
  small = width < 2 || height < 2;
  const bool large = static_cast<std::uint64_t>(width) * height > kMostHeights;
  if (grey && !small && !large) {
    if (depth < 8) png_set_expand_gray_1_2_4_to_8(png);
    png_set_strip_alpha(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    const std::size_t row_bytes = png_get_rowbytes(png, info);
    bytes.resize(row_bytes * height);
    rows.resize(height);
    for (png_uint_32 i = 0; i < height; ++i) rows[i] = bytes.data() + i * row_bytes;
    png_read_image(png, rows.data());
  }
  png_destroy_read_struct(&png, &info, nullptr);
  if (!grey) throw fail("is a colour picture", "a grey PNG");
  if (small) throw fail("is smaller than 2 x 2 pixels", "a grey PNG");
  if (large) throw fail("has " + std::to_string(width) + " x " + std::to_string(height) + " pixels", "at most 64 million");
  HeightGrid grid{static_cast<int>(width), static_cast<int>(height), x0, y0, cell, {}};
  grid.heights.resize(static_cast<std::size_t>(width) * height);
  for (png_uint_32 j = 0; j < height; ++j) {
    const png_bytep row = rows[height - 1 - j];
    for (png_uint_32 i = 0; i < width; ++i) {
      const double value = depth == 16 ? (row[2 * i] * 256 + row[2 * i + 1]) / 65535.0 : row[i] / 255.0;
      grid.heights[static_cast<std::size_t>(j) * width + i] = black + (white - black) * value;
    }
  }
  return grid;
}

namespace {

// A line, read up to `limit` bytes; the stream fails where it is longer. False at the end.
bool getline_within(std::istream& in, std::string& line, std::streamsize limit) {
  line.clear();
  if (in.peek() == std::char_traits<char>::eof()) return false;
  for (int c = in.get(); c != std::char_traits<char>::eof() && c != '\n'; c = in.get()) {
    if (static_cast<std::streamsize>(line.size()) == limit) {
      in.setstate(std::ios::failbit);
      return true;
    }
    line.push_back(static_cast<char>(c));
  }
  if (in.eof()) in.clear(std::ios::eofbit);
  return true;
}

}  // namespace

HeightGrid read_ascii_heights(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw InputError(Problem{path, 0, 0, {}, "cannot be opened", "an ASCII grid of heights"});
  Problems problems;
  HeightGrid grid;
  double columns = 0, rows = 0, missing = 0;
  bool has_missing = false, corner_x = false, corner_y = false, has_cell = false;
  std::string line;
  int number = 0;
  std::vector<double> values;
  const auto wrong = [&](const std::string& key, const std::string& what, const std::string& expected) {
    problems.push_back({path, number, 1, key, what, expected});
  };
  while (getline_within(in, line, kLongestLine)) {
    ++number;
    if (in.fail()) throw InputError(Problem{path, number, 0, {}, "is longer than 16 MiB", "shorter lines"});
    std::istringstream words(line);
    std::string word;
    while (words >> word) {
      std::string key = word;
      std::transform(key.begin(), key.end(), key.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (std::isalpha(static_cast<unsigned char>(key[0])) && key != "nan" && key != "inf") {
        std::string text;
        words >> text;
        const auto value = parse_number(text);
        if (!value) {
          wrong(key, "is \"" + text + "\"", "a number");
          continue;
        }
        if (key == "ncols") columns = *value;
        else if (key == "nrows") rows = *value;
        else if (key == "xllcorner" || key == "xllcenter") grid.x0 = *value, corner_x = key == "xllcorner";
        else if (key == "yllcorner" || key == "yllcenter") grid.y0 = *value, corner_y = key == "yllcorner";
        else if (key == "cellsize") grid.cell = *value, has_cell = true;
        else if (key == "nodata_value") missing = *value, has_missing = true;
        else wrong(key, "is not known", "ncols, nrows, xllcorner, yllcorner, cellsize or NODATA_value");
        continue;
      }
      const auto value = parse_number(word);
      if (!value) wrong({}, "\"" + word + "\" is not a number", "a height");
      else if (has_missing && *value == missing) wrong({}, "a height is missing (" + word + ")", "heights everywhere");
      else values.push_back(*value);
      if (problems.size() > 20) throw InputError(problems);
      if (values.size() > kMostHeights) throw InputError(Problem{path, number, 0, {}, "holds too many heights", "at most 64 million"});
    }
  }
  number = 0;
  constexpr double most = kMostAcross;
  if (!(columns >= 2 && columns <= most && columns == std::floor(columns))) wrong("ncols", "is missing or out of range", "a whole number from 2 to 20000");
  if (!(rows >= 2 && rows <= most && rows == std::floor(rows))) wrong("nrows", "is missing or out of range", "a whole number from 2 to 20000");
  if (!has_cell || !(grid.cell > 0)) wrong("cellsize", "is missing or not above 0", "a size in metres");
  if (problems.empty() && static_cast<double>(values.size()) != columns * rows)
    wrong({}, "holds " + std::to_string(values.size()) + " heights", "ncols times nrows");
  throw_if_any(problems);
  grid.columns = static_cast<int>(columns);
  grid.rows = static_cast<int>(rows);
  if (corner_x) grid.x0 += 0.5 * grid.cell;
  if (corner_y) grid.y0 += 0.5 * grid.cell;
  grid.heights.resize(values.size());
  const auto n = static_cast<std::size_t>(grid.columns);
  for (std::size_t j = 0; j < static_cast<std::size_t>(grid.rows); ++j)
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>((static_cast<std::size_t>(grid.rows) - 1 - j) * n), n,
                grid.heights.begin() + static_cast<std::ptrdiff_t>(j * n));
  return grid;
}

}  // namespace terrode::terrain
