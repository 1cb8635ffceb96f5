#include "bekker/steady_wheel.h"

#include <fmt/format.h>
#include <gsl/gsl_integration.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "bekker/contact_arc.h"

namespace terrode::bekker {
namespace {

// Gauss-Legendre on [0, 1] after u -> u^3, which clusters points at the end u = 0: there sigma starts like a broken
// power of the distance (n < 1 makes its slope infinite) and shear builds up within a few K.
struct Rule {
  std::size_t count = 0;
  std::vector<double> at, weight;            // on [0, 1], after u -> u^3
  std::vector<double> u, u_weight;           // before
  std::vector<double> both_at, both_weight;  // after u -> u^3 (4 - 3 u), which clusters points at both ends
};

constexpr std::array<std::size_t, 9> kOrders = {7, 10, 14, 20, 28, 40, 56, 80, 112};

Rule rule_of(std::size_t count) {
  const std::unique_ptr<gsl_integration_glfixed_table, void (*)(gsl_integration_glfixed_table*)> gl(gsl_integration_glfixed_table_alloc(count),
                                                                                                    gsl_integration_glfixed_table_free);
  Rule out;
  out.count = count;
  for (std::size_t i = 0; i < count; ++i) {
    double u = 0, w = 0;
    gsl_integration_glfixed_point(0.0, 1.0, i, &u, &w, gl.get());
    out.at.push_back(u * u * u);
    out.weight.push_back(3.0 * u * u * w);
    out.u.push_back(u);
    out.u_weight.push_back(w);
    out.both_at.push_back(u * u * u * (4.0 - 3.0 * u));
    out.both_weight.push_back(12.0 * u * u * (1.0 - u) * w);
  }
  return out;
}

const std::array<Rule, kOrders.size()>& rules() {
  static const auto table = [] {
    std::array<Rule, kOrders.size()> out;
    for (std::size_t r = 0; r < kOrders.size(); ++r) out[r] = rule_of(kOrders[r]);
    return out;
  }();
  return table;
}

// For a piece of [0, 1] in u as accurate as `whole` points are for all of it. A rule of n points errs by rho^(-2 n) with
// rho = d + sqrt(d^2 + 1), d the distance of the nearest singularity over half the length; d = 1 for all of [0, 1] is
// what the stresses of wheels show.
constexpr std::size_t kFewest = 3;

const Rule& rule_of_piece(std::size_t whole, double length) {
  static const auto table = [] {
    std::vector<Rule> out;
    for (std::size_t n = 0; n <= kOrders.back(); ++n) out.push_back(rule_of(std::max(n, kFewest)));
    return out;
  }();
  constexpr std::size_t kLengths = 128;  // rounded up
  static const auto shares = [] {
    std::array<double, kLengths + 1> out{};
    for (std::size_t i = 1; i <= kLengths; ++i) out[i] = std::asinh(1.0) / std::asinh(static_cast<double>(kLengths) / static_cast<double>(i));
    return out;
  }();
  const double share = shares[static_cast<std::size_t>(std::ceil(length * kLengths))];
  return table[std::max(kFewest, static_cast<std::size_t>(std::ceil(share * static_cast<double>(whole))))];
}

struct Sums {
  double load = 0, pull = 0, torque = 0, compaction = 0, drag = 0;

  void add(const Sums& o, double w) {
    load += w * o.load;
    pull += w * o.pull;
    torque += w * o.torque;
    compaction += w * o.compaction;
    drag += w * o.drag;
  }
};

// Of the stress law in one solution: a tenth of a second or more. Plain ones take hundreds.
constexpr int kMostEvaluations = 2'000'000;

// Everything of one evaluation at one entry angle.
struct Evaluator {
  const LocalSoil& soil;  // as modifiers have changed it
  const PreparedLaw& law;
  const Context& context;
  const ContactArc& arc;
  int evaluations = 0;
  int most = kMostEvaluations;  // that may be spent on it
  // Angles at which the pressure has a corner or sliding stands still.
  std::array<double, 16> corners{};
  std::size_t corner_count = 0;
  // Where shear has corners in each panel, in u: kept by the caller from one entry angle to the next.
  static constexpr std::size_t kPanels = 6, kShearCorners = 4;
  static constexpr std::size_t kPerPanel = 4;
  struct ShearCorner {
    double u = 2.0;      // above 1: none
    double slope = 0.0;  // of StressModifier::shear_corner() over u
  };
  struct PanelCorners {
    std::array<ShearCorner, kPerPanel> found{};
    bool end = false;  // whether StressModifier::shear_corner() is above zero at u = 1
  };
  struct ShearCorners {
    std::array<std::array<PanelCorners, kShearCorners>, kPanels> at{};
    bool thorough = false;  // many places are searched
    double entry = 0.0;    // at which they were found; 0: never
    double stale = 0.0;    // relative change of the entry angle up to which they stay
    double bend = 0.0;     // how far in u a chord may be off its curve
  };
  ShearCorners own_corners{{}, true, 0.0, 0.0, 1e-3};
  ShearCorners* kept;
  bool found_before = false, fresh = false;
  std::size_t panel_index = 0;
  // StressModifier::shear_corner() at the end that was asked for last.
  double asked_end = std::numeric_limits<double>::quiet_NaN(), end_value = 0.0;
  const StressModifier* asked_of = nullptr;

