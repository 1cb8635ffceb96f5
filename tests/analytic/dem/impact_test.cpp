// The eight impacts of Chung & Ooi (2011, Granular Matter 13, 643-656) against closed forms: Hertz (force, overlap,
// duration), the restitution asked for, and for oblique and spinning impacts the rigid-body solution of a contact that
// slides throughout, whose tangential impulse is mu times the normal one.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/simulation.h"

namespace terrode::dem {
namespace {

constexpr double hertz_tolerance = 2e-3;        // sampling of the maximum and of the end at 1/500 of the contact time
constexpr double restitution_tolerance = 2e-3;  // step size; the damped law's e is exact in the limit
constexpr double sliding_elastic_tolerance = 2e-3;
// A damped contact pulls while it ends (F_n is not clipped), and friction acts on |F_n|: the closed form takes the
// integral of |F_n|. The tangential dashpot adds to friction before the spring has reached the limit (default law) or
// delays the spring (cap on the sum): at e = 0.5 by up to a tenth, at e = 1 not at all.
constexpr double sliding_spin_tolerance = 4e-3;
constexpr double dashpot_share = 0.10;

struct Impact {
  Vec3 velocity_a, spin_a, velocity_b, spin_b;  // after; b only between two spheres
  double largest_force = 0.0, largest_overlap = 0.0, duration = 0.0;
  double friction_impulse = 0.0;  // integral of |F_n| over a's mass [m/s]
};

struct Case {
  Material material;
  double density, radius_a, radius_b = 0.0;  // radius_b 0: a rigid plane
  double restitution = 1.0, friction = 0.0;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  // of a, towards -z
  Vec3 velocity_b = Vec3::Zero(), spin_b = Vec3::Zero();
  std::string tangential = "mindlin";
};

void expect_sliding(double ratio, const Case& c, double spin) {
  EXPECT_NEAR(ratio, 1.0, c.restitution == 1.0 ? sliding_spin_tolerance : dashpot_share)
      << c.tangential << " spin " << spin << " e " << c.restitution;
}

double sphere_mass(double r, double density) { return density * 4.0 / 3.0 * std::numbers::pi * r * r * r; }

// The rigid plane gets a modulus a million times higher, so that Y_eff is the sphere's alone.
Impact run(const Case& c) {
  Settings s;
  s.gravity.setZero();
  s.time_step = 1.0;
  const double mass = sphere_mass(c.radius_a, c.density);
  const double r_eff = c.radius_b > 0 ? c.radius_a * c.radius_b / (c.radius_a + c.radius_b) : c.radius_a;
  const double mass_b = c.radius_b > 0 ? sphere_mass(c.radius_b, c.density) : 1e300;
  const double m_eff = 1.0 / (1.0 / mass + 1.0 / mass_b);
  const double y_one = c.material.young_modulus / (1 - c.material.poisson_ratio * c.material.poisson_ratio);
  const double y_eff = c.radius_b > 0 ? y_one / 2 : y_one;
  const double v = std::abs(c.velocity.z() - c.velocity_b.z());
  const double duration = 2.94 * std::pow(15.0 * m_eff / (16.0 * std::sqrt(r_eff) * y_eff) * v * v, 0.4) / v;
  s.time_step = duration / 500.0;
  Simulation sim(s);
  const int m = sim.add_material(c.material);
  Interaction law;
  law.rolling = "none";
  law.tangential = c.tangential;
  law.restitution = c.restitution;
  law.friction = c.friction;
  sim.set_interaction(m, m, law);
  const int a = sim.add_particle({Vec3(0, 0, c.radius_a), c.radius_a, c.density, c.velocity, c.spin, m});
  int b = -1;
  if (c.radius_b > 0) {
    b = sim.add_particle({Vec3(0, 0, -c.radius_b), c.radius_b, c.density, c.velocity_b, c.spin_b, m});
  } else {
    const int w = sim.add_material({"rigid", c.material.young_modulus * 1e6, c.material.poisson_ratio});
    sim.set_interaction(m, w, law);
    sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), w);
  }
  Impact out;
  bool touched = false;
  double before = c.velocity.z();
  for (int k = 0; k < 1500; ++k) {
    sim.run(1);
    const double now = sim.velocity(a).z();
    out.largest_force = std::max(out.largest_force, mass * (now - before) / s.time_step);
    const bool was = now != before;
    out.friction_impulse += std::abs(now - before);
    before = now;
    const double overlap = c.radius_b > 0 ? c.radius_a + c.radius_b - (sim.position(a) - sim.position(b)).norm()
                                          : c.radius_a - sim.position(a).z();
    out.largest_overlap = std::max(out.largest_overlap, overlap);
    if (was) {
      touched = true;
      out.duration += s.time_step;
    } else if (touched) {
      break;
    }
  }
  out.velocity_a = sim.velocity(a);
  out.spin_a = sim.spin(a);
  if (b >= 0) {
    out.velocity_b = sim.velocity(b);
    out.spin_b = sim.spin(b);
  }
  return out;
}

