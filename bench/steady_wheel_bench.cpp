// Time of one steady solve at 1e-8 of the load, one core, against the same root search on GSL's adaptive quadrature (the
// textbook way), both in this run. Prints the median of seven rounds for each slip of the paper, Tables 1 and 8.
#include <gsl/gsl_errno.h>
#include <gsl/gsl_integration.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "bekker/contact_arc.h"
#include "bekker/steady_wheel.h"

using namespace terrode::bekker;

namespace {

struct Integrand {
  const LocalSoil& soil;
  const ContactArc& arc;
  double operator()(double t) const {
    const double z = std::max(0.0, arc.radius * (std::cos(arc.equivalent(t)) - arc.cos_f));
    const double j = arc.shear_displacement(t, std::sin(t));
    const double sigma = power_law_pressure(soil, z);
    const double tau = arc.shear_sign(t, j) * (soil.cohesion + sigma * soil.tan_phi) * janosi_mobilised(soil, std::abs(j));
    return sigma * std::cos(t) + tau * std::sin(t);
  }
};

double adaptive_load(const LocalSoil& soil, const ContactAngles& angles, double slip, double entry, gsl_integration_workspace* w) {
  const ContactArc arc({0.13, slip, 115.0, 0.0}, angles, SkidShear::as_printed, 0.606, entry);
  Integrand f{soil, arc};
  gsl_function g{[](double x, void* p) { return (*static_cast<Integrand*>(p))(x); }, &f};
  double front = 0, rear = 0, error = 0;
  if (arc.theta_f > arc.theta_m) gsl_integration_qags(&g, arc.theta_m, arc.theta_f, 0, 1e-9, 1000, w, &front, &error);
  if (arc.theta_m > arc.theta_r) gsl_integration_qags(&g, arc.theta_r, arc.theta_m, 0, 1e-9, 1000, w, &rear, &error);
  return 0.13 * 0.16 * (front + rear);
}

// Bisection-safeguarded secant on GSL's integral to 1e-8 of the load.
double adaptive_solve(const LocalSoil& soil, const ContactAngles& angles, double slip, gsl_integration_workspace* w) {
  double lo = 1e-3, hi = 1.5, x = 0.4, last_x = 0, last_f = 0;
  for (int i = 0; i < 100; ++i) {
    const double f = adaptive_load(soil, angles, slip, x, w) - 115.0;
    if (std::abs(f) < 1e-8 * 115) return x;
    (f > 0 ? hi : lo) = x;
    double next = i > 0 ? x - f * (x - last_x) / (f - last_f) : 0.5 * (lo + hi);
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    last_x = x;
    last_f = f;
    x = next;
  }
  return x;
}

template <class F>
double median_microseconds(int repeats, F&& work) {
  std::array<double, 7> rounds{};
  for (double& t : rounds) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < repeats; ++i) work();
    t = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count() / repeats;
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds[3];
}

}  // namespace

int main() {
  gsl_set_error_handler_off();
  gsl_integration_workspace* w = gsl_integration_workspace_alloc(1000);
  const Soil table8{96.240, 0.606, 4.534e-3, 2.305e4, 0.418, 0.05};
  std::printf("%-8s %6s %14s %20s %8s\n", "soil", "slip", "terrode [us]", "GSL adaptive [us]", "ratio");
  double sum = 0;
  int count = 0;
  double keep = 0;
  for (const bool eight : {false, true}) {
    const Soil soil = eight ? table8 : Soil{};
    const ContactAngles angles = eight ? ContactAngles{0.09, 0.90, 0.0} : ContactAngles{};
    const SteadyWheel wheel({}, soil, angles, {}, {SkidShear::as_printed, 1e-8});
    for (const double slip : {-0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.3, 0.5, 0.7}) {
      Operating op;
      op.slip = slip;
      const double ours = median_microseconds(500, [&] { keep += wheel.solve(op).drawbar_pull; });
      const double gsl = median_microseconds(20, [&] { keep += adaptive_solve(LocalSoil(soil), angles, slip, w); });
      std::printf("%-8s %6.1f %14.2f %20.1f %8.1f\n", eight ? "Table 8" : "Table 1", slip, ours, gsl, gsl / ours);
      sum += ours;
      ++count;
    }
  }
  std::printf("mean over all: %.2f us a solve at 1e-8 of the load (checksum %.6g)\n", sum / count, keep);
  gsl_integration_workspace_free(w);
}