  Evaluator(const LocalSoil& s, const PreparedLaw& l, const Context& c, const ContactArc& a, ShearCorners* corners_kept = nullptr)
      : soil(s), law(l), context(c), arc(a), kept(corners_kept ? corners_kept : &own_corners) {
    found_before = kept->entry > 0.0;
    fresh = found_before && std::abs(kept->entry - arc.theta_f) <= kept->stale * arc.theta_f;
    if (!fresh) kept->entry = arc.theta_f;
    for (const StressModifier* m : law.pressure) {
      const double cos_corner = arc.cos_f + m->corner() / arc.radius;
      if (!(cos_corner < std::cos(arc.theta_m))) continue;
      const double front = std::acos(cos_corner);
      add_corner(front);
      // The angle behind theta_m that has the same sinkage by Eq. 8.
      add_corner(arc.theta_r + (arc.theta_f - front) * (arc.theta_m - arc.theta_r) / (arc.theta_f - arc.theta_m));
    }
    // The rim's sliding along the soil changes its sense.
    if (!law.shear.empty() && arc.skid_split && !arc.locked && arc.one_minus_s > 1.0) {
      const double still = std::acos(1.0 / arc.one_minus_s);
      add_corner(still);
      add_corner(-still);
    }
    if (law.lowest_corner) add_corner(0.0);
  }

  void add_corner(double theta) {
    if (corner_count < corners.size()) corners[corner_count++] = theta;
  }

  using Ends = std::array<double, 2 + 16 + kPerPanel * kShearCorners>;

  struct Place {
    double sin_t, cos_t, z, j;
  };
  Place place(double theta) const {
    Place out;
    out.sin_t = std::sin(theta);
    out.cos_t = std::cos(theta);
    const double cos_e = theta >= arc.theta_m ? out.cos_t : std::cos(arc.equivalent(theta));
    out.z = std::max(0.0, arc.radius * (cos_e - arc.cos_f));
    out.j = arc.shear_displacement(theta, out.sin_t);
    return out;
  }

  // What modifiers see of the place at an angle.
  Point point(double theta, double& j) const {
    Point p;
    p.theta = theta;
    p.sin_theta = std::sin(theta);
    p.cos_theta = std::cos(theta);
    double sin_e = p.sin_theta, cos_e = p.cos_theta;
    if (theta < arc.theta_m) {
      const double equivalent = arc.equivalent(theta);
      sin_e = std::sin(equivalent);
      cos_e = std::cos(equivalent);
    }
    j = arc.shear_displacement(theta, p.sin_theta);
    p.sinkage = std::max(0.0, arc.radius * (cos_e - arc.cos_f));
    p.depth = std::max(0.0, arc.radius * (p.cos_theta - arc.cos_f));
    p.shear_displacement = std::abs(j);
    p.slide_speed = std::abs(context.radius * context.angular_velocity - context.forward_velocity * p.cos_theta);
    p.penetration_speed = std::max(0.0, context.forward_velocity * sin_e);
    p.entry_angle = arc.theta_f;
    return p;
  }

  Sums at(double theta, ProfilePoint* detail = nullptr) {
    ++evaluations;
    if (!law.plain_points) return modified(theta, detail);
    const Place here = place(theta);
    const double sin_t = here.sin_t, cos_t = here.cos_t;
    Stress stress;
    stress.sigma = power_law_pressure(soil, here.z);
    stress.tau = (soil.cohesion + stress.sigma * soil.tan_phi) * janosi_mobilised(soil, std::abs(here.j));
    const double tau = arc.shear_sign(theta, here.j) * stress.tau;
    if (detail) *detail = {theta, here.z, stress.sigma, tau, here.j};
    return {stress.sigma * cos_t + tau * sin_t, tau * cos_t - stress.sigma * sin_t, tau, stress.sigma * sin_t, 0.0};
  }

  Sums modified(double theta, ProfilePoint* detail) const {
    double j = 0;
    const Point p = point(theta, j);
    const Stress stress = stress_in(soil, law, context, p);
    const double tau = arc.shear_sign(theta, j) * stress.tau;
    if (detail) *detail = {theta, p.sinkage, stress.sigma, tau, j};
    return {stress.sigma * p.cos_theta + tau * p.sin_theta, tau * p.cos_theta - stress.sigma * p.sin_theta + stress.drive - stress.drag,
            tau + stress.drive, stress.sigma * p.sin_theta, stress.drag};
  }