void expect_hertz(const Case& c, const char* what) {
  SCOPED_TRACE(what);
  const Impact i = run(c);
  const double mass = sphere_mass(c.radius_a, c.density);
  const bool pair = c.radius_b > 0;
  const double m_eff = pair ? mass / 2 : mass, r_eff = pair ? c.radius_a / 2 : c.radius_a;
  const double y_one = c.material.young_modulus / (1 - c.material.poisson_ratio * c.material.poisson_ratio);
  const double y_eff = pair ? y_one / 2 : y_one, v = std::abs(c.velocity.z() - c.velocity_b.z());
  const double overlap = std::pow(15.0 * m_eff * v * v / (16.0 * y_eff * std::sqrt(r_eff)), 0.4);
  const double force = 4.0 / 3.0 * y_eff * std::sqrt(r_eff) * std::pow(overlap, 1.5);
  EXPECT_NEAR(i.largest_overlap / overlap, 1.0, hertz_tolerance);
  EXPECT_NEAR(i.largest_force / force, 1.0, hertz_tolerance);
  EXPECT_NEAR(i.duration / (2.9432 * overlap / v), 1.0, 2 * hertz_tolerance);
  EXPECT_NEAR(i.velocity_a.z() / -c.velocity.z(), 1.0, hertz_tolerance);
}

const Material glass{"glass", 4.8e10, 0.20}, limestone{"limestone", 2.0e10, 0.25};
const Material aluminium{"aluminium alloy", 7.0e10, 0.33}, magnesium{"magnesium alloy", 4.0e10, 0.35};
const Material aluminium_oxide{"aluminium oxide", 3.8e11, 0.23}, cast_iron{"cast iron", 1.12e11, 0.25};
const Material steel{"steel", 2.08e11, 0.30}, copper{"copper", 1.2e11, 0.35};

TEST(ChungOoi, Test1ElasticNormalImpactOfTwoIdenticalSpheres) {
  Case c{glass, 2800, 0.010, 0.010};
  c.velocity = Vec3(0, 0, -10);
  c.velocity_b = Vec3(0, 0, 10);
  expect_hertz(c, "glass");
  c.material = limestone;
  c.density = 2500;
  expect_hertz(c, "limestone");
}

TEST(ChungOoi, Test2ElasticNormalImpactOnARigidPlane) {
  Case c{aluminium, 2699, 0.1};
  c.velocity = Vec3(0, 0, -0.2);
  expect_hertz(c, "aluminium");
  c.material = magnesium;
  c.density = 1800;
  expect_hertz(c, "magnesium");
}

TEST(ChungOoi, Test3NormalImpactRealisesTheRestitutionAskedFor) {
  for (const Material& m : {aluminium_oxide, cast_iron})
    for (const double e : {0.06, 0.2, 0.4, 0.6, 0.8, 0.98, 1.0}) {
      Case c{m, m.name == "cast iron" ? 7000.0 : 4000.0, 0.0025};
      c.restitution = e;
      c.velocity = Vec3(0, 0, -3.9);
      EXPECT_NEAR(run(c).velocity_a.z() / 3.9, e, restitution_tolerance) << m.name << " " << e;
    }
}

