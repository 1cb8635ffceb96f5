#include "bekker/shear_laws.h"

#include <cmath>
#include <numbers>

#include "bekker/law_parameters.h"

namespace terrode::bekker {

WongPeakShear::WongPeakShear(double residual, double peak_displacement) : residual_(residual), kw_(peak_displacement) {
  Problems p;
  require(p, "residual", residual, "-", residual > 0 && residual <= 1, "a share above 0 and at most 1");
  require(p, "peak_displacement", peak_displacement, "m", peak_displacement > 0, "a length above 0");
  throw_if_any(p);
  hump_ = 1.0 / (residual * (1.0 - 1.0 / std::numbers::e)) - 1.0;
}

double WongPeakShear::mobilised(const LocalSoil&, double j) const {
  const double fall = std::exp(-j / kw_);
  return residual_ * (1.0 + hump_ * std::numbers::e * fall) * (1.0 - fall);
}

OidaShear::OidaShear(double residual, double peak_displacement) : residual_(residual) {
  Problems p;
  require(p, "residual", residual, "-", residual > 0 && residual < 1, "a share between 0 and 1");
  require(p, "peak_displacement", peak_displacement, "m", peak_displacement > 0, "a length above 0");
  throw_if_any(p);
  const double w = std::sqrt(1.0 - residual);
  rate_ = std::log((1.0 + w) / w) / peak_displacement;
  ratio_ = (1.0 + w) / (1.0 - w);
}

double OidaShear::mobilised(const LocalSoil&, double j) const {
  const double x = std::exp(-rate_ * j);
  return residual_ * (1.0 - x) * (1.0 + ratio_ * x);
}

std::vector<LawParameter> shear_law_parameters(const std::string& name) {
  if (name == "janosi") return {};
  if (name == "wong_peak" || name == "oida")
    return {{"residual", "-", "shear stress that is left, over its peak", 0.0, 1.0, true, name == "oida"},
            {"peak_displacement", "m", "Kw, where the peak is", 0.0, std::numeric_limits<double>::infinity(), true}};
  throw LawParameters::unknown("shear law", name, shear_law_names());
}

std::vector<std::string> shear_law_names() { return {"janosi", "wong_peak", "oida"}; }

std::unique_ptr<ShearLaw> make_shear_law(const std::string& name, const std::map<std::string, double>& parameters) {
  LawParameters in(name, parameters);
  if (name == "janosi") {
    in.finish();
    return std::make_unique<JanosiShear>();
  }
  if (name == "wong_peak" || name == "oida") {
    const double residual = in.take("residual"), displacement = in.take("peak_displacement");
    in.finish();
    if (name == "oida") return std::make_unique<OidaShear>(residual, displacement);
    return std::make_unique<WongPeakShear>(residual, displacement);
  }
  throw LawParameters::unknown("shear law", name, shear_law_names());
}

}  // namespace terrode::bekker