  // Integral over [from, to] (any order) with points clustered at `from`; counted positive.
  void panel(Sums& sums, double from, double to, std::size_t order) {
    const double length = to - from;
    Ends u{};
    const std::size_t pieces = cut(from, to, u);
    const double size = std::abs(length);
    if (pieces == 1) {
      const Rule& rule = rules()[order];
      for (std::size_t i = 0; i < rule.count; ++i) sums.add(at(from + length * rule.at[i]), size * rule.weight[i]);
      return;
    }
    for (std::size_t k = 0; k < pieces; ++k) piece(sums, from, to, u[k], u[k + 1], rule_of_piece(kOrders[order] - kOrders[order] / 7, u[k + 1] - u[k]));
  }

  // The same with points clustered at both ends, where nothing cuts the panel.
  void panel_of_two_ends(Sums& sums, double from, double to, std::size_t order) {
    const double length = to - from, size = std::abs(length);
    const Rule& rule = rules()[order];
    for (std::size_t i = 0; i < rule.count; ++i) sums.add(at(from + length * rule.both_at[i]), size * rule.both_weight[i]);
  }

  bool cut_within(double a, double b) const {
    return std::any_of(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(corner_count),
                       [&](double at) { return (at - a) * (b - at) > 0; });
  }

  // Where to divide what has a branch's end on both sides: at the corner nearest to its middle, which then cuts no half.
  double divide(double a, double b) const {
    constexpr double kFar = 0.47;  // of the length, from the middle
    const double middle = 0.5 * (a + b);
    double out = middle, nearest = kFar * std::abs(b - a);
    for (std::size_t i = 0; i < corner_count; ++i) {
      if (!(std::abs(corners[i] - middle) < nearest)) continue;
      nearest = std::abs(corners[i] - middle);
      out = corners[i];
    }
    return out;
  }

  // Where in u of [from, to] the shear passes corners; from where they were before, if that is known.
  void find_shear_corners(double from, double to, const StressModifier& m, PanelCorners& corners_here) {
    std::array<ShearCorner, kPerPanel>& corner = corners_here.found;
    const auto value = [&](double u) {
      ++evaluations;
      const double theta = from + (to - from) * u * u * u;
      double j = 0;
      return shear_corner_in(soil, law, context, point(theta, j), m);
    };
    // Between a and b, where the sign differs: inverse interpolation through these and the point where their chord crosses
    // zero. An error of 1e-5 in the place of a corner is one of 1e-10 in the integral.
    const auto between = [&](double a, double f_a, double b, double f_b) {
      constexpr double kClose = 1e-5;
      double u = 0.5 * (a + b);
      for (int i = 0; i < 40 && b - a > kClose; ++i) {
        const double c = i > 3 ? 0.5 * (a + b) : (a * f_b - b * f_a) / (f_b - f_a), f_c = value(c);
        if (f_c == 0.0) return ShearCorner{c, (f_b - f_a) / (b - a)};
        const bool left = (f_c > 0) == (f_a > 0);
        u = a * f_b * f_c / ((f_a - f_b) * (f_a - f_c)) + b * f_a * f_c / ((f_b - f_a) * (f_b - f_c)) + c * f_a * f_b / ((f_c - f_a) * (f_c - f_b));
        const double far_end = left ? b : a;
        if (std::abs(u - c) < kept->bend && (u - c) * (far_end - c) > 0 && std::abs(u - c) < std::abs(far_end - c)) return ShearCorner{u, f_c / (c - u)};
        (left ? a : b) = c;
        (left ? f_a : f_b) = f_c;
        u = c;
      }
      return ShearCorner{u, (f_b - f_a) / (b - a)};
    };
    // From where a corner was: along the slope there, then along chords.
    constexpr double kFarthest = 0.06, kNear = 0.05;  // of kept->bend
    // What the panel's end says has changed where a corner came in or went out there. Neighbours share it.
    const auto at_end = [&] {
      if (asked_end != to || asked_of != &m) {
        asked_end = to;
        asked_of = &m;
        end_value = value(1.0);
      }
      return end_value;
    };
    bool lost = !found_before || (at_end() > 0) != corners_here.end;
    for (ShearCorner& c : corner) {
      if (lost || c.u > 1.0) continue;
      double f = value(c.u), slope = c.slope, step = -f / slope;
      for (int i = 0; i < 4 && std::abs(step) > kNear * kept->bend && std::abs(step) < kFarthest; ++i) {
        const double u = std::clamp(c.u + step, 0.0, 1.0), f_u = value(u);
        if (u == c.u) break;
        slope = (f_u - f) / (u - c.u);
        c.u = u;
        f = f_u;
        step = -f / slope;
      }
      lost = !(std::abs(step) <= kNear * kept->bend && slope * c.slope > 0 && c.u + step <= 1.0);
      c = {c.u + step, slope};
    }
    const bool none = corner[0].u > 1.0;
    if (!lost && !(none && kept->thorough)) return;
    // Near u = 0 the stress is too small for its corners to count.
    constexpr std::array<double, 6> kFew = {0.02, 0.12, 0.24, 0.5, 0.75, 1.0};
    constexpr std::array<double, 14> kMany = {0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.96, 1.0};
    const std::span<const double> searched = kept->thorough ? std::span<const double>(kMany) : std::span<const double>(kFew);
    corner.fill({});
    std::size_t found = 0;
    const auto add = [&](double a, double f_a, double b, double f_b) {
      if ((f_a > 0) != (f_b > 0) && found < corner.size()) corner[found++] = between(a, f_a, b, f_b);
    };
    std::array<double, kMany.size()> f{};
    for (std::size_t i = 0; i < searched.size(); ++i) {
      f[i] = i + 1 < searched.size() ? value(searched[i]) : at_end();
      if (i > 0) add(searched[i - 1], f[i - 1], searched[i], f[i]);
    }
    corners_here.end = f[searched.size() - 1] > 0;
    // Where the value turns back before it reaches zero at three places, it may cross zero twice between them.
    for (std::size_t i = 1; i + 1 < searched.size(); ++i) {
      double a = searched[i - 1], mid = searched[i], b = searched[i + 1], f_a = f[i - 1], f_m = f[i], f_b = f[i + 1];
      const auto turns = [&] { return (f_m > 0) ? f_a > 0 && f_b > 0 && f_m <= std::min(f_a, f_b) : f_a <= 0 && f_b <= 0 && f_m >= std::max(f_a, f_b); };
      for (int k = 0; k < 8 && turns(); ++k) {
        // The turning point of a parabola through the three.
        const double left = (f_m - f_a) / (mid - a), right = (f_b - f_m) / (b - mid);
        double c = 0.5 * (a + mid) - 0.5 * left * (b - a) / (right - left);
        if (!(right != left) || std::abs(c - mid) < 1e-4) break;
        const double least = f_m - 0.25 * (left + right) * (left + right) * (b - a) / (right - left) / 4.0;
        if (!kept->thorough && least / f_m > 0.3) break;
        c = std::clamp(c, a + 0.05 * (mid - a), b - 0.05 * (b - mid));
        const double f_c = value(c);
        if ((f_c > 0) != (f_m > 0)) {
          add(c < mid ? a : mid, c < mid ? f_a : f_m, c, f_c);
          add(c, f_c, c < mid ? mid : b, c < mid ? f_m : f_b);
          break;
        }
        const bool nearer = f_m > 0 ? f_c < f_m : f_c > f_m;
        if (nearer) {
          const bool left_of = c < mid;
          (left_of ? b : a) = mid;
          (left_of ? f_b : f_a) = f_m;
          mid = c;
          f_m = f_c;
        } else {
          (c < mid ? a : b) = c;
          (c < mid ? f_a : f_b) = f_c;
        }
      }
    }
  }

