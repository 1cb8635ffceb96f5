// The node-spring ground against closed forms: plates, layers, ruts, slip angles, slopes, lugs, reversal, energy.
#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "bekker/bulldozing.h"
#include "bench_rig.h"
#include "core/parallel.h"
#include "terrain/node_spring.h"
#include "terrain/surfaces.h"
#include "wheel/convex.h"

namespace terrode {
namespace {

using terrain::ContactResult;
using terrain::NodeSpringParams;
using terrain::NodeSpringTerrain;

constexpr double kRadius = 0.13, kWidth = 0.16, kOmega = 0.3;

double simpson(const std::function<double(double)>& f, double a, double b, int n = 4000) {
  double sum = f(a) + f(b);
  for (int i = 1; i < n; ++i) sum += (i % 2 ? 4 : 2) * f(a + (b - a) * i / n);
  return sum * (b - a) / (3 * n);
}

std::shared_ptr<const wheel::Body> smooth_wheel() {
  return std::make_shared<wheel::Wheel>(wheel::WheelShape{kRadius, kWidth, 0.0, {}});
}

double pressure(const bekker::Soil& s, double z) { return s.k * std::pow(z / s.plate_width, s.n); }

// ---- plates ----

ContactResult press_plate(NodeSpringTerrain& ground, terrain::BodyId id, double z, double x = 0, double y = 0, double yaw = 0) {
  Pose pose;
  pose.p_W = Vec3(x, y, 0.01 - z);
  pose.R_WB = Eigen::AngleAxisd(yaw, Vec3::UnitZ());
  ground.begin_step(0, 1e-3);
  const ContactResult r = ground.wrench(id, pose, {});
  ground.end_step();
  return r;
}

TEST(Plate, SinksByThePressureLaw) {
  const NodeSpringParams params;
  for (const auto& [x, y, yaw] : {std::array{0.0, 0.0, 0.0}, std::array{0.0013, -0.0021, 0.0}, std::array{0.0, 0.001, 0.4}}) {
    NodeSpringTerrain ground(params);
    const auto id = ground.add_body(wheel::make_box(0.05, 0.15, 0.02));
    for (const double z : {0.002, 0.005, 0.01, 0.02}) {
      const ContactResult r = press_plate(ground, id, z, x, y, yaw);
      const double expected = pressure(params.soil, z) * 0.05 * 0.15;
      // Edges are resolved to an eighth of a node: at most 1/16 of 5 mm along each side, and far less on average.
      const double close = yaw == 0 && x == 0 ? 1e-9 : 0.015;
      EXPECT_NEAR(r.wrench.F_W.z(), expected, close * expected);
      EXPECT_NEAR(r.max_sinkage, z, 1e-12);
    }
  }
}

TEST(Plate, UnloadsAndReloadsAlongWongsLine) {
  NodeSpringParams params;
  params.unloading = terrain::Unloading::elastic_plastic;
  params.unloading_k0 = 5e6;
  params.unloading_au = 5e8;
  NodeSpringTerrain ground(params);
  const auto id = ground.add_body(wheel::make_box(0.05, 0.15, 0.02));
  const double z = 0.01, area = 0.05 * 0.15, top = press_plate(ground, id, z).wrench.F_W.z();
  const double stiffness = (params.unloading_k0 + params.unloading_au * z) * area;
  for (const double up : {0.0002, 0.0005, 0.0002, 0.0}) {  // down, up and back on one line
    EXPECT_NEAR(press_plate(ground, id, z - up).wrench.F_W.z(), top - stiffness * up, 1e-9 * top) << up;
  }
  EXPECT_EQ(press_plate(ground, id, z - 0.005).wrench.F_W.z(), 0.0);
  EXPECT_EQ(press_plate(ground, id, -0.001).wrench.F_W.z(), 0.0);
  // Lifted off and set down again: nothing until the rebound's depth, the same line up to the old depth, the law beyond.
  const double rebound = top / stiffness;
  EXPECT_EQ(press_plate(ground, id, z - rebound - 1e-4).wrench.F_W.z(), 0.0);
  EXPECT_NEAR(press_plate(ground, id, z - 0.5 * rebound).wrench.F_W.z(), 0.5 * top, 0.02 * top);
  EXPECT_NEAR(press_plate(ground, id, 0.012).wrench.F_W.z(), pressure(params.soil, 0.012) * area, 1e-9 * top);
}

TEST(Plate, FeelsLayersAndPatchesOfSoil) {
  bekker::Soil soft, hard;
  soft.k = 8e4;
  hard.k = 9e5;
  hard.n = 0.9;
  const auto layers = std::make_shared<terrain::LayeredSoil>(std::vector<terrain::SoilLayer>{{0.008, soft}, {0, hard}});
  NodeSpringParams params;
  params.soil = soft;
  NodeSpringTerrain ground(params, {}, nullptr, layers);
  const auto id = ground.add_body(wheel::make_box(0.05, 0.15, 0.02));
  for (const double z : {0.004, 0.008, 0.0081, 0.015}) {
    const double p = z <= 0.008 ? pressure(soft, z) : pressure(soft, 0.008) + pressure(hard, z) - pressure(hard, 0.008);
    EXPECT_NEAR(press_plate(ground, id, z).wrench.F_W.z(), p * 0.05 * 0.15, 1e-9 * p) << z;
  }
  const auto map = std::make_shared<terrain::SoilMap>(std::vector<terrain::SoilPatch>{{1.0, -1.0, 2.0, 1.0, hard}});
  NodeSpringTerrain patched(params, {}, nullptr, map);
  const auto a = patched.add_body(wheel::make_box(0.05, 0.15, 0.02)), b = patched.add_body(wheel::make_box(0.05, 0.15, 0.02));
  EXPECT_NEAR(press_plate(patched, a, 0.01).wrench.F_W.z(), pressure(soft, 0.01) * 0.0075, 1e-6);
  EXPECT_NEAR(press_plate(patched, b, 0.01, 1.5).wrench.F_W.z(), pressure(hard, 0.01) * 0.0075, 1e-6);
  EXPECT_THROW(terrain::SoilMap({{1, 1, 0, 0, soft}}), InputError);
}

TEST(Plate, ShearsBySlidingAndRecoversOnReversal) {
  const NodeSpringParams params;
  NodeSpringTerrain ground(params);
  const auto id = ground.add_body(wheel::make_box(0.1, 0.1, 0.02));
  const double z = 0.005, area = 0.01, sigma = pressure(params.soil, z);
  const double limit = area * (params.soil.cohesion + sigma * std::tan(params.soil.friction_angle));
  press_plate(ground, id, z);
  for (int i = 1; i <= 40; ++i) {
    const double j = i * 5e-5;
    const ContactResult r = press_plate(ground, id, z, j);
    // Nodes along the edges change as the plate slides on: one in twenty.
    EXPECT_NEAR(-r.wrench.F_W.x(), limit * (1 - std::exp(-j / params.soil.shear_modulus)), 0.05 * limit) << j;
  }
}

// ---- wheels at a given depth ----

struct Motion {
  double slip = 0.3, sinkage = 0.01, slip_angle = 0.0, travel = 0.12, step = 1e-3;
  double from = 0.0, y = 0.0, direction = 1.0;  // direction -1: drives backwards
};

ContactResult roll(NodeSpringTerrain& ground, terrain::BodyId id, const Motion& m, int average = 40) {
  const double v = (1 - m.slip) * kOmega * kRadius * m.direction, w = kOmega * m.direction;
  const int steps = static_cast<int>(m.travel / std::abs(v) / m.step);
  Twist twist;
  twist.v_W = Vec3(v, v * std::tan(m.slip_angle) * m.direction, 0);
  twist.w_W = Vec3(0, w, 0);
  ContactResult mean;
  for (int i = 0; i < steps; ++i) {
    const double t = i * m.step;
    Pose pose;
    pose.p_W = Vec3(m.from, m.y, kRadius - m.sinkage) + t * twist.v_W;
    pose.R_WB = Eigen::AngleAxisd(w * t, Vec3::UnitY());
    ground.begin_step(t, m.step);
    const ContactResult r = ground.wrench(id, pose, twist);
    ground.end_step();
    if (i < steps - average) continue;
    mean.wrench += r.wrench * (1.0 / average);
    mean.plastic_power += r.plastic_power / average;
    mean.slip_power += r.slip_power / average;
    mean.compaction_resistance += r.compaction_resistance / average;
  }
  return mean;
}

TEST(SlipAngle, LateralForceFollowsTheClosedForm) {
  for (const double beta : {0.05, 0.2, 0.4, -0.2}) {
    NodeSpringParams params;
    params.soil.shear_modulus = 5e-3;
    Motion m;
    m.slip_angle = beta;
    NodeSpringTerrain ground(params);
    const ContactResult r = roll(ground, ground.add_body(smooth_wheel()), m);
    const double theta_f = std::acos(1 - m.sinkage / kRadius), theta_m = (params.angles.a0 + params.angles.a1 * m.slip) * theta_f;
    const auto tau = [&](double th, bool side) {
      const double e = th >= theta_m ? th : theta_f - (theta_f - theta_m) * th / theta_m;
      const double sigma = pressure(params.soil, std::max(0.0, kRadius * (std::cos(e) - std::cos(theta_f))));
      const double jx = kRadius * ((theta_f - th) - (1 - m.slip) * (std::sin(theta_f) - std::sin(th)));
      const double jy = kRadius * (1 - m.slip) * (theta_f - th) * std::tan(beta), j = std::hypot(jx, jy);
      const double t = (params.soil.cohesion + sigma * std::tan(params.soil.friction_angle)) *
                       (1 - std::exp(-j / params.soil.shear_modulus));
      return j > 0 ? t * (side ? jy : jx) / j : 0.0;
    };
    const double side = -kRadius * kWidth * simpson([&](double th) { return tau(th, true); }, 0, theta_f);
    const double torque = kRadius * kRadius * kWidth * simpson([&](double th) { return tau(th, false); }, 0, theta_f);
    constexpr double close = 0.01;
    EXPECT_NEAR(r.wrench.F_W.y(), side, close * std::abs(side)) << beta;
    EXPECT_NEAR(-r.wrench.M_W.y(), torque, close * torque) << beta;
  }
}

TEST(SlipAngle, SideWallsPushTheirWedge) {
  NodeSpringParams params;
  Motion m;
  m.slip_angle = 0.3;
  NodeSpringTerrain bare(params);
  params.side_wall = terrain::SideWall::hegedus;
  NodeSpringTerrain walled(params);
  const double without = roll(bare, bare.add_body(smooth_wheel()), m).wrench.F_W.y();
  const double with = roll(walled, walled.add_body(smooth_wheel()), m).wrench.F_W.y();
  const double theta_f = std::acos(1 - m.sinkage / kRadius);
  const double wedge = simpson(
      [&](double th) {
        const double h = kRadius * (std::cos(th) - std::cos(theta_f));
        const double jy = kRadius * (1 - m.slip) * (theta_f - th) * std::tan(m.slip_angle);
        return bekker::bulldozing_resistance(params.soil.cohesion, std::tan(params.soil.friction_angle), params.soil.unit_weight(), h) *
               (1 - std::exp(-jy / params.soil.shear_modulus)) * kRadius * std::cos(th);
      },
      0, theta_f);
  EXPECT_NEAR(without - with, wedge, 0.03 * wedge);
  m.slip_angle = 0;  // straight ahead the walls do nothing
  NodeSpringTerrain straight(params);
  EXPECT_NEAR(roll(straight, straight.add_body(smooth_wheel()), m).wrench.F_W.y(), 0.0, 1e-6);
}

TEST(Rut, ASecondPassAtTheSameLoadSinksALittleFurther) {
  // Where pressure follows the sinkage directly, a wheel in a rut of depth z1 that carries W satisfies
  // W = r b int p(z1 + r (cos - cos theta_f)) cos + tau sin.
  NodeSpringParams params;
  params.distribution = terrain::PressureDistribution::sinkage;
  params.springback = 2e-5;
  NodeSpringTerrain ground(params);
  const auto id = ground.add_body(smooth_wheel());
  test::RigRun run;
  run.slip = 0.2;
  run.duration = 9.0;
  run.average = 1.0;
  const auto first = test::drive(ground, id, kRadius, run);
  const auto next = ground.add_body(smooth_wheel());
  run.start_x = 0.05;
  run.duration = 6.0;
  run.start_sinkage = first.sinkage - 1e-4;
  const auto second = test::drive(ground, next, kRadius, run, 100.0);
  const double z1 = first.sinkage, s = run.slip;
  const auto load = [&](double deeper) {
    const double tf = std::acos(1 - deeper / kRadius);
    return kRadius * kWidth * simpson(
                                  [&](double th) {
                                    const double sigma = pressure(params.soil, z1 + kRadius * (std::cos(th) - std::cos(tf)));
                                    const double j = kRadius * ((tf - th) - (1 - s) * (std::sin(tf) - std::sin(th)));
                                    const double tau = (params.soil.cohesion + sigma * std::tan(params.soil.friction_angle)) *
                                                       (1 - std::exp(-j / params.soil.shear_modulus));
                                    return sigma * std::cos(th) + tau * std::sin(th);
                                  },
                                  0, tf, 400);
  };
  double lo = 1e-6, hi = z1;
  for (int i = 0; i < 60; ++i) (load(0.5 * (lo + hi)) < run.load ? lo : hi) = 0.5 * (lo + hi);
  const double deeper = second.sinkage - first.sinkage;
  // The springback delays the rise of pressure at the entry by its own length.
  EXPECT_NEAR(deeper, 0.5 * (lo + hi), 0.03 * lo + params.springback);
  EXPECT_EQ(ground.grid().find(ground.grid().nearest(0.1, 0.0))->passes, 2);
}

TEST(Towed, AFreelyRollingWheelTurnsSlowerThanItsTravelAndIsHeldBack) {
  // The slip at which the torque vanishes lies below zero, and the wheel must be pulled there.
  const NodeSpringParams params;
  double lo = -0.3, hi = 0.1;
  double pull = 0;
  for (int i = 0; i < 12; ++i) {
    Motion m;
    m.slip = 0.5 * (lo + hi);
    NodeSpringTerrain ground(params);
    const ContactResult r = roll(ground, ground.add_body(smooth_wheel()), m);
    (-r.wrench.M_W.y() < 0 ? lo : hi) = m.slip;
    pull = r.wrench.F_W.x();
  }
  EXPECT_GT(lo, -0.15);
  EXPECT_LT(hi, 0.0);
  EXPECT_LT(pull, 0.0);
}

TEST(Slope, AWheelAlongASlopeFeelsTheFlatGroundTurned) {
  NodeSpringParams params;
  Motion m;
  NodeSpringTerrain flat(params);
  const ContactResult level = roll(flat, flat.add_body(smooth_wheel()), m);
  for (const double alpha : {0.2, -0.15}) {
    NodeSpringTerrain ground(params, {}, std::make_shared<terrain::SlopeSurface>(alpha));
    const auto id = ground.add_body(smooth_wheel());
    const Quat turn(Eigen::AngleAxisd(-alpha, Vec3::UnitY()));
    const double v = (1 - m.slip) * kOmega * kRadius;
    const int steps = static_cast<int>(m.travel / v / m.step);
    Wrench mean;
    for (int i = 0; i < steps; ++i) {
      const double t = i * m.step;
      Pose pose;
      pose.p_W = turn * Vec3(v * t, 0, kRadius - m.sinkage);
      pose.R_WB = turn * Quat(Eigen::AngleAxisd(kOmega * t, Vec3::UnitY()));
      Twist twist;
      twist.v_W = turn * Vec3(v, 0, 0);
      twist.w_W = Vec3(0, kOmega, 0);
      ground.begin_step(t, m.step);
      const ContactResult r = ground.wrench(id, pose, twist);
      ground.end_step();
      if (i >= steps - 40) mean += r.wrench * (1.0 / 40);
    }
    const Vec3 F = turn.conjugate() * mean.F_W;
    constexpr double ripple = 0.01;
    EXPECT_NEAR(F.x(), level.wrench.F_W.x(), ripple * level.wrench.F_W.z()) << alpha;
    EXPECT_NEAR(F.z(), level.wrench.F_W.z(), ripple * level.wrench.F_W.z()) << alpha;
    EXPECT_NEAR(mean.M_W.y(), level.wrench.M_W.y(), ripple * std::abs(level.wrench.M_W.y()));
  }
}

TEST(Shapes, RaysGiveWhatTheClosedFormGives) {
  // A crown of a kilometre's radius is a cylinder, and goes the general way.
  const NodeSpringParams params;
  NodeSpringTerrain a(params), b(params);
  const ContactResult plain = roll(a, a.add_body(smooth_wheel()), {});
  const ContactResult crowned = roll(b, b.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{kRadius, kWidth, 1000.0, {}})), {});
  constexpr double close = 0.01;
  EXPECT_NEAR(crowned.wrench.F_W.z(), plain.wrench.F_W.z(), close * plain.wrench.F_W.z());
  EXPECT_NEAR(crowned.wrench.F_W.x(), plain.wrench.F_W.x(), close * plain.wrench.F_W.z());
  EXPECT_NEAR(crowned.wrench.M_W.y(), plain.wrench.M_W.y(), close * std::abs(plain.wrench.M_W.y()));
}

