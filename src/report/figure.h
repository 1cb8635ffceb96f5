// What a figure shows, without how it is drawn. Values are in the unit that the axis names: a caller that holds SI
// values and wants millimetres multiplies them.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace terrode::report {

// Colours of a series: an index into the palette (0..7), the next one free, or the ink of the text, which is kept for
// measurements so that they look the same in every figure.
inline constexpr int kNextColour = -1;
inline constexpr int kInk = -2;

enum class Draw { line, points, line_and_points, steps, band };

struct Series {
  std::string name = {};
  std::vector<double> x = {}, y = {};        // NaN in y breaks a line; y is not used by a band
  Draw draw = Draw::line;
  std::vector<double> low = {}, high = {};   // limits of error bars, or of the band, as values (not as differences); may be empty
  int colour = kNextColour;
  bool dashed = false;
};

struct Axis {
  std::string label = {};               // "Drawbar pull"
  std::string unit = {};                // "N"; empty: dimensionless
  bool log = false;
  double min = std::numeric_limits<double>::quiet_NaN();  // NaN: from the data
  double max = std::numeric_limits<double>::quiet_NaN();
};

// A word in the figure. With only x given (y NaN) a vertical rule, with only y a horizontal one.
struct Annotation {
  double x = std::numeric_limits<double>::quiet_NaN();
  double y = std::numeric_limits<double>::quiet_NaN();
  std::string text = {};
};

struct Figure {
  std::string title = {};
  Axis x = {}, y = {};
  std::vector<Series> series = {};
  std::vector<Annotation> annotations = {};
  std::string caption = {};
  int width = 640, height = 400;   // of the static drawing, px
};

// Values over a grid: residuals by slip and channel, a spectrum by time and frequency. Columns and rows are named by
// words (x_names) or by increasing numbers (x_values: centres of cells); NaN is an empty cell.
struct HeatMap {
  std::string title = {};
  Axis x = {}, y = {};
  std::vector<std::string> x_names = {}, y_names = {};
  std::vector<double> x_values = {}, y_values = {};
  std::vector<double> values = {};      // row by row, first row at the bottom (numbers) or at the top (words)
  std::string value_label = {}, value_unit = {};
  bool diverging = false;          // centred on zero: blue below, red above
  bool print_values = false;       // the number in every cell (few cells)
  std::string caption = {};
  int width = 640, height = 400;

  size_t columns() const { return x_names.empty() ? x_values.size() : x_names.size(); }
  size_t rows() const { return y_names.empty() ? y_values.size() : y_names.size(); }
};

}  // namespace terrode::report