  // Ends in u, theta = from + (to - from) u^3, of the pieces into which corners cut [from, to]; returns their number.
  std::size_t cut(double from, double to, Ends& u) {
    std::size_t n = 1;
    u[0] = 0.0;
    for (std::size_t i = 0; i < std::min(law.shear_corners.size(), kShearCorners); ++i) {
      PanelCorners& corner = kept->at[panel_index][i];
      if (!fresh) find_shear_corners(from, to, *law.shear_corners[i], corner);
      for (const ShearCorner& c : corner.found)
        if (c.u < 1.0) u[n++] = c.u;
    }
    for (std::size_t i = 0; i < corner_count; ++i) {
      const double share = (corners[i] - from) / (to - from);
      if (share > 0.0 && share < 1.0) u[n++] = std::cbrt(share);
    }
    u[n] = 1.0;
    std::sort(u.begin() + 1, u.begin() + static_cast<std::ptrdiff_t>(n));
    return n;
  }

  void piece(Sums& sums, double from, double to, double u0, double u1, const Rule& rule) {
    const double length = u1 - u0, size = 3.0 * length * std::abs(to - from);
    for (std::size_t i = 0; i < rule.count; ++i) {
      const double u = u0 + length * rule.u[i];
      sums.add(at(from + (to - from) * u * u * u), size * u * u * rule.u_weight[i]);
    }
  }

  // Panels so that every end of a branch of sigma or j has points clustered at it. What has a branch's end on both sides is
  // first offered whole to `work_both`, which may refuse it.
  template <class Integrate, class IntegrateBoth>
  void panels(const Integrate& work, const IntegrateBoth& work_both) {
    const double m = arc.theta_m;
    panel_index = 0;
    const auto integrate = [&](double from, double to) {
      if (from != to) work(from, to);
      ++panel_index;
    };
    if (!arc.skid_split || arc.locked) {
      integrate(arc.theta_f, m);
      integrate(arc.theta_r, m);
      return;
    }
    const auto both_ends = [&](double a, double b) {
      if (a != b && work_both(a, b)) return;
      const double middle = divide(a, b);
      integrate(a, middle);
      integrate(b, middle);
    };
    both_ends(arc.theta_f, m);
    const double zero = rear_sign_change();
    if (zero > arc.theta_r && zero < m) {
      both_ends(arc.theta_r, zero);
      both_ends(zero, m);
    } else {
      both_ends(arc.theta_r, m);
    }
  }

