// Soil that varies in space and with depth.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "bekker/point_law.h"
#include "bekker/soil.h"

namespace terrode::terrain {

class SoilField {
 public:
  virtual ~SoilField() = default;
  // Changes the parameters to those at (x, y) [m], `depth` [m] below the undisturbed surface.
  virtual void at(double x, double y, double depth, bekker::LocalSoil& soil) const = 0;
};

// Parameters from a function of place. Every soil it returns must be valid (bekker::Soil::validate); it is called for
// every loaded node, from one thread at a time for each ground.
class FunctionSoil final : public SoilField {
 public:
  explicit FunctionSoil(std::function<bekker::Soil(double x, double y)> soil) : soil_(std::move(soil)) {}
  void at(double x, double y, double, bekker::LocalSoil& soil) const override { soil = bekker::LocalSoil(soil_(x, y)); }

 private:
  std::function<bekker::Soil(double, double)> soil_;
};

// Rectangles of different soils on a background; the last that holds a point counts.
struct SoilPatch {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // [m]
  bekker::Soil soil;
};
class SoilMap final : public SoilField {
 public:
  // Throws InputError naming every patch that is empty or whose soil is not valid.
  explicit SoilMap(std::vector<SoilPatch> patches);
  void at(double x, double y, double depth, bekker::LocalSoil& soil) const override;

 private:
  struct Entry {
    SoilPatch patch;
    bekker::LocalSoil local;
  };
  std::vector<Entry> entries_;
};

// Layers from the top down. Pressure grows with depth by each layer's own law from where the one above ended,
//   p(z) = sum over layers i of p_i(min(z, bottom_i)) - p_i(top_i),    p_i(z) = k_i (z/b_i)^n_i,
// so that it is continuous; strength (c, phi, K) is that of the layer at z. Handed on as the k that gives p(z).
struct SoilLayer {
  double thickness = 0.0;  // [m]; the last one goes on for ever, whatever is said here
  bekker::Soil soil;
};
class LayeredSoil final : public SoilField {
 public:
  explicit LayeredSoil(std::vector<SoilLayer> layers);
  void at(double x, double y, double depth, bekker::LocalSoil& soil) const override;
  double pressure(double depth) const;

 private:
  struct Entry {
    double top, bottom, base;  // depth [m]; pressure at its top less its own law there [Pa]
    bekker::LocalSoil local;
  };
  std::vector<Entry> entries_;
};

}  // namespace terrode::terrain
