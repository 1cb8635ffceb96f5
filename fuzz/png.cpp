// Grey pictures as maps of height.
#include "harness.h"
#include "terrain/surfaces.h"

FUZZ(png) {
  using namespace terrode;
  const terrain::GridSurface surface(terrain::read_png_heights(fuzz::as_file("fuzz.png", data, size), 0.01, 0.0, 0.5));
  (void)surface.height(0.05, 0.05);
  (void)surface.gradient(-1.0, 1e9);
}