TEST(Shapes, ACrownCarriesLessAtTheSameDepthAndLugsRippleAtTheirRate) {
  const NodeSpringParams params;
  NodeSpringTerrain a(params), b(params), c(params);
  const ContactResult plain = roll(a, a.add_body(smooth_wheel()), {});
  const ContactResult crowned = roll(b, b.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{kRadius, kWidth, 0.4, {}})), {});
  EXPECT_LT(crowned.wrench.F_W.z(), 0.9 * plain.wrench.F_W.z());
  wheel::WheelShape lugged{kRadius, kWidth, 0.0, {24, 0.01, 0.008, 0.0, wheel::GrouserShape::straight, 0.0}};
  const auto id = c.add_body(std::make_shared<wheel::Wheel>(lugged));
  // Two turns of one lug's pitch, sampled: the same at the same phase, and different between.
  const double v = 0.7 * kOmega * kRadius, pitch = 2 * std::numbers::pi / 24 / kOmega, h = 1e-3;
  std::vector<double> pull;
  for (int i = 0; i * h < 6 * pitch; ++i) {
    Pose pose;
    pose.p_W = Vec3(v * i * h, 0, kRadius - 0.008);
    pose.R_WB = Eigen::AngleAxisd(kOmega * i * h, Vec3::UnitY());
    Twist twist;
    twist.v_W = Vec3(v, 0, 0);
    twist.w_W = Vec3(0, kOmega, 0);
    c.begin_step(i * h, h);
    pull.push_back(c.wrench(id, pose, twist).wrench.F_W.z());
    c.end_step();
  }
  const auto period = static_cast<std::size_t>(std::lround(pitch / h));
  double same = 0, half = 0, spread = 0, mean = 0;
  const std::size_t n = pull.size();
  for (std::size_t i = n - period; i < n; ++i) mean += pull[i] / static_cast<double>(period);
  for (std::size_t i = n - period; i < n; ++i) {
    spread += std::pow(pull[i] - mean, 2);
    same += std::pow(pull[i] - pull[i - period], 2);
    half += std::pow(pull[i] - pull[i - period / 2], 2);
  }
  EXPECT_GT(std::sqrt(spread / static_cast<double>(period)), 0.02 * mean);
  EXPECT_LT(same, 0.5 * half);
}

