#include "bekker/pressure_laws.h"

#include <cmath>

#include "bekker/law_parameters.h"

namespace terrode::bekker {

BekkerPressure::BekkerPressure(double kc, double kphi) : kc_(kc), kphi_(kphi) {
  Problems p;
  require(p, "kc", kc, "N/m^(n+1)", true, "a number");
  require(p, "kphi", kphi, "N/m^(n+2)", kphi >= 0, "0 or more");
  throw_if_any(p);
}

double BekkerPressure::pressure(const LocalSoil& soil, const Context& context, double z) const {
  return (kc_ / context.width + kphi_) * std::pow(z, soil.n);
}

ReecePressure::ReecePressure(double kc, double kphi) : kc_(kc), kphi_(kphi) {
  Problems p;
  require(p, "kc", kc, "-", kc >= 0, "0 or more");
  require(p, "kphi", kphi, "-", kphi >= 0, "0 or more");
  throw_if_any(p);
}

double ReecePressure::pressure(const LocalSoil& soil, const Context& context, double z) const {
  const double b = context.width;
  return (soil.cohesion * kc_ + context.unit_weight * b * kphi_) * std::pow(z / b, soil.n);
}

WongPressure::WongPressure(double kp, double mm, double hydraulic_diameter) : kp_(kp), mm_(mm), diameter_(hydraulic_diameter) {
  Problems p;
  require(p, "kp", kp, "N/m^3", kp >= 0, "0 or more");
  require(p, "mm", mm, "N/m^3", mm >= 0, "0 or more");
  require(p, "hydraulic_diameter", hydraulic_diameter, "m", hydraulic_diameter > 0, "a length above 0");
  throw_if_any(p);
}

double WongPressure::pressure(const LocalSoil&, const Context&, double z) const {
  return kp_ * z + 4.0 * mm_ * z * z / diameter_;
}

std::vector<LawParameter> pressure_law_parameters(const std::string& name) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (name == "power") return {};
  if (name == "bekker")
    return {{"kc", "", "cohesive modulus [N/m^(n+1)]; absent: kc of the soil", -infinity, infinity, true, true, 1.0},
            {"kphi", "", "frictional modulus [N/m^(n+2)]; absent: kphi of the soil", 0.0, infinity, false, true, 2.0}};
  if (name == "reece") return {{"kc", "-", "kc' beside the cohesion"}, {"kphi", "-", "kphi' beside the unit weight"}};
  if (name == "wong")
    return {{"kp", "N/m^3", "stiffness of the peat"},
            {"mm", "N/m^3", "strength of the mat"},
            {"hydraulic_diameter", "m", "4 area/perimeter of the contact", 0.0, infinity, true}};
  throw LawParameters::unknown("pressure law", name, pressure_law_names());
}

std::vector<std::string> pressure_law_names() { return {"power", "bekker", "reece", "wong"}; }

std::unique_ptr<PressureLaw> make_pressure_law(const std::string& name, const std::map<std::string, double>& parameters) {
  LawParameters in(name, parameters);
  if (name == "power") {
    in.finish();
    return std::make_unique<PowerPressure>();
  }
  if (name == "bekker" || name == "reece") {
    const double kc = in.take("kc"), kphi = in.take("kphi");
    in.finish();
    if (name == "bekker") return std::make_unique<BekkerPressure>(kc, kphi);
    return std::make_unique<ReecePressure>(kc, kphi);
  }
  if (name == "wong") {
    const double kp = in.take("kp"), mm = in.take("mm"), diameter = in.take("hydraulic_diameter");
    in.finish();
    return std::make_unique<WongPressure>(kp, mm, diameter);
  }
  throw LawParameters::unknown("pressure law", name, pressure_law_names());
}

}  // namespace terrode::bekker
