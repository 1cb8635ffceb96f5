#include "terrain/soil_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace terrode::terrain {

namespace {

void add(Problems& out, Problems in, const std::string& prefix) {
  for (Problem& p : in) {
    p.key = prefix + p.key;
    out.push_back(std::move(p));
  }
}

}  // namespace

SoilMap::SoilMap(std::vector<SoilPatch> patches) {
  Problems problems;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const SoilPatch& p = patches[i];
    const std::string key = "patches[" + std::to_string(i) + "].";
    require(problems, key + "x1", p.x1, "m", p.x1 > p.x0, "a coordinate above x0");
    require(problems, key + "y1", p.y1, "m", p.y1 > p.y0, "a coordinate above y0");
    add(problems, p.soil.validate(), key + "soil.");
  }
  throw_if_any(problems);
  for (const SoilPatch& p : patches) entries_.push_back({p, bekker::LocalSoil(p.soil)});
}

void SoilMap::at(double x, double y, double, bekker::LocalSoil& soil) const {
  for (auto e = entries_.rbegin(); e != entries_.rend(); ++e)
    if (x >= e->patch.x0 && x < e->patch.x1 && y >= e->patch.y0 && y < e->patch.y1) {
      soil = e->local;
      return;
    }
}

LayeredSoil::LayeredSoil(std::vector<SoilLayer> layers) {
  Problems problems;
  if (layers.empty()) problems.push_back({{}, 0, 0, "layers", "is empty", "one layer or more"});
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::string key = "layers[" + std::to_string(i) + "].";
    if (i + 1 < layers.size())
      require(problems, key + "thickness", layers[i].thickness, "m", layers[i].thickness > 0, "a thickness above 0");
    add(problems, layers[i].soil.validate(), key + "soil.");
  }
  throw_if_any(problems);
  double top = 0.0, pressure = 0.0;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    Entry e;
    e.local = bekker::LocalSoil(layers[i].soil);
    e.top = top;
    e.bottom = i + 1 < layers.size() ? top + layers[i].thickness : std::numeric_limits<double>::infinity();
    e.base = pressure - bekker::power_law_pressure(e.local, top);
    if (i + 1 < layers.size()) pressure = e.base + bekker::power_law_pressure(e.local, e.bottom);
    top = e.bottom;
    entries_.push_back(e);
  }
}

bool SoilFields::same_everywhere() const {
  return std::all_of(fields_.begin(), fields_.end(), [](const auto& field) { return field->same_everywhere(); });
}

SoilBlend::SoilBlend(std::shared_ptr<const Surface> share, const bekker::Soil& soil) : share_(std::move(share)) {
  Problems problems;
  if (!share_) problems.push_back({{}, 0, 0, "share", "is missing", "a surface"});
  add(problems, soil.validate(), "soil.");
  throw_if_any(problems);
  other_ = bekker::LocalSoil(soil);
}

void SoilBlend::at(double x, double y, double, bekker::LocalSoil& soil) const {
  const double w = std::clamp(share_->height(x, y), 0.0, 1.0);
  if (w == 0.0) return;
  if (w == 1.0) {
    soil = other_;
    return;
  }
  const auto mix = [w](double& a, double b) { a += w * (b - a); };
  mix(soil.k, other_.k * std::pow(soil.plate_width / other_.plate_width, other_.n));
  mix(soil.n, other_.n);
  mix(soil.cohesion, other_.cohesion);
  mix(soil.tan_phi, other_.tan_phi);
  mix(soil.shear_modulus, other_.shear_modulus);
  mix(soil.unit_weight, other_.unit_weight);
}

std::vector<double> LayeredSoil::boundaries() const {
  std::vector<double> out;
  for (std::size_t i = 0; i + 1 < entries_.size(); ++i) out.push_back(entries_[i].bottom);
  return out;
}

double LayeredSoil::pressure(double depth) const {
  for (const Entry& e : entries_)
    if (depth <= e.bottom) return e.base + bekker::power_law_pressure(e.local, depth);
  return 0.0;
}

void LayeredSoil::at(double, double, double depth, bekker::LocalSoil& soil) const {
  for (const Entry& e : entries_) {
    if (depth > e.bottom) continue;
    soil = e.local;
    if (depth > e.top && e.base != 0) soil.k *= 1.0 + e.base / bekker::power_law_pressure(e.local, depth);
    return;
  }
}

}  // namespace terrode::terrain