  // Behind theta_m, j of Eq. 11 starts positive where the rim slides backwards and changes sign further back.
  double rear_sign_change() const {
    const double none = arc.theta_m;
    if (1.0 - arc.one_minus_s * std::cos(arc.theta_m) <= 0) return none;
    const auto j = [&](double t) { return arc.shear_displacement(t, std::sin(t)); };
    double lo = arc.theta_r, hi = std::acos(std::min(1.0, 1.0 / arc.one_minus_s));
    if (hi <= lo || j(lo) >= 0 || j(hi) <= 0) return none;
    for (int i = 0; i < 60 && hi - lo > 1e-15; ++i) (j(0.5 * (lo + hi)) < 0 ? lo : hi) = 0.5 * (lo + hi);
    return 0.5 * (lo + hi);
  }

  Sums integral(std::size_t order) {
    Sums sums;
    const bool halves = arc.skid_split && !arc.locked;  // each needs fewer points than the whole
    panels([&](double from, double to) { panel(sums, from, to, halves && order > 0 ? order - 1 : order); },
           [&](double from, double to) {
             const bool whole = law.shear_corners.empty() && !cut_within(from, to);
             if (whole) panel_of_two_ends(sums, from, to, order);
             return whole;
           });
    return sums;
  }

  // Adaptive bisection of each panel with two rules of different order, for stresses that no fixed rule resolves. What
  // differs by rounding, or is not finite, is not divided further; nor may a solution cost more than kMostEvaluations.
  void refine(Sums& sums, double from, double to, double u0, double u1, double tolerance, int depth) {
    Sums coarse, fine;
    piece(coarse, from, to, u0, u1, rules()[1]);
    piece(fine, from, to, u0, u1, rules()[3]);
    const double error = std::abs(fine.load - coarse.load) + std::abs(fine.pull - coarse.pull) + std::abs(fine.torque - coarse.torque);
    const double rounding = 1e-14 * (std::abs(fine.load) + std::abs(fine.pull) + std::abs(fine.torque));
    if (!(error > std::max(tolerance, rounding)) || depth == 0) {
      sums.add(fine, 1.0);
      return;
    }
    if (evaluations > most)
      throw RunError(fmt::format("steady wheel: the stresses at an entry angle of {:.3g} rad are not resolved under {:.6g} N at slip {:.4g}; "
                                 "check the load and the soil's parameters", arc.theta_f, context.normal_load, context.slip));
    const double middle = 0.5 * (u0 + u1);
    refine(sums, from, to, u0, middle, 0.5 * tolerance, depth - 1);
    refine(sums, from, to, middle, u1, 0.5 * tolerance, depth - 1);
  }

  Sums adaptive(double tolerance) {
    Sums sums;
    const auto refined = [&](double from, double to) {
      Ends u{};
      const std::size_t pieces = cut(from, to, u);
      for (std::size_t k = 0; k < pieces; ++k) refine(sums, from, to, u[k], u[k + 1], tolerance, 24);
    };
    panels(refined, [](double, double) { return false; });
    return sums;
  }
};

}  // namespace

Problems WheelSize::validate() const {
  Problems out;
  require(out, "radius", radius, "m", radius > 0 && radius <= 100, "a length above 0, at most 100 m");
  require(out, "width", width, "m", width > 0 && width <= 100, "a length above 0, at most 100 m");
  return out;
}

Problems Operating::validate() const {
  Problems out;
  if (!(std::isinf(slip) && slip < 0))
    require(out, "slip", slip, "-", slip <= 1, "at most 1 (s = 1 - v/(omega r)), or -infinity for a locked wheel");
  require(out, "normal_load", normal_load, "N", normal_load > 0 && normal_load <= 1e9, "above 0, at most 1e9 N");
  require(out, "angular_velocity", angular_velocity, "rad/s", angular_velocity >= 0, "at least 0 rad/s");
  require(out, "forward_velocity", forward_velocity, "m/s", forward_velocity >= 0, "at least 0 m/s");
  require(out, "position", position, "m", true, "a finite length");
  require(out, "time", time, "s", true, "a finite time");
  if (pass < 1) out.push_back({{}, 0, 0, "pass", fmt::format("is {}", pass), "at least 1"});
  return out;
}

SteadyWheel::SteadyWheel(const WheelSize& wheel, const Soil& soil, const ContactAngles& angles, PointLaw law, SteadyOptions options)
    : wheel_(wheel), soil_(soil), local_(soil), angles_(angles), law_(law), options_(options) {
  Problems problems;
  const auto collect = [&](const char* where, Problems found) {
    for (Problem& p : found) {
      p.key = std::string(where) + "." + p.key;
      problems.push_back(std::move(p));
    }
  };
  collect("wheel", wheel_.validate());
  collect("soil", soil_.validate());
  collect("contact", angles_.validate());
  if (!(options_.tolerance >= 1e-13 && options_.tolerance <= 1e-2))
    problems.push_back({{}, 0, 0, "tolerance", fmt::format("is {}", options_.tolerance), "from 1e-13 to 0.01"});
  throw_if_any(problems);
  rules();
}

namespace {

// One wheel at one operating point: evaluates any entry angle at any accuracy.
struct WheelProblem {
  const SteadyWheel& wheel;
  const LocalSoil& local;
  const ContactAngles& angles;
  const PreparedLaw& law;
  const SteadyOptions& options;
  Context context;
  double load = 0;
  double slip;  // asked for, before effects
  int evaluations = 0;
  Evaluator::ShearCorners corners{};
  double slope;  // d ln(load) / d ln(entry angle), kept from one search to the next

