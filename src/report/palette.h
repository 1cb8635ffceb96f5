// Colours of figures: eight hues told apart by readers with any common colour vision, in a step for light and one for
// dark ground; and the two maps of colours for grids.
#pragma once

#include <array>
#include <string>

namespace terrode::report::palette {

inline constexpr std::array<const char*, 8> kLight = {"#2a78d6", "#e0602b", "#178f65", "#b07d00",
                                                      "#4a3aa7", "#c2467f", "#3f7d20", "#c8403f"};
inline constexpr std::array<const char*, 8> kDark = {"#4c98ee", "#ec7a48", "#2fb98a", "#d19f2b",
                                                     "#9a8ff0", "#e2719f", "#7dbb58", "#ec7170"};
inline constexpr const char* kInkLight = "#1c1f23";
inline constexpr const char* kInkDark = "#eceef0";
inline constexpr const char* kMutedLight = "#5b626b";
inline constexpr const char* kMutedDark = "#a2a9b3";
inline constexpr const char* kGridLight = "#e6e8eb";
inline constexpr const char* kGridDark = "#2d3238";
inline constexpr const char* kGroundLight = "#ffffff";
inline constexpr const char* kGroundDark = "#17191c";

struct Rgb {
  unsigned char r, g, b;
  std::string hex() const;
  bool is_dark() const { return 0.299 * r + 0.587 * g + 0.114 * b < 140.0; }
};

// Perceptually even map from dark violet (0) to yellow (1), after matplotlib's viridis.
Rgb sequential(double t);
// From blue (-1) over near-white (0) to red (1).
Rgb diverging(double t);

}  // namespace terrode::report::palette
