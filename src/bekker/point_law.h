// Stress at one point of a wheel's contact with the soil: what the steady wheel integrates and what every node of the
// node-spring terrain evaluates. Laws have names; missing-physics effects hook in as StressModifiers.
#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "bekker/soil.h"

namespace terrode::bekker {

// What all points of one wheel share at one instant.
struct Context {
  double slip = 0.0;              // s = 1 - v/(omega r); -infinity for a locked wheel
  double normal_load = 0.0;       // W, N
  double angular_velocity = 0.0;  // omega, rad/s
  double forward_velocity = 0.0;  // v, m/s
  double position = 0.0;          // x of the wheel centre along the travel, from its start, m
  double time = 0.0;              // s, from the start of the run
  int pass = 1;                   // how often this ground was driven over, this pass included
  double radius = 0.0;            // of the rim without lugs, m
  double width = 0.0;             // m
  double unit_weight = 0.0;       // of the soil, N/m3
  double sinkage = 0.0;           // of the lowest point of the rim, m
  double wheel_angle = 0.0;       // how far the wheel has turned, rad
  double travel_length = 0.0;     // length of the bin or of the whole run, m; 0 where unknown
  bool phase_average = false;     // true: not one instant but the mean of a run that has settled, over all phases
};

// One point of the contact. The depth is geometric; the effective sinkage that sets the pressure differs from it behind
// theta_m (Eqs. 6, 8).
struct Point {
  double sinkage = 0.0;            // effective z of Eq. 6, m, >= 0
  double depth = 0.0;              // below the undisturbed surface, m
  double theta = 0.0;              // angle from straight down, positive in front, rad
  double sin_theta = 0.0;
  double cos_theta = 1.0;
  double shear_displacement = 0.0; // |j|, m
  double slide_speed = 0.0;        // |v_s| of the rim along the soil, m/s
  double penetration_speed = 0.0;  // of the surface into the soil along its normal, at the point that set the pressure, m/s
  double entry_angle = 0.0;        // theta at which the wheel meets the soil, rad; 0 where the body is no wheel
};

// Soil parameters at one point, after effects and soil maps have changed them.
struct LocalSoil {
  double k, n, plate_width;         // Pa, -, m
  double cohesion, tan_phi;         // Pa, -
  double shear_modulus;             // K, m
  double unit_weight;               // gamma, N/m3

