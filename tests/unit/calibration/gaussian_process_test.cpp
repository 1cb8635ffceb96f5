#include "calibration/gaussian_process.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/problem.h"
#include "core/random.h"

namespace terrode::calibration {
namespace {

Eigen::MatrixXd places(int n, Random& random) {
  Eigen::MatrixXd x(n, 2);
  for (int i = 0; i < n; ++i) x(i, 0) = random.uniform(), x(i, 1) = random.uniform();
  return x;
}

double smooth(double a, double b) { return std::sin(3 * a) + a * b + 2.0; }

TEST(GaussianProcess, InterpolatesASmoothFunctionAndKnowsItsError) {
  Random random(1);
  const Eigen::MatrixXd x = places(40, random);
  Eigen::VectorXd y(40);
  for (int i = 0; i < 40; ++i) y[i] = smooth(x(i, 0), x(i, 1));
  GaussianProcess g;
  g.fit(x, y);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d u(random.uniform(), random.uniform());
    const auto p = g.predict(u);
    // 40 places of a function that turns once leave a part in a hundred of its range.
    EXPECT_NEAR(p.mean, smooth(u[0], u[1]), 0.03);
    EXPECT_LT(std::abs(p.mean - smooth(u[0], u[1])), 5 * std::sqrt(p.variance) + 1e-3);
  }
  EXPECT_LT(g.noise_variance(), 1e-3);
}

TEST(GaussianProcess, FindsTheNoiseAndItsIntervalsHold) {
  Random random(2);
  constexpr double kNoise = 0.2;
  const Eigen::MatrixXd x = places(60, random);
  Eigen::VectorXd y(60);
  for (int i = 0; i < 60; ++i) y[i] = smooth(x(i, 0), x(i, 1)) + kNoise * random.normal();
  GaussianProcess g;
  g.fit(x, y);
  // 60 values give a deviation to within about 10 percent, the mean function taking some of them.
  EXPECT_NEAR(std::sqrt(g.noise_variance()), kNoise, 0.3 * kNoise);
  int inside = 0;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d u(random.uniform(), random.uniform());
    const auto p = g.predict(u);
    inside += std::abs(p.mean - smooth(u[0], u[1])) < 2 * std::sqrt(p.variance);
  }
  EXPECT_GT(inside, 170);
  const Eigen::VectorXd r = g.leave_one_out();
  EXPECT_NEAR(std::sqrt(r.squaredNorm() / 60), 1.0, 0.25);
}

TEST(GaussianProcess, LeaveOneOutIsThePredictionFromTheOthers) {
  // Against its definition, with hyperparameters that barely move: predictions from 29 of 30 observations.
  Random random(3);
  const Eigen::MatrixXd x = places(30, random);
  Eigen::VectorXd y(30);
  for (int i = 0; i < 30; ++i) y[i] = smooth(x(i, 0), x(i, 1)) + 0.1 * random.normal();
  GaussianProcess g;
  g.fit(x, y);
  const Eigen::VectorXd r = g.leave_one_out();
  GaussianProcess rest;
  Eigen::VectorXd direct(30);
  for (int k = 0; k < 30; ++k) {
    Eigen::MatrixXd xs(29, 2);
    Eigen::VectorXd ys(29);
    for (int i = 0, j = 0; i < 30; ++i)
      if (i != k) xs.row(j) = x.row(i), ys[j++] = y[i];
    rest.fit(xs, ys);
    const auto p = rest.predict(x.row(k).transpose());
    direct[k] = (y[k] - p.mean) / std::sqrt(p.variance + rest.noise_variance());
  }
  EXPECT_GT(r.dot(direct) / (r.norm() * direct.norm()), 0.95);
}

TEST(GaussianProcess, ATrendCarriesWhatTheCheaperModelKnows) {
  // Six observations of 3 f + 1 with f given everywhere.
  Random random(4);
  const Eigen::MatrixXd x = places(6, random);
  Eigen::VectorXd y(6), f(6);
  for (int i = 0; i < 6; ++i) f[i] = smooth(x(i, 0), x(i, 1)), y[i] = 3 * f[i] + 1;
  GaussianProcess g;
  g.fit(x, y, f);
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector2d u(random.uniform(), random.uniform());
    EXPECT_NEAR(g.predict(u, smooth(u[0], u[1])).mean, 3 * smooth(u[0], u[1]) + 1, 1e-3);
  }
}

TEST(GaussianProcess, RefusesWhatItCannotFit) {
  GaussianProcess g;
  EXPECT_THROW(g.fit(Eigen::MatrixXd::Zero(2, 1), Eigen::VectorXd::Zero(2)), InputError);
  EXPECT_THROW(g.fit(Eigen::MatrixXd::Zero(5, 1), Eigen::VectorXd::Zero(4)), InputError);
  // The same value everywhere: predicted so, without a NaN.
  Random random(5);
  g.fit(places(5, random), Eigen::VectorXd::Constant(5, 3.0));
  EXPECT_NEAR(g.predict(Eigen::Vector2d(0.5, 0.5)).mean, 3.0, 1e-9);
  EXPECT_TRUE(std::isfinite(g.predict(Eigen::Vector2d(0.5, 0.5)).variance));
}

}  // namespace
}  // namespace terrode::calibration
