// Pressure-sinkage laws by name, for PointLaw::pressure_law. `power`, sigma = k (z/b)^n, is what a null pointer means.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bekker/law_parameters.h"
#include "bekker/point_law.h"
#include "core/problem.h"

namespace terrode::bekker {

// sigma = k (z/b)^n (Smith et al. Eq. 5), k, n and b of the soil: bit for bit the default.
class PowerPressure final : public PressureLaw {
 public:
  const char* name() const override { return "power"; }
  double pressure(const LocalSoil& soil, const Context&, double z) const override { return power_law_pressure(soil, z); }
};

// sigma = (kc/b + kphi) z^n (Bekker 1956), b the smaller dimension of the contact: the wheel's width. n of the soil.
// kc [N/m^(n+1)], kphi [N/m^(n+2)].
class BekkerPressure final : public PressureLaw {
 public:
  BekkerPressure(double kc, double kphi);
  const char* name() const override { return "bekker"; }
  double pressure(const LocalSoil& soil, const Context& context, double z) const override;

 private:
  double kc_, kphi_;
};

// sigma = (c kc' + gamma b kphi') (z/b)^n (Reece 1965): c of the soil, gamma its unit weight, b the wheel's width;
// kc', kphi' without dimension.
class ReecePressure final : public PressureLaw {
 public:
  ReecePressure(double kc, double kphi);
  const char* name() const override { return "reece"; }
  double pressure(const LocalSoil& soil, const Context& context, double z) const override;

 private:
  double kc_, kphi_;
};

// sigma = kp z + 4 mm z^2/Dh, the two-parameter law of ground with a surface mat (Wong, Garber & Preston-Thomas 1984):
// peat stiffness kp [N/m3], mat strength mm [N/m3], Dh = 4 A/L hydraulic diameter of the contact [m].
class WongPressure final : public PressureLaw {
 public:
  WongPressure(double kp, double mm, double hydraulic_diameter);
  const char* name() const override { return "wong"; }
  double pressure(const LocalSoil& soil, const Context& context, double z) const override;

 private:
  double kp_, mm_, diameter_;
};

// "power", "bekker" (kc, kphi), "reece" (kc, kphi), "wong" (kp, mm, hydraulic_diameter), parameters in SI. Throws
// InputError for an unknown name (with the nearest), and for parameters that are unknown, missing or out of range.
std::unique_ptr<PressureLaw> make_pressure_law(const std::string& name, const std::map<std::string, double>& parameters);
std::vector<std::string> pressure_law_names();
// Of a law named above; throws InputError for another name.
std::vector<LawParameter> pressure_law_parameters(const std::string& name);

}  // namespace terrode::bekker