  LocalSoil() = default;
  explicit LocalSoil(const Soil& s)
      : k(s.k), n(s.n), plate_width(s.plate_width), cohesion(s.cohesion), tan_phi(std::tan(s.friction_angle)),
        shear_modulus(s.shear_modulus), unit_weight(s.unit_weight()) {}
};

// How the whole contact of one wheel lies, after effects have changed it.
struct ContactShape {
  double radius = 0.0;         // of the arc in contact, m
  double slip = 0.0;           // that the soil sees
  double normal_load = 0.0;    // that the soil carries, N
  double rear_fraction = 0.0;  // lambda of theta_r = -acos(1 - lambda z/r); 0: theta_r of the contact angles holds
};

// Stress on the wheel's surface [Pa]. `sigma` presses along the inward normal, `tau` (unsigned) acts along the tangent
// against sliding. Soil wedges push horizontally, per unit of the wheel's surface: `drive` forward with the torque of the
// rim's radius (soil behind a lug), `drag` backward through the axle, without torque (soil pushed in front).
struct Stress {
  double sigma = 0.0;
  double tau = 0.0;
  double drive = 0.0;
  double drag = 0.0;
};

// A change of the contact or of the stress at a point: what a missing-physics effect of the soil or wheel is to the
// models. Every hook has a null body; `hooks()` says which are to be called, so that the rest cost nothing. Modifiers
// act in the order in which they are given: contact and soil, then at each point pressure, shear, traction.
class StressModifier {
 public:
  enum Hook : unsigned { kContact = 1, kSoil = 2, kPressure = 4, kShear = 8, kTraction = 16, kShearCorner = 32, kLowestCorner = 64, kSoilAtPoint = 128 };
  virtual ~StressModifier() = default;
  virtual unsigned hooks() const = 0;
  // Changes the shape of the contact; called whenever the sinkage changes.
  virtual void contact(const Context&, ContactShape&) const {}
  // Changes the soil's parameters under the whole wheel, before any stress is known; asked once for all points.
  virtual void soil(const Context&, LocalSoil&) const {}
  // Puts in place the soil at a point, for ground that is not the same at all points; soil() of all modifiers acts on it.
  virtual void soil_at(const Context&, const Point&, LocalSoil&) const {}
  // Returns the changed normal stress [Pa].
  virtual double pressure(const Context&, const Point&, const LocalSoil&, double sigma) const { return sigma; }
  // Effective sinkage [m] at which what pressure() returns has a corner; infinity: none. Integrals end and begin there.
  virtual double corner() const { return std::numeric_limits<double>::infinity(); }
  // Of a shear() with a corner: a number that passes through zero there. Asked where hooks() has kShearCorner.
  virtual double shear_corner(const Context&, const Point&, const LocalSoil&, double /*sigma*/, double /*tau*/) const { return 1.0; }
  // Returns the changed shear stress [Pa]; `sigma` is final.
  virtual double shear(const Context&, const Point&, const LocalSoil&, double /*sigma*/, double tau) const { return tau; }
  // Adds to the stresses that come on top: drive and drag [Pa]; sigma and tau are final. hooks() has kLowestCorner where it
  // has a corner at theta = 0.
  virtual void traction(const Context&, const Point&, const LocalSoil&, Stress&) const {}
};

// Root of Rankine's coefficient of passive earth pressure: tan(45 deg + phi/2) = tan(phi) + 1/cos(phi) [-].
inline double passive_pressure_root(double tan_phi) { return tan_phi + std::sqrt(1.0 + tan_phi * tan_phi); }

// Pressure under a point at effective sinkage z >= 0 by a law of its own name; see pressure_laws.h.
class PressureLaw {
 public:
  virtual ~PressureLaw() = default;
  virtual const char* name() const = 0;
  virtual double pressure(const LocalSoil&, const Context&, double z) const = 0;  // Pa
};

// Share of the residual shear stress mobilised at shear displacement |j| >= 0; see shear_laws.h.
class ShearLaw {
 public:
  virtual ~ShearLaw() = default;
  virtual const char* name() const = 0;
  virtual double mobilised(const LocalSoil&, double j) const = 0;  // -
};

// The laws and effects in force. Null pointers mean the defaults: sigma = k (z/b)^n and Janosi-Hanamoto. The objects
// pointed to must outlive every use.
struct PointLaw {
  const PressureLaw* pressure_law = nullptr;
  const ShearLaw* shear_law = nullptr;
  std::span<const StressModifier* const> modifiers;
};

// sigma = k (z/b)^n (Smith et al. Eq. 5) [Pa].
inline double power_law_pressure(const LocalSoil& soil, double z) { return soil.k * std::pow(z / soil.plate_width, soil.n); }

// 1 - exp(-|j|/K) (Janosi & Hanamoto 1961; Eq. 9) [-]. (exp, not the slower expm1: the error is 1e-16 of tau_res.)
inline double janosi_mobilised(const LocalSoil& soil, double j) { return 1.0 - std::exp(-j / soil.shear_modulus); }

// A PointLaw whose modifiers are sorted by hook, for who asks at many points.
struct PreparedLaw {
  const PressureLaw* pressure_law = nullptr;
  const ShearLaw* shear_law = nullptr;
  std::vector<const StressModifier*> contact, soil, soil_at_point, pressure, shear, traction, shear_corners;
  bool plain = true;         // sigma = k (z/b)^n and Janosi-Hanamoto, nothing else
  bool plain_points = true;  // so at each point, for a soil and a contact that may be changed
  bool modified_points = false;
  bool lowest_corner = false;