TEST(ChungOoi, Test4ObliqueImpactAtConstantSpeed) {
  // Sliding throughout where tan(angle) > 7/2 mu (1 + e): here above 32.5 degrees.
  for (const double degrees : {40.0, 50.0, 60.0, 70.0, 80.0}) {
    const double angle = degrees * std::numbers::pi / 180, e = 0.98, mu = 0.092, r = 0.0025;
    Case c{aluminium_oxide, 4000, r};
    c.restitution = e;
    c.friction = mu;
    c.velocity = 3.9 * Vec3(std::sin(angle), 0, -std::cos(angle));
    const Impact i = run(c);
    const double impulse = (1 + e) * 3.9 * std::cos(angle);
    EXPECT_NEAR(i.velocity_a.z(), e * 3.9 * std::cos(angle), restitution_tolerance * 3.9) << degrees;
    EXPECT_NEAR((c.velocity.x() - i.velocity_a.x()) / (mu * impulse), 1.0, sliding_elastic_tolerance * 2) << degrees;
    EXPECT_NEAR(i.spin_a.y() / (2.5 * mu * impulse / r), 1.0, sliding_elastic_tolerance * 2) << degrees;
  }
}

TEST(ChungOoi, Test5ObliqueImpactAtConstantNormalVelocity) {
  // Steel sphere of 10 um, 5 m/s normal; normalised incidence psi = vt/(mu vn) from sticking to sliding. Sliding
  // throughout above psi = 7: the rebound of the contact point is psi - 7. Below it the
  // contact sticks for a while, and the contact point rebounds against its approach (Maw et al. 1976).
  const double mu = 0.3, vn = 5, r = 1e-5;
  for (const double psi : {8.0, 10.0, 14.0}) {
    Case c{steel, 7850, r};
    c.friction = mu;
    c.velocity = Vec3(psi * mu * vn, 0, -vn);
    const Impact i = run(c);
    const double contact_point = i.velocity_a.x() - r * i.spin_a.y();
    EXPECT_NEAR(contact_point / (mu * vn), psi - 7.0, 7.0 * 2 * sliding_elastic_tolerance) << psi;
    EXPECT_NEAR(i.spin_a.y() * r / (2.5 * mu * 2 * vn), 1.0, 2 * sliding_elastic_tolerance) << psi;
  }
  Case c{steel, 7850, r};
  c.friction = mu;
  c.velocity = Vec3(4.0 * mu * vn, 0, -vn);
  const Impact i = run(c);
  EXPECT_LT(i.velocity_a.x() - r * i.spin_a.y(), 0.0);
}

TEST(ChungOoi, Test6SpinningImpactOnARigidPlane) {
  const double mu = 0.4, v = 0.2, r = 0.1;
  for (const double e : {1.0, 0.5})
    for (const char* tangential : {"mindlin", "mindlin_capped_sum"})
      for (const double spin : {15.0, 25.0, 40.0}) {
        const Material& m = spin == 25.0 ? copper : aluminium;
        Case c{m, m.name == "copper" ? 8900.0 : 2700.0, r};
        c.tangential = tangential;
        c.restitution = e;
        c.friction = mu;
        c.velocity = Vec3(0, 0, -v);
        c.spin = Vec3(0, spin, 0);
        const Impact i = run(c);
        const double impulse = i.friction_impulse;
        EXPECT_NEAR(i.velocity_a.z() / v, e, restitution_tolerance);
        expect_sliding(i.velocity_a.x() / (mu * impulse), c, spin);
        expect_sliding((spin - i.spin_a.y()) / (2.5 * mu * impulse / r), c, spin);
        // Angular momentum about the contact point does not change: r m vx + I w.
        EXPECT_NEAR(i.velocity_a.x() + 0.4 * r * i.spin_a.y(), 0.4 * r * spin, 1e-3 * 0.4 * r * spin);
      }
}