TEST(Reversal, DrivingBackwardsIsTheMirrorImage) {
  const NodeSpringParams params;
  NodeSpringTerrain a(params), b(params);
  Motion m;
  const ContactResult forward = roll(a, a.add_body(smooth_wheel()), m);
  m.direction = -1;
  const ContactResult backward = roll(b, b.add_body(smooth_wheel()), m);
  EXPECT_NEAR(backward.wrench.F_W.x(), -forward.wrench.F_W.x(), 1e-6 * forward.wrench.F_W.z());
  EXPECT_NEAR(backward.wrench.F_W.z(), forward.wrench.F_W.z(), 1e-6 * forward.wrench.F_W.z());
  EXPECT_NEAR(backward.wrench.M_W.y(), -forward.wrench.M_W.y(), 1e-6);
}

TEST(Limits, LockedAndSpinningWheelsAreFinite) {
  const NodeSpringParams params;
  for (const bool locked : {true, false}) {
    NodeSpringTerrain ground(params);
    const auto id = ground.add_body(smooth_wheel());
    Twist twist;
    twist.v_W.x() = locked ? 0.03 : 0.0;
    twist.w_W.y() = locked ? 0.0 : 0.3;
    ContactResult r;
    for (int i = 0; i < 3000; ++i) {
      Pose pose;
      pose.p_W = Vec3(0, 0, kRadius - 0.01) + i * 1e-3 * twist.v_W;
      pose.R_WB = Eigen::AngleAxisd(i * 1e-3 * twist.w_W.y(), Vec3::UnitY());
      ground.begin_step(i * 1e-3, 1e-3);
      r = ground.wrench(id, pose, twist);
      ground.end_step();
    }
    ASSERT_TRUE(r.wrench.F_W.allFinite());
    EXPECT_GT(r.wrench.F_W.z(), 0);
    EXPECT_GT(r.slip_power, 0);
    if (locked) {
      EXPECT_LT(r.wrench.F_W.x(), 0);
      EXPECT_GT(r.wrench.M_W.y(), 0);
    } else {
      EXPECT_LT(r.wrench.M_W.y(), 0);
    }
  }
}

