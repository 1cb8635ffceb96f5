// Soil parameters from soil tests: cohesion, friction angle and shear modulus from direct shear (Smith et al. Eq. 24),
// k and n from pressure-sinkage (Eq. 25), Bekker's kc and kphi from several plates, Wong's ways beside them, and the
// stiffness of unloading.
//
// How sure the estimates are. The sums of squares are those of Eqs. 24 and 25, each test counting the same however
// densely it was sampled (averages over even steps of displacement). Along one curve residuals are strongly correlated,
// and between tests whole curves differ; both go into the covariance:
//   Cov = B^-1 ( sum over tests J' [ s^2 R(rho) + G Omega G' ] J ) B^-1,   B = sum J'J,
// with s and rho (residuals along the curve, autoregressive of first order) from each test's own fit, and Omega, the
// scatter of tests about the common curve in level and shape (random effects), from what the tests' own fits differ
// by, combined with an assumed repeatability where there are few tests. Intervals are profiles of the sum of squares,
// scaled so that their curvature at the minimum agrees with Cov (Pace et al. 2011), with Student's t.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bekker/soil.h"
#include "calibration/estimate.h"
#include "recording/recording.h"

namespace terrode::calibration {

enum class Weighting {
  absolute,  // squares of stress, as Eqs. 24 and 25 are printed: the heaviest load counts most
  relative,  // squares of stress over the test's root mean square: every load counts alike
};

struct SoilTestOptions {
  double confidence = 0.95;
  Weighting weighting = Weighting::absolute;
  int points = 100;              // steps of displacement into which each curve is averaged
  // Scatter between tests that is assumed, and for how many tests' worth that assumption counts beside those seen.
  double level_repeatability = 0.05;   // deviation of ln(stress level) between tests of the same soil
  double shape_repeatability = 0.10;   // of ln K, and of ln n
  double repeatability_weight = 2.0;   // degrees of freedom
  double minimum_sinkage = 0.0;              // m: what a plate did before is left out (seating)
  double maximum_sinkage = 1e9;              // m: what a plate did beyond is left out
  double maximum_shear_displacement = 1e9;   // m: what a shear test did beyond is left out
  std::optional<double> plate_width;   // m: that k of sigma = k (z/plate_width)^n shall refer to; absent: the widest