  PreparedLaw() = default;
  explicit PreparedLaw(const PointLaw& law)
      : pressure_law(law.pressure_law), shear_law(law.shear_law), plain(law.modifiers.empty() && !law.pressure_law && !law.shear_law) {
    for (const StressModifier* m : law.modifiers) {
      const unsigned hooks = m->hooks();
      if (hooks & StressModifier::kContact) contact.push_back(m);
      if (hooks & StressModifier::kSoil) soil.push_back(m);
      if (hooks & StressModifier::kSoilAtPoint) soil_at_point.push_back(m);
      if (hooks & StressModifier::kPressure) pressure.push_back(m);
      if (hooks & StressModifier::kShear) shear.push_back(m);
      if (hooks & StressModifier::kTraction) traction.push_back(m);
      if (hooks & StressModifier::kShearCorner) shear_corners.push_back(m);
      lowest_corner = lowest_corner || (hooks & StressModifier::kLowestCorner);
    }
    modified_points = !(soil_at_point.empty() && pressure.empty() && shear.empty() && traction.empty());
    plain_points = !pressure_law && !shear_law && !modified_points;
  }
};

// The soil as it is under the wheel, after the modifiers that change its parameters; where it differs from point to point,
// as it was, to be changed there.
inline LocalSoil changed_soil(LocalSoil soil, const PreparedLaw& law, const Context& context) {
  if (law.soil_at_point.empty())
    for (const StressModifier* m : law.soil) m->soil(context, soil);
  return soil;
}

namespace detail {
// The soil at a point: the one given, or `own` where it differs from point to point.
inline const LocalSoil& soil_here(const LocalSoil& given, const PreparedLaw& law, const Context& context, const Point& point,
                                  LocalSoil& own) {
  if (law.soil_at_point.empty()) return given;
  own = given;
  for (const StressModifier* m : law.soil_at_point) m->soil_at(context, point, own);
  for (const StressModifier* m : law.soil) m->soil(context, own);
  return own;
}

// Stress at a point up to the shear modifier `end` (null: all of them, and traction).
inline Stress stress_up_to(const LocalSoil& given, const PreparedLaw& law, const Context& context, const Point& point,
                           const StressModifier* end) {
  LocalSoil own;
  const LocalSoil& soil = soil_here(given, law, context, point, own);
  Stress out;
  out.sigma = law.pressure_law ? law.pressure_law->pressure(soil, context, point.sinkage) : power_law_pressure(soil, point.sinkage);
  for (const StressModifier* m : law.pressure) out.sigma = m->pressure(context, point, soil, out.sigma);
  const double mobilised = law.shear_law ? law.shear_law->mobilised(soil, point.shear_displacement)
                                         : janosi_mobilised(soil, point.shear_displacement);
  out.tau = (soil.cohesion + out.sigma * soil.tan_phi) * mobilised;
  for (const StressModifier* m : law.shear) {
    if (m == end) return out;
    out.tau = m->shear(context, point, soil, out.sigma, out.tau);
  }
  for (const StressModifier* m : law.traction) m->traction(context, point, soil, out);
  return out;
}
}  // namespace detail

// Stress at a point of `soil` as changed_soil() gives it: laws first, then modifiers in order. Finite for finite input with
// z >= 0 and j >= 0 (j may be +infinity: fully mobilised). Cost: about 40 ns without modifiers.
inline Stress stress_in(const LocalSoil& soil, const PreparedLaw& law, const Context& context, const Point& point) {
  if (law.plain_points) {
    Stress out;
    out.sigma = power_law_pressure(soil, point.sinkage);
    out.tau = (soil.cohesion + out.sigma * soil.tan_phi) * janosi_mobilised(soil, point.shear_displacement);
    return out;
  }
  return detail::stress_up_to(soil, law, context, point, nullptr);
}

// The same from the soil before modifiers.
inline Stress stress_at(const LocalSoil& base, const PreparedLaw& law, const Context& context, const Point& point) {
  return stress_in(law.soil.empty() ? base : changed_soil(base, law, context), law, context, point);
}

// StressModifier::shear_corner() of one of law.shear_corners at a point of `soil` as changed_soil() gives it.
inline double shear_corner_in(const LocalSoil& soil, const PreparedLaw& law, const Context& context, const Point& point,
                              const StressModifier& of) {
  LocalSoil own;
  const Stress s = detail::stress_up_to(soil, law, context, point, &of);
  return of.shear_corner(context, point, detail::soil_here(soil, law, context, point, own), s.sigma, s.tau);
}

}  // namespace terrode::bekker