// How hard an undamped bed rings depends on how the wheel touched down; that it rings an order of magnitude harder than a
// plastic one, and goes on ringing, does not.
TEST(Springs, ElasticOnesRingAndPlasticOnesDoNot) {
  const auto ripple = [](terrain::Unloading unloading, double duration) {
    NodeSpringParams params;
    params.unloading = unloading;
    params.unloading_k0 = 1e8;
    params.spacing = 0.01;
    NodeSpringTerrain ground(params);
    test::RigRun run;
    run.step = 2e-4;
    run.duration = duration;
    run.average = 0.3;
    run.implicit = false;
    return test::drive(ground, ground.add_body(smooth_wheel()), kRadius, run).normal_ripple / run.load;
  };
  // The wheel drops onto the ground; elastic-plastic soil rebounds by its law and comes to rest within two seconds.
  const double elastic = ripple(terrain::Unloading::elastic, 2.5);
  for (const auto unloading : {terrain::Unloading::rigid_plastic, terrain::Unloading::elastic_plastic}) {
    const double plastic = ripple(unloading, 2.5);
    EXPECT_LT(plastic, 0.01);
    EXPECT_GT(elastic, 10 * plastic);
  }
  EXPECT_GT(elastic, 0.5 * ripple(terrain::Unloading::elastic, 1.5));
}