  WheelProblem(const SteadyWheel& w, const LocalSoil& l, const ContactAngles& a, const PreparedLaw& p, const SteadyOptions& o,
               const Operating& op)
      : wheel(w), local(l), angles(a), law(p), options(o), context(w.context(op)), slip(op.slip), slope(2.0 * l.n + 1.0) {}

  ContactShape shape(double entry) {
    const double drop = 1.0 - std::cos(entry);
    ContactShape out{context.radius, slip, context.normal_load, 0.0};
    context.sinkage = out.radius * drop;
    if (!law.contact.empty()) {
      context.slip = slip;
      // A radius that depends on the sinkage which it gives: by secants.
      double last = 0.0, last_error = 0.0;
      for (int i = 0; i < 40; ++i) {
        out = {context.radius, slip, context.normal_load, 0.0};
        for (const StressModifier* m : law.contact) m->contact(context, out);
        const double z = context.sinkage, error = out.radius * drop - z;
        if (std::abs(error) <= 1e-14 * z) break;
        context.sinkage = i == 0 ? out.radius * drop : z - error * (z - last) / (error - last_error);
        if (!(context.sinkage > 0)) context.sinkage = 0.5 * (z + out.radius * drop);
        last = z;
        last_error = error;
      }
      // Points see the slip that the soil sees.
      if (out.slip != slip) {
        context.slip = out.slip;
        context.forward_velocity = context.angular_velocity * context.radius * (1.0 - out.slip);
      }
    }
    context.sinkage = out.radius * (1.0 - std::cos(entry));
    return out;
  }

  // order < 0: adaptive.
  SteadyState evaluate(double entry, int order) {
    const ContactShape s = shape(entry);
    load = s.normal_load;
    const ContactArc arc(s, angles, options.skid_shear, wheel.soil().friction_angle, entry);
    constexpr double kCoarseBend = 0.02, kBend = 1e-3;
    corners.stale = order == 0 ? 0.02 : corners.bend == kBend ? 1e-5 : -1.0;  // what a coarse search found is never good enough
    corners.bend = order == 0 ? kCoarseBend : kBend;
    const LocalSoil soil = changed_soil(local, law, context);
    Evaluator e(soil, law, context, arc, &corners);
    e.most = kMostEvaluations - evaluations;
    const double area = arc.radius * context.width;
    // The integrals are in Pa; each panel may err by a share of tolerance * load / area.
    const Sums sums = order < 0 ? e.adaptive(0.05 * options.tolerance * load / area) : e.integral(static_cast<std::size_t>(order));
    evaluations += e.evaluations;
    SteadyState out;
    out.entry_angle = entry;
    out.peak_angle = arc.theta_m;
    out.exit_angle = arc.theta_r;
    out.peak_clamped = arc.peak_clamped;
    out.normal_load = area * sums.load;
    out.drawbar_pull = area * sums.pull;
    out.driving_torque = area * context.radius * sums.torque;
    out.sinkage = context.sinkage;
    out.compaction_resistance = area * sums.compaction;
    out.drag = area * sums.drag;
    return out;
  }

  // Sinkage and angles that belong to the entry angle.
  void lay(SteadyState& s) {
    const ContactArc arc(shape(s.entry_angle), angles, options.skid_shear, wheel.soil().friction_angle, s.entry_angle);
    s.peak_angle = arc.theta_m;
    s.exit_angle = arc.theta_r;
    s.peak_clamped = arc.peak_clamped;
    s.sinkage = context.sinkage;
  }

  double scaled_difference(const SteadyState& a, const SteadyState& b) const {
    return std::max({std::abs(a.normal_load - b.normal_load), std::abs(a.drawbar_pull - b.drawbar_pull),
                     std::abs(a.driving_torque - b.driving_torque) / context.radius}) /
           load;
  }

  // What a search for load(entry) = load knows, in log-log coordinates, where the curve is nearly straight. Safeguarded
  // by a bracket.
  struct Search {
    double x = 0.0;                      // entry angle to be tried next
    double lo = 0.0, hi = kLargestEntry;
    bool hi_checked = false;
    int tried = 0;
    int known = 0;                       // of the last points below, newest first
    std::array<double, 3> ln_x{}, ln_y{};  // y = load/wanted
    explicit Search(double guess) : x(std::clamp(guess, 1e-9, kLargestEntry)) {}
  };
  static constexpr double kLargestEntry = 0.5 * std::numbers::pi;

