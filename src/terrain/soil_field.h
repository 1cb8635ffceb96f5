// Soil that varies in space and with depth.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "bekker/point_law.h"
#include "bekker/soil.h"
#include "terrain/surface.h"

namespace terrode::terrain {

class SoilField {
 public:
  virtual ~SoilField() = default;
  // Changes the parameters to those at (x, y) [m], `depth` [m] below the undisturbed surface.
  virtual void at(double x, double y, double depth, bekker::LocalSoil& soil) const = 0;
  // True where the soil does not vary with x and y.
  virtual bool same_everywhere() const { return false; }
};

// One after another: layers first, what lies on top of them after.
class SoilFields final : public SoilField {
 public:
  explicit SoilFields(std::vector<std::shared_ptr<const SoilField>> fields) : fields_(std::move(fields)) {}
  void at(double x, double y, double depth, bekker::LocalSoil& soil) const override {
    for (const auto& field : fields_) field->at(x, y, depth, soil);
  }
  bool same_everywhere() const override;

 private:
  std::vector<std::shared_ptr<const SoilField>> fields_;
};

// Another soil mixed in by a share of place, from 0 (none of it) to 1 (it alone), held within: every parameter is the
// mean of the two by the share, k after both refer to the same plate width.
class SoilBlend final : public SoilField {
 public:
  // `share` is a surface whose height is the share [-]. Throws InputError for a soil that is not valid.
  SoilBlend(std::shared_ptr<const Surface> share, const bekker::Soil& soil);
  void at(double x, double y, double depth, bekker::LocalSoil& soil) const override;

 private:
  std::shared_ptr<const Surface> share_;
  bekker::LocalSoil other_;
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
  bool same_everywhere() const override { return true; }
  double pressure(double depth) const;
  // Depths at which one layer ends and the next begins [m].
  std::vector<double> boundaries() const;

 private:
  struct Entry {
    double top, bottom, base;  // depth [m]; pressure at its top less its own law there [Pa]
    bekker::LocalSoil local;
  };
  std::vector<Entry> entries_;
};

// A soil field for who knows no place, such as the steady wheel: the soil below (0, 0), as stress modifiers that keep the
// corners of layers in mind.
class FieldModifier final : public bekker::StressModifier {
 public:
  explicit FieldModifier(std::shared_ptr<const SoilField> field) : field_(std::move(field)) {}
  unsigned hooks() const override { return kSoilAtPoint; }
  void soil_at(const bekker::Context&, const bekker::Point& point, bekker::LocalSoil& soil) const override {
    field_->at(0.0, 0.0, point.sinkage, soil);
  }

 private:
  std::shared_ptr<const SoilField> field_;
};
class LayerCorner final : public bekker::StressModifier {
 public:
  explicit LayerCorner(double depth) : depth_(depth) {}
  unsigned hooks() const override { return kPressure; }
  double corner() const override { return depth_; }

 private:
  double depth_;
};

}  // namespace terrode::terrain
