#include "cli/input.h"

#include <fmt/format.h>

#include "calibration/soil_tests.h"
#include "cli/terminal.h"

namespace terrode::cli {
namespace {

void complete_soil(scenario::Scenario& s, const Common& common) {
  recording::SoilBelief& soil = s.soil;
  const recording::Recording& r = *s.measured;
  const auto fill = [&](std::optional<double>& value, double fitted, const char* name, const char* unit, const char* tests) {
    if (value) return;
    value = fitted;
    note(common, fmt::format("{}: soil.bekker.{} is absent: {:.5g} {} fitted to the {} tests", s.file, name, fitted, unit, tests));
  };
  if ((!soil.cohesion || !soil.friction_angle || !soil.shear_modulus) && !r.direct_shear.empty()) {
    const calibration::ShearFit fit = calibration::fit_direct_shear(r.direct_shear);
    fill(soil.cohesion, fit.value("cohesion"), "cohesion", "Pa", "direct shear");
    fill(soil.friction_angle, fit.value("friction_angle"), "friction_angle", "rad", "direct shear");
    fill(soil.shear_modulus, fit.value("shear_modulus"), "shear_modulus", "m", "direct shear");
  }
  const bool has_moduli = soil.kc && soil.kphi && soil.n;
  if (!has_moduli && (!soil.k || !soil.n || !soil.plate_width) && !r.pressure_sinkage.empty()) {
    const calibration::SinkageFit fit = calibration::fit_pressure_sinkage(r.pressure_sinkage);
    // k and n belong together: one of them from the file and one from a fit would be neither soil.
    soil.kc.reset();
    soil.kphi.reset();
    soil.k = fit.value("k");
    soil.n = fit.value("n");
    soil.plate_width = fit.plate_width;
    note(common, fmt::format("{}: soil.bekker.k and n are absent: {:.5g} Pa (plate_width {:.4g} m) and {:.4g} fitted to the pressure-sinkage tests",
                             s.file, *soil.k, *soil.plate_width, *soil.n));
  }
}

}  // namespace

scenario::Scenario load_input(const std::string& path, const Common& common) {
  scenario::Scenario s = scenario::load_scenario(path, common.threads);
  for (const std::string& n : s.notes) note(common, n);
  if (common.seed_given()) s.seed = static_cast<int>(common.seed);
  if (s.from_recording && s.measured) complete_soil(s, common);
  return s;
}

}  // namespace terrode::cli