  // Takes in a state at s.x and says where to look next. False: that was the last point worth trying.
  bool step(Search& s, const SteadyState& state) {
    if (!std::isfinite(state.normal_load)) throw RunError("steady wheel: the stresses are not finite; check the soil's parameters");
    if (s.tried++ > 200) throw RunError(fmt::format("steady wheel: no entry angle found for {:.6g} N at slip {:.4g}", load, context.slip));
    if (state.normal_load > load) {
      s.hi = s.x;
      s.hi_checked = true;
    } else {
      s.lo = s.x;
      if (s.x >= kLargestEntry)
        throw RunError(fmt::format("steady wheel: the soil does not carry {:.6g} N: with the wheel buried to its axle (sinkage {:.4g} m) "
                                   "it carries {:.6g} N at slip {:.4g}; lower the load or check k and n",
                                   load, state.sinkage, state.normal_load, context.slip));
    }
    if (s.hi - s.lo <= 4e-16 * s.hi) return false;
    double next;
    if (state.normal_load > 0) {
      const double ln_x = std::log(s.x), y = std::log(state.normal_load / load);
      for (int i = 2; i > 0; --i) {
        s.ln_x[static_cast<std::size_t>(i)] = s.ln_x[static_cast<std::size_t>(i - 1)];
        s.ln_y[static_cast<std::size_t>(i)] = s.ln_y[static_cast<std::size_t>(i - 1)];
      }
      s.ln_x[0] = ln_x;
      s.ln_y[0] = y;
      s.known = std::min(s.known + 1, 3);
      double way = -y / slope;  // in ln x
      if (s.known > 1 && s.ln_x[1] != ln_x) {
        const double secant = (y - s.ln_y[1]) / (ln_x - s.ln_x[1]);
        if (secant > 0.2 && secant < 20) slope = secant;
        way = -y / slope;
        // Inverse quadratic interpolation through three points, where it bends the chord only a little.
        const double d1 = s.ln_y[1] - y, d2 = s.ln_y[2] - y, d12 = s.ln_y[2] - s.ln_y[1];
        if (s.known > 2 && d1 != 0 && d2 != 0 && d12 != 0) {
          const double a1 = (s.ln_x[1] - ln_x) / d1, a12 = (s.ln_x[2] - s.ln_x[1]) / d12;
          const double bent = -y * (a1 - (a12 - a1) / d2 * s.ln_y[1]);
          if (std::abs(bent - way) < 0.2 * std::abs(way)) way = bent;
        }
      }
      next = s.x * std::exp(way);
    } else {
      s.known = 0;
      next = 2 * s.x;
    }
    if (!(next > s.lo) || next >= s.hi) {
      next = !s.hi_checked && next >= s.hi ? kLargestEntry : 0.5 * (s.lo + s.hi);
    } else if (s.tried > 12) {
      next = 0.5 * (s.lo + s.hi);
    }
    s.x = next;
    return true;
  }

