// The explanations that are tried, and what one promises at the fit of another before it is fitted itself.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "diagnosis/diagnose.h"
#include "diagnosis/model.h"
#include "diagnosis/ripple.h"

namespace terrode::diagnosis {

// An explanation with its fit.
struct Tried {
  Hypothesis hypothesis;
  Fit fit;
};

// Every listed effect that can act on means, with starts for shapes that have several valleys: one list a candidate.
std::vector<std::vector<Hypothesis>> listed(const Model& model, const Options& options, const RippleSearch& ripples);

// The nameless terms f(s) (W/W0)^p of every channel that was measured; powers of the load where there are several.
std::vector<Hypothesis> nameless(const Campaign& campaign);

// The members of both, and the nameless term of the second.
Hypothesis joined(const Hypothesis& a, const Hypothesis& b);

// A hypothesis whose members start where a fit ended.
Hypothesis continued(const Model& model, const Tried& t);

bool contains(const Hypothesis& h, const std::string& id);

// Coordinate at which a parameter is tried before it is fitted: what the start gives, else a strength a little off its
// null value and a shape at its prior.
double first_coordinate(const FitParameter& p, const Hypothesis::Member& member);

// How far what was fitted lies from what it would be without noise: reduced chi-square, at least 1.
double overdispersion(const Fit& f);

// Residuals at a fit with the directions of everything fitted there taken out.
struct Projected {
  const Model& model;
  Eigen::MatrixXd q;
  Eigen::VectorXd r;

  Projected(const Model& m, const Tried& t);

  // What moving to `f` changes in the residuals and nothing fitted can imitate; empty where that is less than `least` of it.
  Eigen::VectorXd direction(const Hypothesis& h, const Fit& f, double least) const;

  // Chi-square that moving to `f` along one direction would gain, to first order.
  double score(const Hypothesis& h, const Fit& f) const;
};

}  // namespace terrode::diagnosis