TEST(Bodies, WheelsFarApartDoNotFeelEachOther) {
  const NodeSpringParams params;
  NodeSpringTerrain one(params), both(params);
  const auto alone = one.add_body(smooth_wheel());
  const auto a = both.add_body(smooth_wheel()), b = both.add_body(smooth_wheel());
  Twist twist;
  twist.v_W.x() = 0.03;
  twist.w_W.y() = 0.3;
  for (int i = 0; i < 300; ++i) {
    Pose pose;
    pose.p_W = Vec3(0.03e-3 * i, 0, kRadius - 0.01);
    pose.R_WB = Eigen::AngleAxisd(0.3e-3 * i, Vec3::UnitY());
    Pose beside = pose;
    beside.p_W.y() = 0.4;
    one.begin_step(i * 1e-3, 1e-3);
    both.begin_step(i * 1e-3, 1e-3);
    const ContactResult r1 = one.wrench(alone, pose, twist), r2 = both.wrench(a, pose, twist), r3 = both.wrench(b, beside, twist);
    one.end_step();
    both.end_step();
    ASSERT_EQ(r1.wrench.F_W, r2.wrench.F_W);
    ASSERT_NEAR(r1.wrench.F_W.z(), r3.wrench.F_W.z(), 1e-9 * r1.wrench.F_W.z());
  }
}