  SteadyState find(double guess, int order, double tolerance) {
    Search s(guess);
    for (;;) {
      const SteadyState state = evaluate(s.x, order);
      if (std::abs(state.normal_load - load) <= tolerance * load || !step(s, state)) return state;
    }
  }
};

}  // namespace

Context SteadyWheel::context(const Operating& op) const {
  const bool locked = std::isinf(op.slip);
  Context out;
  out.slip = op.slip;
  out.normal_load = op.normal_load;
  out.angular_velocity = locked ? 0.0 : op.angular_velocity;
  out.forward_velocity = locked ? op.forward_velocity : op.angular_velocity * wheel_.radius * (1.0 - op.slip);
  out.position = op.position;
  out.time = op.time;
  out.pass = op.pass;
  out.radius = wheel_.radius;
  out.width = wheel_.width;
  out.unit_weight = soil_.unit_weight();
  out.wheel_angle = op.wheel_angle;
  out.travel_length = op.travel_length;
  out.phase_average = op.phase_average;
  return out;
}

SteadyState SteadyWheel::solve(const Operating& operating) const {
  throw_if_any(operating.validate());
  WheelProblem problem(*this, local_, angles_, law_, options_, operating);
  const ContactShape s0 = problem.shape(0.3);
  // Bekker's sinkage of a towed rigid wheel (1969) starts the search.
  const LocalSoil soil = changed_soil(local_, law_, problem.context);
  const double kz = soil.k / std::pow(soil.plate_width, soil.n);
  const double z0 = std::pow(3 * s0.normal_load / (wheel_.width * kz * std::max(0.2, 3 - soil.n) * std::sqrt(2 * wheel_.radius)),
                             2 / (2 * soil.n + 1));
  const double guess = std::acos(std::clamp(1 - z0 / wheel_.radius, 0.2, 1 - 1e-12));
  problem.load = s0.normal_load;
  // A coarse root first, then finer rules until two orders agree.
  const bool modified = law_.modified_points;
  const double close = 0.3 * options_.tolerance;
  const auto excess = [&](const SteadyState& s) { return std::abs(s.normal_load - problem.load) / problem.load; };
  int order = 2;
  SteadyState state = problem.find(guess, 0, 2e-3);
  int state_order = 0;
  double coarse_difference = 0.0;  // between the rule before and this one
  for (bool first = true;; first = false) {
    // A secant of rule `order` leads to the root, which is evaluated by the next finer rule and held against what the
    // secant says.
    const int last = static_cast<int>(kOrders.size()) - 1;
    WheelProblem::Search search(state.entry_angle);
    SteadyState before, now = state_order == order ? state : problem.evaluate(search.x, order);
    if (first) coarse_difference = problem.scaled_difference(state, now);
    // At the root a further step would follow a secant of rounding errors.
    const double at_root = 0.01 * options_.tolerance;
    bool moved = excess(now) > at_root && problem.step(search, now);
    do {
      before = now;
      if (moved) now = problem.evaluate(search.x, order);
      moved = moved && excess(now) > at_root && problem.step(search, now);
    } while (moved && excess(now) > 1e-5);
    state_order = order < last ? order + 1 : -1;
    state = problem.evaluate(moved ? search.x : now.entry_angle, state_order);
    const double way = now.entry_angle - before.entry_angle;
    const auto along = [&](SteadyState& s, double share) {
      for (double SteadyState::*m : {&SteadyState::entry_angle, &SteadyState::normal_load, &SteadyState::drawbar_pull, &SteadyState::driving_torque,
                                     &SteadyState::compaction_resistance, &SteadyState::drag})
        s.*m += share * (now.*m - before.*m);
    };
    SteadyState expected = now;
    if (way != 0) along(expected, (state.entry_angle - now.entry_angle) / way);
    const double difference = problem.scaled_difference(expected, state);
    // Two differences tell how fast the rules converge, and so what the finer one still errs by; not faster than a
    // broken power lets them, and with effects that is relied on further, for what they bend costs several rules more.
    const double ratio = difference / std::max(coarse_difference, difference);
    const double error = difference * std::max(modified ? 0.03 : 0.3, ratio);
    if (difference <= close || (error <= close && difference <= 100.0 * options_.tolerance)) {
      // What is left of the load: a step too small to bend the secant.
      if (way != 0 && now.normal_load != before.normal_load) {
        along(state, (problem.load - state.normal_load) / (now.normal_load - before.normal_load));
        problem.lay(state);
      }
      break;
    }
    if (order == last) {
      state = problem.find(state.entry_angle, -1, 0.5 * options_.tolerance);
      break;
    }
    coarse_difference = difference;
    // Rules far from resolving the stresses are skipped, and corners that were missed are looked for.
    const bool far = difference > 1e3 * options_.tolerance;
    order = std::min(last, order + (far ? 2 : 1));
    if (!problem.corners.thorough && (far || !first)) {
      problem.corners.thorough = true;
      problem.corners.entry = 0.0;
      state_order = 0;
    }
  }
  // A search whose bracket closed on a jump, of the stresses or of their rounding, has found no root.
  if (!(excess(state) <= 1e-3))
    throw RunError(fmt::format("steady wheel: no entry angle found for {:.6g} N at slip {:.4g}: the soil carries {:.6g} N at {:.3g} rad; "
                               "check the load and the soil's parameters", problem.load, operating.slip, state.normal_load, state.entry_angle));
  state.evaluations = problem.evaluations;
  return state;
}

SteadyState SteadyWheel::at_entry_angle(const Operating& operating, double entry_angle) const {
  throw_if_any(operating.validate());
  if (!(entry_angle > 0 && entry_angle <= 0.5 * std::numbers::pi))
    throw InputError(Problem{{}, 0, 0, "entry_angle", fmt::format("is {} rad", entry_angle), "above 0, at most pi/2"});
  WheelProblem problem(*this, local_, angles_, law_, options_, operating);
  SteadyState state = problem.evaluate(entry_angle, -1);
  state.evaluations = problem.evaluations;
  return state;
}

void SteadyWheel::profile(const Operating& operating, const SteadyState& state, std::span<ProfilePoint> points) const {
  throw_if_any(operating.validate());
  WheelProblem problem(*this, local_, angles_, law_, options_, operating);
  const ContactArc arc(problem.shape(state.entry_angle), angles_, options_.skid_shear, soil_.friction_angle, state.entry_angle);
  const LocalSoil soil = changed_soil(local_, law_, problem.context);
  Evaluator e(soil, law_, problem.context, arc);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double share = points.size() > 1 ? static_cast<double>(i) / static_cast<double>(points.size() - 1) : 0.5;
    e.at(arc.theta_r + (arc.theta_f - arc.theta_r) * share, &points[i]);
  }
}

}  // namespace terrode::bekker