  Problems validate() const;
};

// One test as it was used, and what it says by itself.
struct TestCurve {
  std::string file;
  double condition = 0.0;              // normal stress [Pa], or plate width [m] (of a circle its diameter)
  std::vector<double> displacement;    // m, averaged steps
  std::vector<double> measured;        // Pa
  std::vector<double> fitted;          // Pa, common parameters
  double residual_rms = 0.0;           // Pa, about the common curve
  double own_rms = 0.0;                // Pa, about its own curve
  double correlation = 0.0;            // of neighbouring steps' residuals about its own curve
  double effective_points = 0.0;       // independent values that the steps are worth
  double own_level = 0.0;              // Pa: c + sigma tan(phi), or k for its own width
  double own_shape = 0.0;              // K [m], or n [-], of this test by itself
  double own_level_std = 0.0, own_shape_std = 0.0;
  bool loops_cut = false;              // unloading loops were left out
};

// c, phi, K of one direct shear test by Wong's method (J.Y. Wong, J. Terramechanics 17(1), 1980): tau_max as measured,
// K = - sum (1 - tau/tau_max)^2 j^2 / sum (1 - tau/tau_max)^2 j ln(1 - tau/tau_max).
struct WongShear {
  double tau_max = 0.0;          // Pa
  double shear_modulus = 0.0;    // K, m
};

// Estimates, in this order: cohesion [Pa], friction_angle [rad], shear_modulus [m]. With a single normal stress the
// cohesion is not identified: taken as 0, with a warning.
struct ShearFit : Fit {
  std::vector<TestCurve> curves;
  std::vector<WongShear> wong;               // by test
  // From these: the line through tau_max, and the mean of K with its deviation between tests.
  std::optional<double> wong_cohesion, wong_friction_angle;  // Pa, rad; absent with a single normal stress
  double wong_shear_modulus = 0.0, wong_shear_modulus_std = 0.0;  // m
  double between_level = 0.0, between_shape = 0.0;  // deviation between tests of ln(tau_res) and ln K that was used
};

// Fits tau = (c + sigma tan phi)(1 - exp(-|j|/K)) to all tests together (Smith et al. Eq. 24). Throws InputError when
// there is no test or one of them cannot be used (fewer than 4 points, lengths that differ, not finite).
ShearFit fit_direct_shear(std::span<const recording::DirectShearTest> tests, const SoilTestOptions& options = {});

// Estimates, in this order: k [Pa], n [-], of sigma = k (z/plate_width)^n.
struct SinkageFit : Fit {
  double plate_width = 0.0;                  // m, that k refers to
  std::vector<TestCurve> curves;
  double wong_k = 0.0, wong_n = 0.0;         // by Wong's weighted least squares, mean over tests
  double between_level = 0.0, between_shape = 0.0;  // deviation between tests of ln(sigma) and ln n that was used
};

// Fits sigma = k (z/b)^n to all tests together (Smith et al. Eq. 25), b being each plate's short side or diameter: the
// size of the plate is taken to act as that equation says, and a warning tells where it does not. Throws InputError as
// fit_direct_shear.
SinkageFit fit_pressure_sinkage(std::span<const recording::PressureSinkageTest> tests, const SoilTestOptions& options = {});

// Estimates, in this order: kc [N/m^(n+1)], kphi [N/m^(n+2)], n [-] of sigma = (kc/b + kphi) z^n.
struct ModuliFit : Fit {
  std::vector<TestCurve> curves;
  double wong_kc = 0.0, wong_kphi = 0.0, wong_n = 0.0;
  struct Plate {
    double size = 0.0;       // b: short side, or radius of a circle [m]
    double modulus = 0.0;    // kc/b + kphi for the common n [N/m^(n+2)], of these tests alone
    double modulus_std = 0.0;
    double n = 0.0;          // of these tests alone
    int tests = 0;
  };
  std::vector<Plate> plates;
};

// Fits Bekker's moduli to plates of two or more sizes; b is the short side of a rectangle and the radius of a circle
// (Wong, Theory of Ground Vehicles, 2008). Beside it Wong's weighted least squares (J.Y. Wong, J. Terramechanics 17(1),
// 1980): for each plate ln sigma = ln k + n ln z with weights sigma^2, n averaged, then kc and kphi from k against 1/b.
// kc is not bounded: sand often gives a negative one. Throws InputError for fewer than two sizes.
ModuliFit fit_bekker_moduli(std::span<const recording::PressureSinkageTest> tests, const SoilTestOptions& options = {});

// Wong's weighted least squares of one curve: sigma = modulus z^n [Pa, m]. Points without positive z and sigma are left
// out. Throws InputError with fewer than two left.
struct PowerLaw {
  double modulus = 0.0;   // Pa/m^n
  double n = 0.0;
};
PowerLaw wong_power_law(std::span<const double> sinkage, std::span<const double> pressure);

// Wong's K and tau_max of one curve (see WongShear). Throws InputError where the curve has no positive stress.
WongShear wong_shear(std::span<const double> displacement, std::span<const double> stress);

// One unloading and reloading of a plate.
struct UnloadingLoop {
  std::string file;
  double sinkage = 0.0;        // where unloading began, m
  double pressure = 0.0;       // there, Pa
  double lowest_pressure = 0.0;
  double stiffness = 0.0;      // d sigma / d z of the line from the beginning to the lowest point, Pa/m
  double stiffness_std = 0.0;  // from the loop's width: unloading against reloading branch
  std::size_t begin = 0, lowest = 0, end = 0;  // samples of the test
};

// Estimates k0 [Pa/m] and A_u [Pa/m^2] of k_u = k0 + A_u z_u (Wong 2008) with two or more depths, else k0 alone as the
// mean, A_u not identified.
struct UnloadingFit : Fit {
  std::vector<UnloadingLoop> loops;
};

// Finds loops in which the pressure falls below `share` of the largest pressure so far and recovers, or to which the
// test was unloaded at its end. Nothing when there is none in which the plate moved back measurably.
UnloadingFit fit_unloading(std::span<const recording::PressureSinkageTest> tests, double share = 0.7, double confidence = 0.95);

// How the wheel will use the soil, to hold the tests' range against.
struct WheelUse {
  double radius = 0.13, width = 0.16;   // m
  std::vector<double> normal_loads;     // N
  std::vector<double> slips = {0.1, 0.3, 0.7};  // s = 1 - v/(omega r)
  std::optional<double> angular_velocity;       // rad/s
};

// Warnings where the wheel (solved with the fitted soil) presses, sinks or moves faster than the tests did, or is of
// another size than the plates.
std::vector<Warning> compare_with_wheel(const WheelUse& use, const bekker::ContactAngles& angles,
                                        std::span<const recording::PressureSinkageTest> plates, const SinkageFit* sinkage,
                                        std::span<const recording::DirectShearTest> shear, const ShearFit* shear_fit);

// Everything that the soil tests of a recording say.
struct SoilTestFits {
  std::optional<ShearFit> shear;
  std::optional<SinkageFit> sinkage;
  std::optional<ModuliFit> moduli;       // with plates of two or more sizes
  std::optional<UnloadingFit> unloading; // where a plate was unloaded
  std::vector<Warning> warnings;         // what concerns wheel and tests together
};

// All of the above for a recording. Tests that are absent leave their part empty. Of plates of several sizes, Eq. 25 is
// fitted to those of the size nearest to the wheel's width.
SoilTestFits fit_soil_tests(const recording::Recording& recording, const SoilTestOptions& options = {});

// What a fit says in favour of a soil: values that are identified, as soil files hold them.
void apply(const SoilTestFits& fits, recording::SoilBelief& soil);

}  // namespace terrode::calibration
