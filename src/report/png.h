// The smallest PNG that carries a grid of colours into a page.
#pragma once

#include <string>
#include <vector>

#include "report/palette.h"

namespace terrode::report {

// width x height pixels row by row from the top, transparent where not filled, as base64 of a PNG whose data are stored
// without compression (RFC 1950/1951 stored blocks; PNG 1.2).
std::string png_base64(size_t width, size_t height, const std::vector<palette::Rgb>& colours, const std::vector<bool>& filled);

// RFC 4648 base64.
std::string base64(const std::string& bytes);

}  // namespace terrode::report
