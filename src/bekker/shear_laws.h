// Shear stress-displacement laws by name, for PointLaw::shear_law. `janosi` is what a null pointer means.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bekker/law_parameters.h"
#include "bekker/point_law.h"
#include "core/problem.h"

namespace terrode::bekker {

// 1 - exp(-j/K) (Janosi & Hanamoto 1961), K of the soil: bit for bit the default.
class JanosiShear final : public ShearLaw {
 public:
  const char* name() const override { return "janosi"; }
  double mobilised(const LocalSoil& soil, double j) const override { return janosi_mobilised(soil, j); }
};

// Kr {1 + [1/(Kr (1 - 1/e)) - 1] exp(1 - j/Kw)} [1 - exp(-j/Kw)] (Wong & Preston-Thomas 1983): a hump of height near 1
// about j = Kw [m], then the residual Kr in (0, 1] of the peak.
class WongPeakShear final : public ShearLaw {
 public:
  WongPeakShear(double residual, double peak_displacement);
  const char* name() const override { return "wong_peak"; }
  double mobilised(const LocalSoil& soil, double j) const override;

 private:
  double residual_, kw_, hump_;
};

// Kr (1 - x)(1 + x (1 + w)/(1 - w)), w = sqrt(1 - Kr), x = (w/(1 + w))^(j/Kw): the three-parameter form of Oida (1979),
// written here from what defines it: 0 at j = 0, the greatest value 1 exactly at j = Kw [m], residual Kr in (0, 1).
class OidaShear final : public ShearLaw {
 public:
  OidaShear(double residual, double peak_displacement);
  const char* name() const override { return "oida"; }
  double mobilised(const LocalSoil& soil, double j) const override;

 private:
  double residual_, rate_, ratio_;
};

// "janosi", "wong_peak" and "oida" (residual, peak_displacement). Throws InputError like make_pressure_law.
std::unique_ptr<ShearLaw> make_shear_law(const std::string& name, const std::map<std::string, double>& parameters);
std::vector<std::string> shear_law_names();
std::vector<LawParameter> shear_law_parameters(const std::string& name);

}  // namespace terrode::bekker
