#include "report/palette.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace terrode::report::palette {
namespace {

Rgb between(std::span<const Rgb> anchors, double t) {
  const double place = std::clamp(t, 0.0, 1.0) * static_cast<double>(anchors.size() - 1);
  const size_t i = std::min(static_cast<size_t>(place), anchors.size() - 2);
  const double f = place - static_cast<double>(i);
  const auto mix = [f](unsigned char a, unsigned char b) {
    return static_cast<unsigned char>(std::lround(static_cast<double>(a) * (1.0 - f) + static_cast<double>(b) * f));
  };
  return {mix(anchors[i].r, anchors[i + 1].r), mix(anchors[i].g, anchors[i + 1].g), mix(anchors[i].b, anchors[i + 1].b)};
}

constexpr Rgb kSequential[] = {{68, 1, 84},    {72, 40, 120},  {62, 74, 137},  {49, 104, 142}, {38, 130, 142},
                               {31, 158, 137}, {53, 183, 121}, {109, 205, 89}, {180, 222, 44}, {253, 231, 37}};
constexpr Rgb kDiverging[] = {{16, 62, 126},   {42, 120, 214},  {140, 183, 230}, {242, 241, 238},
                              {236, 160, 150}, {214, 66, 62},   {130, 24, 28}};

}  // namespace

std::string Rgb::hex() const { return fmt::format("#{:02x}{:02x}{:02x}", r, g, b); }
Rgb sequential(double t) { return between(kSequential, t); }
Rgb diverging(double t) { return between(kDiverging, 0.5 + 0.5 * t); }

}  // namespace terrode::report::palette
