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
  std::vector<double> at, weight;
};

constexpr std::array<std::size_t, 8> kOrders = {10, 14, 20, 28, 40, 56, 80, 112};

const std::array<Rule, kOrders.size()>& rules() {
  static const auto table = [] {
    std::array<Rule, kOrders.size()> out;
    for (std::size_t r = 0; r < kOrders.size(); ++r) {
      const std::unique_ptr<gsl_integration_glfixed_table, void (*)(gsl_integration_glfixed_table*)> gl(
          gsl_integration_glfixed_table_alloc(kOrders[r]), gsl_integration_glfixed_table_free);
      out[r].count = kOrders[r];
      for (std::size_t i = 0; i < kOrders[r]; ++i) {
        double u = 0, w = 0;
        gsl_integration_glfixed_point(0.0, 1.0, i, &u, &w, gl.get());
        out[r].at.push_back(u * u * u);
        out[r].weight.push_back(3.0 * u * u * w);
      }
    }
    return out;
  }();
  return table;
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

// Everything of one evaluation at one entry angle.
struct Evaluator {
  const LocalSoil& soil;
  const PointLaw& law;
  const Context& context;
  const ContactArc& arc;
  bool plain;
  int evaluations = 0;

  Sums at(double theta, ProfilePoint* detail = nullptr) {
    ++evaluations;
    const double sin_t = std::sin(theta), cos_t = std::cos(theta);
    const bool front = theta >= arc.theta_m;
    const double equivalent = arc.equivalent(theta);
    const double cos_e = front ? cos_t : std::cos(equivalent);
    const double z = std::max(0.0, arc.radius * (cos_e - arc.cos_f));
    const double j = arc.shear_displacement(theta, sin_t);
    const double sign = arc.shear_sign(theta, j);
    Stress stress;
    if (plain) {
      stress.sigma = power_law_pressure(soil, z);
      stress.tau = (soil.cohesion + stress.sigma * soil.tan_phi) * janosi_mobilised(soil, std::abs(j));
    } else {
      Point p;
      p.sinkage = z;
      p.depth = std::max(0.0, arc.radius * (cos_t - arc.cos_f));
      p.theta = theta;
      p.sin_theta = sin_t;
      p.cos_theta = cos_t;
      p.shear_displacement = std::abs(j);
      p.slide_speed = std::abs(context.radius * context.angular_velocity - context.forward_velocity * cos_t);
      p.penetration_speed = std::max(0.0, context.forward_velocity * std::sin(equivalent));
      stress = stress_at(soil, law, context, p);
    }
    const double tau = sign * stress.tau;
    if (detail) *detail = {theta, z, stress.sigma, tau, j};
    return {stress.sigma * cos_t + tau * sin_t, tau * cos_t - stress.sigma * sin_t + stress.drive - stress.drag,
            tau + stress.drive, stress.sigma * sin_t, stress.drag};
  }

  // Integral over [from, to] (any order) with points clustered at `from`; counted positive.
  void panel(Sums& sums, double from, double to, const Rule& rule) {
    const double length = to - from;
    if (length == 0) return;
    const double size = std::abs(length);
    for (std::size_t i = 0; i < rule.count; ++i) sums.add(at(from + length * rule.at[i]), size * rule.weight[i]);
  }

  // Panels so that every end of a branch of sigma or j has points clustered at it.
  template <class Integrate>
  void panels(const Integrate& integrate) {
    const double m = arc.theta_m;
    if (!arc.skid_split || arc.locked) {
      integrate(arc.theta_f, m);
      integrate(arc.theta_r, m);
      return;
    }
    const auto both_ends = [&](double a, double b) {
      const double middle = 0.5 * (a + b);
      integrate(a, middle);
      integrate(b, middle);
    };
    both_ends(m, arc.theta_f);
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

  Sums integral(const Rule& rule) {
    Sums sums;
    panels([&](double from, double to) { panel(sums, from, to, rule); });
    return sums;
  }

  // Adaptive bisection of each panel with two rules of different order, for stresses that no fixed rule resolves.
  void refine(Sums& sums, double from, double to, double u0, double u1, double tolerance, int depth) {
    const auto piece = [&](const Rule& rule, double a, double b) {
      // `at` and `weight` hold u^3 on [0, 1]; undo the cube to place the rule on [a, b] of u.
      Sums s;
      for (std::size_t i = 0; i < rule.count; ++i) {
        const double x = std::cbrt(rule.at[i]);
        const double w = x > 0 ? rule.weight[i] / (3 * x * x) : 0.0;
        const double u = a + (b - a) * x;
        s.add(at(from + (to - from) * u * u * u), (b - a) * w * 3 * u * u * std::abs(to - from));
      }
      return s;
    };
    const Sums coarse = piece(rules()[0], u0, u1);
    const Sums fine = piece(rules()[2], u0, u1);
    const double error = std::abs(fine.load - coarse.load) + std::abs(fine.pull - coarse.pull) + std::abs(fine.torque - coarse.torque);
    if (error <= tolerance || depth == 0) {
      sums.add(fine, 1.0);
      return;
    }
    const double middle = 0.5 * (u0 + u1);
    refine(sums, from, to, u0, middle, 0.5 * tolerance, depth - 1);
    refine(sums, from, to, middle, u1, 0.5 * tolerance, depth - 1);
  }

  Sums adaptive(double tolerance) {
    Sums sums;
    panels([&](double from, double to) { refine(sums, from, to, 0.0, 1.0, tolerance, 24); });
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
    : wheel_(wheel), soil_(soil), local_(soil), angles_(angles), law_(law), options_(options), hooks_(law.hooks()) {
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
  const PointLaw& law;
  const SteadyOptions& options;
  unsigned hooks;
  Context context;
  double load = 0;
  double slip;  // asked for, before effects
  int evaluations = 0;
  double slope;  // d ln(load) / d ln(entry angle), kept from one search to the next

  WheelProblem(const SteadyWheel& w, const LocalSoil& l, const ContactAngles& a, const PointLaw& p, const SteadyOptions& o,
            unsigned h, const Operating& op)
      : wheel(w), local(l), angles(a), law(p), options(o), hooks(h), context(w.context(op)), slip(op.slip), slope(2.0 * l.n + 1.0) {}

  ContactShape shape(double entry) {
    ContactShape out{context.radius, slip, context.normal_load, 0.0};
    context.sinkage = out.radius * (1.0 - std::cos(entry));
    if (hooks & StressModifier::kContact) {
      context.slip = slip;
      for (const StressModifier* m : law.modifiers)
        if (m->hooks() & StressModifier::kContact) m->contact(context, out);
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
    Evaluator e{local, law, context, arc, law.modifiers.empty() && !law.pressure_law && !law.shear_law};
    const double area = arc.radius * context.width;
    // The integrals are in Pa; each panel may err by a share of tolerance * load / area.
    const Sums sums = order < 0 ? e.adaptive((law.modifiers.empty() ? 0.05 : 1.0) * quadrature_tolerance() * load / area) : e.integral(rules()[static_cast<std::size_t>(order)]);
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

  // Effects may bend the stress sharply (limits, layers): a thousand times the tolerance is still far below their size,
  // and spares the integrals of corners.
  double quadrature_tolerance() const { return options.tolerance * (law.modifiers.empty() ? 1.0 : 1e3); }

  double scaled_difference(const SteadyState& a, const SteadyState& b) const {
    return std::max({std::abs(a.normal_load - b.normal_load), std::abs(a.drawbar_pull - b.drawbar_pull),
                     std::abs(a.driving_torque - b.driving_torque) / context.radius}) /
           load;
  }

  // Root of load(entry) = load in log-log coordinates, where the curve is nearly straight; safeguarded by a bracket.
  SteadyState find(double guess, int order, double tolerance) {
    constexpr double kMax = 0.5 * std::numbers::pi;
    double lo = 0.0, hi = kMax;
    bool hi_checked = false;
    double x = std::clamp(guess, 1e-9, kMax);
    double last_x = 0, last_y = 0;
    bool have_last = false;
    SteadyState state;
    for (int i = 0; i < 200; ++i) {
      state = evaluate(x, order);
      if (!std::isfinite(state.normal_load)) throw RunError("steady wheel: the stresses are not finite; check the soil's parameters");
      const double excess = state.normal_load - load;
      if (std::abs(excess) <= tolerance * load) return state;
      if (excess > 0) {
        hi = x;
        hi_checked = true;
      } else {
        lo = x;
        if (x >= kMax)
          throw RunError(fmt::format("steady wheel: the soil does not carry {:.6g} N: with the wheel buried to its axle (sinkage {:.4g} m) "
                                     "it carries {:.6g} N at slip {:.4g}; lower the load or check k and n",
                                     load, state.sinkage, state.normal_load, context.slip));
      }
      if (hi - lo <= 4e-16 * hi) return state;
      double next;
      if (state.normal_load > 0) {
        const double y = std::log(state.normal_load / load);
        if (have_last && x != last_x) {
          const double s = (y - last_y) / std::log(x / last_x);
          if (s > 0.2 && s < 20) slope = s;
        }
        last_x = x;
        last_y = y;
        have_last = true;
        next = x * std::exp(-y / slope);
      } else {
        have_last = false;
        next = 2 * x;
      }
      if (!(next > lo) || next >= hi) {
        if (!hi_checked && next >= hi) next = kMax;
        else next = 0.5 * (lo + hi);
      } else if (i > 12) {
        next = 0.5 * (lo + hi);
      }
      x = next;
    }
    throw RunError(fmt::format("steady wheel: no entry angle found for {:.6g} N at slip {:.4g}", load, context.slip));
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
  WheelProblem problem(*this, local_, angles_, law_, options_, hooks_, operating);
  const ContactShape s0 = problem.shape(0.3);
  // Bekker's sinkage of a towed rigid wheel (1969) starts the search.
  const double kz = soil_.k / std::pow(soil_.plate_width, soil_.n);
  const double z0 = std::pow(3 * s0.normal_load / (wheel_.width * kz * std::max(0.2, 3 - soil_.n) * std::sqrt(2 * wheel_.radius)),
                             2 / (2 * soil_.n + 1));
  const double guess = std::acos(std::clamp(1 - z0 / wheel_.radius, 0.2, 1 - 1e-12));
  problem.load = s0.normal_load;
  // A coarse root first, then finer rules until two orders agree.
  const bool split = s0.slip < 0 && std::isfinite(s0.slip);  // four half-size panels need fewer points each
  int order = split ? 0 : 1;
  SteadyState state = problem.find(guess, 0, 1e-4);
  state = problem.find(state.entry_angle, order, 0.3 * options_.tolerance);
  for (;;) {
    const bool adaptive = order + 1 == static_cast<int>(kOrders.size());
    const SteadyState finer = problem.evaluate(state.entry_angle, adaptive ? -1 : order + 1);
    const double difference = problem.scaled_difference(state, finer);
    // Two rules of 40 points and more bracket a corner closely: what they differ by is already more than they err by.
    const double share = !law_.modifiers.empty() && order >= 4 ? 10.0 : 0.3;
    if (difference <= share * problem.quadrature_tolerance()) {
      state = finer;
      break;
    }
    if (adaptive) {
      state = problem.find(state.entry_angle, -1, 0.5 * problem.quadrature_tolerance());
      break;
    }
    // Rules far from resolving the stresses are skipped.
    order = std::min(static_cast<int>(kOrders.size()) - 1, order + (difference > 1e3 * problem.quadrature_tolerance() ? 2 : 1));
    state = problem.find(finer.entry_angle, order, 0.3 * options_.tolerance);
  }
  state.evaluations = problem.evaluations;
  return state;
}

SteadyState SteadyWheel::at_entry_angle(const Operating& operating, double entry_angle) const {
  throw_if_any(operating.validate());
  if (!(entry_angle > 0 && entry_angle <= 0.5 * std::numbers::pi))
    throw InputError(Problem{{}, 0, 0, "entry_angle", fmt::format("is {} rad", entry_angle), "above 0, at most pi/2"});
  WheelProblem problem(*this, local_, angles_, law_, options_, hooks_, operating);
  SteadyState state = problem.evaluate(entry_angle, -1);
  state.evaluations = problem.evaluations;
  return state;
}

void SteadyWheel::profile(const Operating& operating, const SteadyState& state, std::span<ProfilePoint> points) const {
  throw_if_any(operating.validate());
  WheelProblem problem(*this, local_, angles_, law_, options_, hooks_, operating);
  const ContactArc arc(problem.shape(state.entry_angle), angles_, options_.skid_shear, soil_.friction_angle, state.entry_angle);
  Evaluator e{local_, law_, problem.context, arc, law_.modifiers.empty() && !law_.pressure_law && !law_.shear_law};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double share = points.size() > 1 ? static_cast<double>(i) / static_cast<double>(points.size() - 1) : 0.5;
    e.at(arc.theta_r + (arc.theta_f - arc.theta_r) * share, &points[i]);
  }
}

}  // namespace terrode::bekker
