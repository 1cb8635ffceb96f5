// Draws figures as SVG, with nothing but the standard library: axes with round ticks, legend, error bars, bands. Colours
// are CSS variables, so that one drawing serves light and dark.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "report/figure.h"

namespace terrode::report {

struct SvgOptions {
  bool standalone = true;       // its own style sheet, ground and title inside; false: for a page that brings them
  std::string id = "figure";    // prefix of the ids inside
};

// The drawing, the same bytes for the same figure. Throws InputError when a series' vectors differ in length, a map's
// values do not fill its grid, or nothing at all can be drawn on a logarithmic axis.
std::string svg(const Figure& figure, const SvgOptions& options = {});
std::string svg(const HeatMap& map, const SvgOptions& options = {});

// Writes a standalone SVG (a picture for a README). Throws RunError when the file cannot be written.
void write_svg(const Figure& figure, const std::filesystem::path& path);
void write_svg(const HeatMap& map, const std::filesystem::path& path);

// Round numbers (1, 2, 5 times a power of ten) that cover lo..hi, about `target` of them, lying inside the interval.
std::vector<double> nice_ticks(double lo, double hi, int target = 6);

// "12.5", "-0.003", "4.2e6" with a true minus sign and `digits` significant digits, trailing zeros dropped; "-" (en
// dash) for NaN.
std::string format_number(double value, int digits = 4);

// The text with & < > " ' written as entities.
std::string escape(const std::string& text);

}  // namespace terrode::report