TEST(Heaps, SoilIsMovedNotMade) {
  NodeSpringParams params;
  params.heap_fraction = 1.0;
  params.repose_angle = 0.5;
  NodeSpringTerrain ground(params);
  roll(ground, ground.add_body(smooth_wheel()), {});
  double raised = 0, plastic = 0, top = 0;
  for (int ix = -60; ix < 120; ++ix)
    for (int iy = -60; iy < 60; ++iy)
      if (const terrain::Node* n = ground.grid().find({ix, iy})) {
        raised += n->raised;
        plastic += std::max(n->plastic, n->reached);
        top = std::max(top, n->raised);
      }
  EXPECT_NEAR(raised, plastic, 0.02 * plastic);
  EXPECT_GT(top, 0.001);
}

TEST(Bias, ProjectedNodeAreaLosesTheArc) {
  // The paper's spacing times width sinks deeper by what docs/theory/node-spring.md states.
  NodeSpringParams params;
  params.soil.cohesion = 96.240;
  params.soil.shear_modulus = 4.534e-3;
  params.soil.k = 2.305e4;
  params.soil.n = 0.418;
  params.angles = {0.09, 0.90, 0.0};
  test::RigRun run;
  NodeSpringTerrain arc(params);
  const double right = test::drive(arc, arc.add_body(smooth_wheel()), kRadius, run).sinkage;
  params.area = terrain::NodeArea::projected;
  NodeSpringTerrain projected(params);
  const double biased = test::drive(projected, projected.add_body(smooth_wheel()), kRadius, run).sinkage;
  EXPECT_GT(biased / right, 1.03);
  EXPECT_LT(biased / right, 1.07);
}

}  // namespace
}  // namespace terrode

