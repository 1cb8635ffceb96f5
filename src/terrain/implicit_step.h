// How a step takes a contact that loads softly and lets go stiffly, without knowing beforehand which it will do.
//
// A body of mass m moves from t to t + h under F(t); u is its velocity. Beside F(t) it feels
//
//     - B (u(t + h) - u(t))   with  B = h K/4 + theta C          K stiffness, C damping of the ground
//     - c u(t + h)            with  c = h K_s/2 X/(1 + X),       X = h^2 K_s/m
//
// where K counts the release stiffness in place of the loading stiffness, and K_s is the release stiffness along the
// normal and the stick stiffness across it. The first is Newmark's rule with beta = 1/4, gamma = 1/2 (Newmark 1959) laid
// over the symplectic step: any contact that is at most as stiff as K is stable, whichever branch it takes, and nothing is
// damped. theta = 1/(1 - exp(-x)) - 1/x, x = h C/m, makes the decay of a single velocity exact. The second damps what the
// step does not resolve: of second order where it does (X << 1); for X >> 1 an oscillation on the branch shrinks to 0.58
// of itself from step to step. It only takes energy; a rolling body moves neither along the normal nor where it sticks.
#pragma once

#include <algorithm>
#include <cmath>

#include "terrain/terrain.h"

namespace terrode::terrain {

// Of (translation; rotation) about the body's origin [N s/m ...].
struct StepResistance {
  Mat6 inertial = Mat6::Zero();   // B
  Mat6 releasing = Mat6::Zero();  // c
};

inline StepResistance step_resistance(const ContactResult& r, double h, double mass) {
  StepResistance out;
  const double x = h * r.damping.diagonal().head<3>().maxCoeff() / mass;
  const double share = x < 1e-3 ? 0.5 + x / 12.0 : 1.0 / (1.0 - std::exp(-x)) - 1.0 / x;
  out.inertial = 0.25 * h * r.stiffness + share * r.damping;
  const auto unresolved = [&](double stiffness, double moved) {
    const double stiff = h * h * stiffness / moved;
    return 0.5 * h * stiffness * stiff / (1.0 + stiff);
  };
  const Mat3 normal = r.normal_W * r.normal_W.transpose();
  if (r.release_stiffness > 0) {
    const double more = r.release_stiffness - r.normal_W.dot(r.stiffness.topLeftCorner<3, 3>() * r.normal_W);
    if (more > 0) out.inertial.topLeftCorner<3, 3>() += 0.25 * h * more * normal;
    out.releasing.topLeftCorner<3, 3>() = unresolved(r.release_stiffness, mass) * normal;
  }
  if (r.stick_stiffness > 0) {
    // What moves there is a rim: a third of the mass, for a cylinder.
    const Mat3 pull = unresolved(r.stick_stiffness, mass / 3.0) * (Mat3::Identity() - normal);
    const Vec3& a = r.grip_W;
    Mat3 lever;
    lever << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    out.releasing.topLeftCorner<3, 3>() += pull;
    out.releasing.bottomLeftCorner<3, 3>() += lever * pull;
    out.releasing.topRightCorner<3, 3>() += pull * lever.transpose();
    out.releasing.bottomRightCorner<3, 3>() += lever * pull * lever.transpose();
  }
  return out;
}

}  // namespace terrode::terrain
