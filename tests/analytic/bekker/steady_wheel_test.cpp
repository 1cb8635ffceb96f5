// The steady wheel against an integration of the printed equations that shares no code with it: GSL's adaptive
// quadrature on Eqs. 2-11, at every slip of the paper for Tables 1 and 8 and over random soils, wheels and loads.
#include "bekker/steady_wheel.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_integration.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "core/random.h"

namespace terrode::bekker {
namespace {

// Of the load, and for torque of load times radius. The solver is asked for 1e-9; its error estimate is not a bound.
constexpr double kTolerance = 1e-9;

double adaptive(const std::function<double(double)>& f, double a, double b) {
  if (!(b > a)) return 0;
  gsl_integration_workspace* w = gsl_integration_workspace_alloc(2000);
  gsl_function g{[](double x, void* p) { return (*static_cast<const std::function<double(double)>*>(p))(x); },
                 const_cast<std::function<double(double)>*>(&f)};
  double out = 0, error = 0;
  gsl_integration_qags(&g, a, b, 0, 1e-12, 2000, w, &out, &error);
  gsl_integration_workspace_free(w);
  return out;
}

struct Forces {
  double load, pull, torque;
};

// Eqs. 2-11 written out from the paper as printed (with the brackets of Eq. 11 restored).
Forces reference(const WheelSize& wheel, const Soil& soil, const ContactAngles& angles, double s, double theta_f) {
  const double r = wheel.radius, b = wheel.width, theta_r = angles.theta_r;
  const double theta_m = std::min(theta_f, std::max(theta_r, (angles.a0 + angles.a1 * s) * theta_f));
  const auto sigma = [&](double t) {
    const double te = t >= theta_m ? t : theta_f - (theta_f - theta_m) * (t - theta_r) / (theta_m - theta_r);
    return soil.k * std::pow(std::max(0.0, r * (std::cos(te) - std::cos(theta_f))) / soil.plate_width, soil.n);
  };
  const auto tau = [&](double t) {
    double j = r * ((theta_f - t) - (1 - s) * (std::sin(theta_f) - std::sin(t)));
    double sign = 1;
    if (s < 0 && t >= theta_m) {
      j = r * (1 - s) * ((theta_f - t) * (std::sin(theta_f) - std::sin(theta_m)) / (theta_f - theta_m) - std::sin(theta_f) + std::sin(t));
      sign = -1;
    } else if (s < 0) {
      j = r * ((theta_m - t) - (1 - s) * (std::sin(theta_m) - std::sin(t)));
    }
    return sign * (soil.cohesion + sigma(t) * std::tan(soil.friction_angle)) * (1 - std::exp(-std::abs(j) / soil.shear_modulus));
  };
  const auto both = [&](const std::function<double(double)>& f) {
    double out = adaptive(f, theta_m, theta_f);
    // Where j changes sign behind theta_m the integrand has a kink: split there.
    double kink = theta_r;
    if (s < 0) {
      const auto j = [&](double t) { return (theta_m - t) - (1 - s) * (std::sin(theta_m) - std::sin(t)); };
      const int n = 4000;
      for (int i = 1; i < n; ++i) {
        double lo = theta_r + (theta_m - theta_r) * (i - 1) / n, hi = theta_r + (theta_m - theta_r) * i / n;
        if (i < n && j(lo) < 0 && j(hi) > 0) {
          for (int k = 0; k < 80; ++k) (j(0.5 * (lo + hi)) < 0 ? lo : hi) = 0.5 * (lo + hi);
          kink = lo;
        }
      }
    }
    return out + adaptive(f, theta_r, kink) + adaptive(f, kink, theta_m);
  };
  return {r * b * both([&](double t) { return sigma(t) * std::cos(t) + tau(t) * std::sin(t); }),
          r * b * both([&](double t) { return tau(t) * std::cos(t) - sigma(t) * std::sin(t); }), r * r * b * both(tau)};
}

void expect_agrees(const WheelSize& wheel, const Soil& soil, const ContactAngles& angles, const Operating& op) {
  const SteadyState state = SteadyWheel(wheel, soil, angles).solve(op);
  const Forces f = reference(wheel, soil, angles, op.slip, state.entry_angle);
  EXPECT_NEAR(f.load / op.normal_load, 1.0, kTolerance);
  EXPECT_NEAR(state.drawbar_pull / op.normal_load, f.pull / op.normal_load, kTolerance);
  EXPECT_NEAR(state.driving_torque / (op.normal_load * wheel.radius), f.torque / (op.normal_load * wheel.radius), kTolerance);
  EXPECT_NEAR(state.sinkage, wheel.radius * (1 - std::cos(state.entry_angle)), 1e-15);
}

struct Table {
  Soil soil;
  ContactAngles angles;
};

const Table kTable1{};
const Table kTable8{{96.240, 0.606, 4.534e-3, 2.305e4, 0.418, 0.05}, {0.09, 0.90, 0.0}};

class PaperSlips : public testing::TestWithParam<double> {};

TEST_P(PaperSlips, AgreeWithAdaptiveIntegration) {
  gsl_set_error_handler_off();
  Operating op;
  op.slip = GetParam();
  expect_agrees({}, kTable1.soil, kTable1.angles, op);
  expect_agrees({}, kTable8.soil, kTable8.angles, op);
}

INSTANTIATE_TEST_SUITE_P(SteadyWheel, PaperSlips, testing::Values(-0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.3, 0.5, 0.7));

TEST(SteadyWheel, AgreesWithAdaptiveIntegrationForRandomSoilsAndWheels) {
  gsl_set_error_handler_off();
  Random random(7);
  int solved = 0, refused = 0;
  for (int i = 0; i < 250; ++i) {
    Soil soil;
    soil.cohesion = random.uniform() < 0.2 ? 0 : random.uniform(0, 8e3);
    soil.friction_angle = random.uniform(0.15, 0.8);
    soil.shear_modulus = std::exp(random.uniform(std::log(2e-4), std::log(0.05)));
    soil.n = random.uniform(0.2, 2.2);
    soil.k = std::exp(random.uniform(std::log(5e3), std::log(2e6)));
    const WheelSize wheel{random.uniform(0.04, 0.5), random.uniform(0.03, 0.4)};
    const ContactAngles angles{random.uniform(0.05, 0.6), random.uniform(0.0, 0.6), random.uniform() < 0.5 ? 0.0 : random.uniform(-0.3, 0.0)};
    Operating op;
    op.slip = random.uniform(-1.5, 1.0);
    op.normal_load = std::exp(random.uniform(std::log(10.0), std::log(2000.0)));
    SCOPED_TRACE(testing::Message() << "case " << i << " slip " << op.slip << " load " << op.normal_load << " n " << soil.n << " K "
                                    << soil.shear_modulus << " r " << wheel.radius);
    try {
      SteadyWheel(wheel, soil, angles).solve(op);
    } catch (const RunError&) {
      ++refused;
      continue;
    }
    ++solved;
    expect_agrees(wheel, soil, angles, op);
  }
  EXPECT_GT(solved, 150);
  EXPECT_GT(refused, 0);
}

TEST(SteadyWheel, LockedWheelIsTheLimitOfLargeNegativeSlip) {
  Operating locked;
  locked.slip = -std::numeric_limits<double>::infinity();
  locked.forward_velocity = 0.03;
  const SteadyState a = SteadyWheel({}, {}, {}).solve(locked);
  Operating nearly = locked;
  nearly.slip = -1e7;
  const SteadyState b = SteadyWheel({}, {}, {}).solve(nearly);
  EXPECT_LT(a.drawbar_pull, 0);
  // At slip -1e7 all but a layer of K/(r 1e7) of the arc is fully mobilised.
  EXPECT_NEAR(a.drawbar_pull, b.drawbar_pull, 1e-5 * locked.normal_load);
  EXPECT_NEAR(a.driving_torque, b.driving_torque, 1e-5 * locked.normal_load * 0.13);
  // Every point slides fully: T = -r (c A + tan phi N_sigma).
  EXPECT_LT(a.driving_torque, 0);
}

TEST(SteadyWheel, SpinningInPlaceHasShearDisplacementOfTheArc) {
  Operating op;
  op.slip = 1.0;
  const SteadyWheel wheel({}, {}, {});
  const SteadyState state = wheel.solve(op);
  ProfilePoint points[5];
  wheel.profile(op, state, points);
  for (const ProfilePoint& p : points) EXPECT_NEAR(p.shear_displacement, 0.13 * (state.entry_angle - p.theta), 1e-15);
}

TEST(SteadyWheel, FrictionlessSoilGivesPullOfMinusCompactionResistanceAndNoTorque) {
  Soil soil;
  soil.cohesion = 0;
  soil.friction_angle = 0;
  const SteadyState state = SteadyWheel({}, soil, {}).solve({});
  EXPECT_EQ(state.driving_torque, 0.0);
  EXPECT_NEAR(state.drawbar_pull, -state.compaction_resistance, 1e-12 * 115);
}

// n = 1, a0 = a1 = 0, no shear: W = r b k/b_p r int_0^f (cos - cos_f) cos = closed form.
TEST(SteadyWheel, MatchesClosedFormForLinearSoilWithoutShear) {
  Soil soil;
  soil.cohesion = 0;
  soil.friction_angle = 0;
  soil.n = 1;
  const SteadyState s = SteadyWheel({}, soil, {0, 0, 0}).solve({});
  const double f = s.entry_angle, c = 0.13 * 0.16 * soil.k / soil.plate_width * 0.13;
  EXPECT_NEAR(c * (0.5 * f + 0.25 * std::sin(2 * f) - std::cos(f) * std::sin(f)), 115.0, 1e-9 * 115);
  EXPECT_NEAR(-s.drawbar_pull, c * 0.5 * std::pow(1 - std::cos(f), 2), 1e-9 * 115);
}

TEST(SteadyWheel, SaysWhenTheSoilCannotCarryTheLoad) {
  Soil soil;
  soil.k = 100;
  try {
    SteadyWheel({}, soil, {}).solve({});
    FAIL();
  } catch (const RunError& e) {
    EXPECT_NE(std::string(e.what()).find("does not carry 115 N"), std::string::npos) << e.what();
  }
}

// Loads so small that rounding alone is more than the tolerance: each is carried, or refused with words, and soon.
TEST(SteadyWheel, VanishingLoadsAreCarriedOrRefusedSoon) {
  Soil soil;
  soil.cohesion = 8889.38;
  soil.friction_angle = 0.111321;
  soil.shear_modulus = 1.28331e-3;
  soil.n = 0.292529;
  soil.k = 395345;
  soil.plate_width = 1.0;
  const SteadyWheel wheel({0.703532, 0.380919}, soil, {0.123408, 0.340276, -0.043042});
  for (const double load : {1e3, 1.0, 1e-3, 1e-6, 1e-12, 1e-300, 5e-324}) {
    for (const double slip : {-0.3344, 0.0, 0.6568}) {
      Operating op;
      op.slip = slip;
      op.normal_load = load;
      try {
        const SteadyState state = wheel.solve(op);
        EXPECT_TRUE(std::isfinite(state.drawbar_pull) && std::isfinite(state.driving_torque)) << load;
        EXPECT_NEAR(state.normal_load, load, 1e-6 * load);
        EXPECT_LT(state.evaluations, 2'100'000) << load << " N at slip " << slip;
      } catch (const RunError& e) {
        EXPECT_NE(std::string(e.what()).find("steady wheel: "), std::string::npos) << e.what();
      }
    }
  }
}

TEST(SteadyWheel, NamesEveryBadParameter) {
  Soil soil;
  soil.k = -1;
  soil.n = std::nan("");
  try {
    SteadyWheel({-0.1, 0.16}, soil, {});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.problems().size(), 3u) << e.what();
    EXPECT_NE(std::string(e.what()).find("wheel.radius: is -0.1 m"), std::string::npos) << e.what();
  }
  EXPECT_THROW(SteadyWheel({}, {}, {}).solve({1.1, 115}), InputError);
  EXPECT_THROW(SteadyWheel({}, {}, {}).solve({0.1, std::nan("")}), InputError);
}

TEST(SteadyWheel, AlternativeSkidShearBrakesLessAndFollowsTheSignOfJ) {
  Operating op;
  op.slip = -0.1;
  const SteadyWheel wheel({}, kTable8.soil, {}, {}, {SkidShear::along_displacement, 1e-9});
  const SteadyState state = wheel.solve(op);
  ProfilePoint points[41];
  wheel.profile(op, state, points);
  for (const ProfilePoint& p : points) {
    if (p.theta > state.peak_angle + 1e-9 && p.theta < state.entry_angle - 1e-9) { EXPECT_GT(p.tau, 0); }
    if (p.theta < state.peak_angle - 1e-9) { EXPECT_LT(p.tau, 0); }
  }
}

}  // namespace
}  // namespace terrode::bekker
