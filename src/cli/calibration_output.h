// What fits look like in JSON, on the terminal and on a page: shared by the commands that fit.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibration/estimate.h"
#include "calibration/soil_tests.h"
#include "calibration/wheel_fit.h"
#include "cli/terminal.h"
#include "report/page.h"

namespace terrode::cli {

Json matrix_json(const Eigen::MatrixXd& m);
Json warning_json(const calibration::Warning& w);
// {"parameters": {NAME: {value, std, low, high, unit, coordinate, identified, at_bound}}, "order", "covariance",
// "coordinate_covariance", "degrees_of_freedom", "confidence", "warnings"}.
Json fit_json(const calibration::Fit& fit);

void print_fit(const std::string& title, const calibration::Fit& fit);
void print_warnings(const std::vector<calibration::Warning>& warnings);

report::Table estimates_table(const calibration::Fit& fit);
void warnings_on(report::Page& page, const std::vector<calibration::Warning>& warnings);

Json soil_tests_json(const calibration::SoilTestFits& fits);
Json wheel_json(const calibration::WheelFit& fit, const calibration::WheelData& data);
void soil_tests_on(report::Page& page, const calibration::SoilTestFits& fits);
void wheel_on(report::Page& page, const std::string& heading, const calibration::WheelFit& fit, const calibration::WheelData& data);

// A parameter that soil tests and wheel runs both set.
struct Comparison {
  std::string name, unit;
  double tests = 0.0, wheel = 0.0, distance = 0.0;  // in standard errors of the difference
};

std::vector<Comparison> compare(const calibration::SoilTestFits& tests, const calibration::Fit& wheel);
Json comparison_json(const std::vector<Comparison>& list);
report::Table comparison_table(const std::vector<Comparison>& list);
void print_comparison(const std::vector<Comparison>& list);

}  // namespace terrode::cli