namespace terrode {
namespace {

// The wrench on a wheel after 1.6 s in `n` steps of a motion that sets pose and twist at a time.
template <class Motion>
Wrench wrench_at_end(int n, const Motion& motion) {
  NodeSpringTerrain ground{NodeSpringParams{}};
  const auto id = ground.add_body(smooth_wheel());
  const double T = 1.6, h = T / n;
  ContactResult r;
  for (int i = 0; i <= n; ++i) {
    Pose pose;
    Twist twist;
    motion(i * h, pose, twist);
    ground.begin_step(i * h, h);
    r = ground.wrench(id, pose, twist);
    ground.end_step();
  }
  return r.wrench;
}

TEST(Convergence, IsOfSecondOrderInTimeUnderASmoothMotion) {
  // A wheel that gathers speed at constant depth: the wrench at one instant against the step.
  const auto at_end = [](int n) {
    return wrench_at_end(n, [](double t, Pose& pose, Twist& twist) {
      pose.p_W = Vec3(0.03 * t + 0.01 * t * t, 0, kRadius - 0.007);
      pose.R_WB = Eigen::AngleAxisd(0.33 * t + 0.05 * t * t, Vec3::UnitY());
      twist.v_W = Vec3(0.03 + 0.02 * t, 0, 0);
      twist.w_W = Vec3(0, 0.33 + 0.1 * t, 0);
    });
  };
  const Wrench best = at_end(6400), coarse = at_end(50), fine = at_end(200);
  // A step four times as long errs sixteen times as much; ten leaves room for the moments at which markers enter.
  constexpr double gain = 10.0;
  EXPECT_GT(std::abs(coarse.F_W.x() - best.F_W.x()), gain * std::abs(fine.F_W.x() - best.F_W.x()));
  EXPECT_GT(std::abs(coarse.M_W.y() - best.M_W.y()), gain * std::abs(fine.M_W.y() - best.M_W.y()));
  EXPECT_LT(std::abs(fine.F_W.x() - best.F_W.x()), 1e-4 * best.F_W.z());
}

TEST(Convergence, OfTheExitAngleUnderASinkageThatGrows) {
  // A wheel that sinks while it rolls, smoothly and ever slower: the exit angle follows its path.
  const auto at_end = [](int n) {
    return wrench_at_end(n, [](double t, Pose& pose, Twist& twist) {
      const double left = std::exp(-t);
      pose.p_W = Vec3(0.03 * t, 0, kRadius - 0.009 + 0.004 * left);
      pose.R_WB = Eigen::AngleAxisd(0.33 * t, Vec3::UnitY());
      twist.v_W = Vec3(0.03, 0, -0.004 * left);
      twist.w_W = Vec3(0, 0.33, 0);
    });
  };
  const Wrench best = at_end(12800), coarse = at_end(100), fine = at_end(400);
  const double order = 0.5 * std::log2(std::abs(coarse.F_W.z() - best.F_W.z()) / std::abs(fine.F_W.z() - best.F_W.z()));
  std::printf("order of the load in the time step: %.2f (errors %.2g and %.2g of it)\n", order,
              std::abs(coarse.F_W.z() / best.F_W.z() - 1), std::abs(fine.F_W.z() / best.F_W.z() - 1));
  EXPECT_GT(order, 1.5);
}

TEST(Threads, GroundsInTwoThreadsAnswerAsInOne) {
  const auto run = [](double slip) {
    NodeSpringTerrain ground{NodeSpringParams{}};
    test::RigRun r;
    r.slip = slip;
    r.duration = 0.5;
    r.average = 0.1;
    r.yaw = 0.2;
    const auto out = test::drive(ground, ground.add_body(smooth_wheel()), kRadius, r);
    return std::pair(out.pull, ground.hash());
  };
  std::vector<std::pair<double, std::uint64_t>> one(4), two(4);
  parallel_for(4, 1, [&](std::size_t i) { one[i] = run(0.1 * static_cast<double>(i)); });
  parallel_for(4, 2, [&](std::size_t i) { two[i] = run(0.1 * static_cast<double>(i)); });
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(one[i].first, two[i].first);
    EXPECT_EQ(one[i].second, two[i].second);
  }
}

}  // namespace
}  // namespace terrode