TEST(ChungOoi, Test7ObliqueImpactOfTwoIdenticalSpinningSpheres) {
  const double mu = 0.4, v = 0.2, r = 0.1;
  for (const double e : {1.0, 0.5})
    for (const char* tangential : {"mindlin", "mindlin_capped_sum"})
      for (const double spin : {15.0, 25.0, 40.0}) {
        Case c{aluminium, 2700, r, r};
        c.tangential = tangential;
        c.restitution = e;
        c.friction = mu;
        c.velocity = Vec3(0, 0, -v);
        c.velocity_b = Vec3(0, 0, v);
        c.spin = c.spin_b = Vec3(0, spin, 0);
        const Impact i = run(c);
        const double impulse = i.friction_impulse;
        expect_sliding(i.velocity_a.x() / (mu * impulse), c, spin);
        expect_sliding((spin - i.spin_a.y()) / (2.5 * mu * impulse / r), c, spin);
        EXPECT_NEAR(i.velocity_a.x() + i.velocity_b.x(), 0.0, 1e-12);  // momentum
        EXPECT_NEAR(i.spin_a.y() - i.spin_b.y(), 0.0, 1e-9);           // symmetry
      }
}

TEST(ChungOoi, Test8ImpactOfUnequalSpinningSpheres) {
  const double mu = 0.4, v = 0.2, r = 0.1, big = 0.5;
  for (const double e : {1.0, 0.5})
    for (const char* tangential : {"mindlin", "mindlin_capped_sum"})
      for (const double spin : {15.0, 25.0, 40.0}) {
        Case c{copper, 8900, r, big};
        c.tangential = tangential;
        c.restitution = e;
        c.friction = mu;
        c.velocity = Vec3(0, 0, -v);
        c.spin = Vec3(0, spin, 0);
        const Impact i = run(c);
        const double ma = sphere_mass(r, 8900), mb = sphere_mass(big, 8900);
        const double impulse = ma * i.friction_impulse;
        EXPECT_NEAR((i.velocity_a.z() - i.velocity_b.z()) / v, e, restitution_tolerance);
        expect_sliding(ma * i.velocity_a.x() / (mu * impulse), c, spin);
        expect_sliding((spin - i.spin_a.y()) / (2.5 * mu * impulse / (ma * r)), c, spin);
        expect_sliding(-i.spin_b.y() / (2.5 * mu * impulse / (mb * big)), c, spin);
        EXPECT_NEAR(ma * i.velocity_a.x() + mb * i.velocity_b.x(), 0.0, 1e-12 * ma);
      }
}

TEST(Rolling, SphereRollsToRestWithTheAnalyticDeceleration) {
  // A sphere that rolls without slip under a rolling torque mu_r R m g slows by 5/7 mu_r g.
  constexpr double deceleration_tolerance = 1e-3;  // of the deceleration; small elastic creep at the start
  for (const char* model : {"epsd", "epsd2", "cdt"}) {
    Settings s;
    s.time_step = 2e-6;
    Simulation sim(s);
    const int m = sim.add_material({});
    Interaction law;
    law.rolling = model;
    law.rolling_friction = 0.02;
    sim.set_interaction(m, m, law);
    const double r = 0.005, mass = sphere_mass(r, 3090), v = 0.1;
    const double y = make_pair_law({}, {}, law).young_eff;
    const double sag = std::pow(mass * 9.81 / (4.0 / 3.0 * y * std::sqrt(r)), 2.0 / 3.0);
    sim.add_particle({Vec3(0, 0, r - sag), r, 3090, Vec3(v, 0, 0), Vec3(0, v / r, 0), m});
    sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0.0), m);
    const double slowing = 5.0 / 7.0 * 0.02 * 9.81;
    sim.run(50000);
    // epsd's dashpot acts until its spring has reached the limit, a jolt within the first milliseconds.
    const double v1 = sim.velocity(0).x(), x1 = sim.position(0).x();
    sim.run(150000);
    const double v2 = sim.velocity(0).x();
    EXPECT_NEAR((v1 - v2) / 0.3 / slowing, 1.0, deceleration_tolerance) << model;
    if (model == std::string("epsd")) {
      sim.run(300000);  // the stop is due at 0.67 s
      const double way = v1 * v1 / (2 * slowing);
      EXPECT_NEAR(sim.position(0).x() - x1, way, 0.005 * way);  // it rocks back a little, elastically
      EXPECT_LT(std::abs(sim.velocity(0).x()), 1e-4 * v);
    }
  }
}

}  // namespace
}  // namespace terrode::dem
