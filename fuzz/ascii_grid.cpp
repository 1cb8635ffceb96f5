// ESRI ASCII grids as maps of height.
#include "harness.h"
#include "terrain/surfaces.h"

FUZZ(ascii_grid) {
  using namespace terrode;
  const terrain::GridSurface surface(terrain::read_ascii_heights(fuzz::as_file("fuzz.asc", data, size)));
  (void)surface.height(0.05, 0.05);
  (void)surface.gradient(-1.0, 1e9);
}
