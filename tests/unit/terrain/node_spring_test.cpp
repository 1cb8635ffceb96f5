#include "terrain/node_spring.h"

#include <gtest/gtest.h>

#include <limits>

#include "bekker/pressure_laws.h"
#include "terrain/rigid.h"
#include "wheel/convex.h"
#include "wheel/wheel.h"

namespace terrode {
namespace {

using terrain::BodyId;
using terrain::ContactResult;
using terrain::NodeSpringParams;
using terrain::NodeSpringTerrain;

std::shared_ptr<const wheel::Body> paper_wheel() {
  return std::make_shared<wheel::Wheel>(wheel::WheelShape{0.13, 0.16, 0.0, {}});
}

constexpr double kOmega = 0.2967, kSlip = 0.3, kStep = 1e-3, kSinkage = 0.010;

Pose pose_at(double t, double y = 0.0) {
  Pose p;
  p.p_W = Vec3((1 - kSlip) * kOmega * 0.13 * t, y, 0.13 - kSinkage);
  p.R_WB = Eigen::AngleAxisd(kOmega * t, Vec3::UnitY());
  return p;
}

Twist twist() {
  Twist w;
  w.v_W = Vec3((1 - kSlip) * kOmega * 0.13, 0, 0);
  w.w_W = Vec3(0, kOmega, 0);
  return w;
}

ContactResult roll(NodeSpringTerrain& ground, BodyId id, int steps, int from = 0, double y = 0.0) {
  ContactResult r;
  for (int i = from; i < from + steps; ++i) {
    ground.begin_step(i * kStep, kStep);
    r = ground.wrench(id, pose_at(i * kStep, y), twist());
    ground.end_step();
  }
  return r;
}

// Nodes are numbered by integers: a body that flew off is refused before they run out.
TEST(NodeSpring, ABodyBeyondAllNodesIsRefused) {
  for (const auto& shape : {paper_wheel(), std::shared_ptr<const wheel::Body>(wheel::make_box(0.1, 0.1, 0.02))}) {
    NodeSpringTerrain ground{NodeSpringParams{}};
    const auto id = ground.add_body(shape);
    ground.begin_step(0, kStep);
    Pose far = pose_at(0);
    far.p_W.y() = -1.4e10 * ground.params().spacing;
    EXPECT_THROW(ground.wrench(id, far, twist()), RunError);
    EXPECT_NO_THROW(ground.wrench(id, pose_at(0, 1e3), twist()));
  }
}

TEST(NodeSpring, WrenchIsTheSumOfItsNodes) {
  NodeSpringTerrain ground{NodeSpringParams{}};
  const auto id = ground.add_body(paper_wheel());
  roll(ground, id, 200);
  ground.begin_step(0.2, kStep);
  const ContactResult r = ground.wrench(id, pose_at(0.2), twist());
  const auto patch = ground.patch(id);
  ASSERT_GT(patch.size(), 100u);
  EXPECT_EQ(static_cast<int>(patch.size()), r.contact_count);
  double area = 0;
  for (const auto& node : patch) area += node.area;
  EXPECT_NEAR(area, r.contact_area, 1e-12);
  // The pressure of a node times its area, along the mean normal over the node: within the curvature of one cell.
  Vec3 sum = Vec3::Zero();
  for (const auto& node : patch) sum += node.area * (node.shear_W - node.pressure * node.n_W);
  constexpr double curvature = 1e-3;
  EXPECT_NEAR((sum - r.wrench.F_W).norm(), 0.0, curvature * r.wrench.F_W.norm());
}

// A wheel that runs across the lattice, and one step's answer.
struct Turned {
  explicit Turned(double spacing, std::shared_ptr<const terrain::SoilField> field = nullptr) {
    NodeSpringParams params;
    params.spacing = spacing;
    ground = std::make_unique<NodeSpringTerrain>(params, bekker::PointLaw{}, nullptr, std::move(field));
    id = ground->add_body(paper_wheel());
  }
  ContactResult step(int i) {
    constexpr double yaw = 0.3;
    const Quat turn(Eigen::AngleAxisd(yaw, Vec3::UnitZ()));
    Pose pose = pose_at(i * kStep);
    pose.p_W = turn * pose.p_W;
    pose.R_WB = turn * pose.R_WB;
    const Twist along{turn * twist().v_W, turn * twist().w_W};
    ground->begin_step(i * kStep, kStep);
    const ContactResult r = ground->wrench(id, pose, along);
    patch = ground->patch(id);
    ground->end_step();
    return r;
  }
  std::unique_ptr<NodeSpringTerrain> ground;
  BodyId id = 0;
  std::vector<terrain::PatchNode> patch;
};

TEST(NodeSpring, TurnedContactSharedByItsNodesIsThatNodeByNode) {
  // Soil that a field gives point by point is evaluated node by node; the same soil without a field once for all.
  const auto same = std::make_shared<terrain::FunctionSoil>([](double, double) { return bekker::Soil{}; });
  for (const double spacing : {0.01, 0.005, 1.0 / 300}) {
    Turned shared(spacing), each(spacing, same);
    for (int i = 0; i < 120; ++i) {
      const ContactResult a = shared.step(i), b = each.step(i);
      const double close = 5e-4 * b.wrench.F_W.norm();  // two quadratures of the same stress
      ASSERT_NEAR((a.wrench.F_W - b.wrench.F_W).norm(), 0.0, close) << spacing << " " << i;
      ASSERT_NEAR((a.wrench.M_W - b.wrench.M_W).norm(), 0.0, 0.13 * close) << spacing << " " << i;
      ASSERT_EQ(a.contact_count, b.contact_count);
      ASSERT_NEAR(a.contact_area, b.contact_area, 2e-4 * b.contact_area);
      ASSERT_NEAR(a.max_sinkage, b.max_sinkage, 2e-2 * b.max_sinkage);
      ASSERT_NEAR(a.stored_energy, b.stored_energy, 1e-3 * b.stored_energy);
    }
    ASSERT_EQ(shared.patch.size(), each.patch.size());
    Vec3 sum = Vec3::Zero();
    double area = 0.0;
    for (const auto& node : shared.patch) {
      sum += node.area * (node.shear_W - node.pressure * node.n_W);
      area += node.area;
    }
    const ContactResult last = shared.step(120);
    EXPECT_NEAR((sum - last.wrench.F_W).norm(), 0.0, 2e-3 * last.wrench.F_W.norm());
    EXPECT_NEAR(area, last.contact_area, 1e-3 * last.contact_area);
  }
}

TEST(NodeSpring, LawsOfPressureUnloadAndStiffenByThemselves) {
  // A plate pressed into ground of Wong's two-parameter law: pressure, and the rebound of its rut by k0.
  const auto law = bekker::make_pressure_law("wong", {{"kp", 3e5}, {"mm", 5e4}, {"hydraulic_diameter", 0.1}});
  NodeSpringParams params;
  params.unloading = terrain::Unloading::elastic_plastic;
  params.unloading_k0 = 5e6;
  bekker::PointLaw point;
  point.pressure_law = law.get();
  NodeSpringTerrain ground(params, point);
  const auto id = ground.add_body(wheel::make_box(0.1, 0.1, 0.02));
  const double depth = 0.02, p = 3e5 * depth + 4 * 5e4 * depth * depth / 0.1;
  const auto press = [&](int i, double z) {
    ground.begin_step(i * kStep, kStep);
    Pose pose;
    pose.p_W = Vec3(0.0025, 0.0025, 0.01 - z);
    const ContactResult r = ground.wrench(id, pose, Twist{});
    ground.end_step();
    return r;
  };
  const ContactResult deep = press(0, depth);
  EXPECT_NEAR(deep.wrench.F_W.z(), 0.01 * p, 1e-9 * p);
  EXPECT_NEAR(deep.stiffness(2, 2), 0.01 * (3e5 + 8 * 5e4 * depth / 0.1), 1e-6 * deep.stiffness(2, 2));
  press(1, -0.01);
  EXPECT_NEAR(ground.height(0, 0), -depth + p / 5e6, 1e-9);
}

TEST(NodeSpring, RayleighDampingGoesWithTheStiffness) {
  NodeSpringParams plain, damped;
  damped.damping_time = 0.05;
  const auto force = [](const NodeSpringParams& params, double speed) {
    NodeSpringTerrain ground(params);
    const auto id = ground.add_body(wheel::make_box(0.1, 0.1, 0.02));
    Pose pose;
    pose.p_W = Vec3(0.0025, 0.0025, 0.0);
    Twist down;
    down.v_W.z() = -speed;
    ground.begin_step(0, kStep);
    return ground.wrench(id, pose, down);
  };
  const ContactResult a = force(plain, 0.02), b = force(damped, 0.02);
  EXPECT_NEAR(b.wrench.F_W.z() - a.wrench.F_W.z(), 0.05 * a.stiffness(2, 2) * 0.02, 1e-9 * a.wrench.F_W.z());
  EXPECT_NEAR(b.damping(2, 2), 0.05 * a.stiffness(2, 2), 1e-9 * b.damping(2, 2));
  EXPECT_GT(b.damping_power, 0.0);
  EXPECT_EQ(force(damped, 0.0).wrench.F_W, a.wrench.F_W);
}

TEST(NodeSpring, TakingANodeAwayTakesItsForceAway) {
  NodeSpringTerrain ground{NodeSpringParams{}};
  const auto id = ground.add_body(paper_wheel());
  ground.begin_step(0.0, kStep);
  const ContactResult whole = ground.wrench(id, pose_at(0.0), twist());
  const auto patch = ground.patch(id);
  std::size_t best = 0;  // the node with the greatest force
  for (std::size_t i = 0; i < patch.size(); ++i)
    if (patch[i].pressure * patch[i].area > patch[best].pressure * patch[best].area) best = i;
  ground.remove_node(ground.grid().nearest(patch[best].p_W.x(), patch[best].p_W.y()));
  const ContactResult less = ground.wrench(id, pose_at(0.0), twist());
  EXPECT_EQ(less.contact_count, whole.contact_count - 1);
  const Vec3 gone = patch[best].area * (patch[best].shear_W - patch[best].pressure * patch[best].n_W);
  constexpr double curvature = 2e-3;
  EXPECT_NEAR((whole.wrench.F_W - less.wrench.F_W - gone).norm(), 0.0, curvature * gone.norm());
  // And all of them: nothing is left.
  for (const auto& node : patch) ground.remove_node(ground.grid().nearest(node.p_W.x(), node.p_W.y()));
  const ContactResult nothing = ground.wrench(id, pose_at(0.0), twist());
  EXPECT_EQ(nothing.wrench.F_W.norm(), 0.0);
  EXPECT_EQ(nothing.contact_count, 0);
}

TEST(NodeSpring, TrialsAreRepeatableAndLeaveNoTrace) {
  NodeSpringTerrain once{NodeSpringParams{}}, often{NodeSpringParams{}};
  const auto a = once.add_body(paper_wheel()), b = often.add_body(paper_wheel());
  for (int i = 0; i < 100; ++i) {
    const double t = i * kStep;
    once.begin_step(t, kStep);
    const ContactResult r1 = once.wrench(a, pose_at(t), twist());
    once.end_step();
    often.begin_step(t, kStep);
    Pose off = pose_at(t);
    off.p_W.z() -= 0.002;
    off.p_W.x() += 0.03;
    often.wrench(b, off, twist());
    const ContactResult r2 = often.wrench(b, pose_at(t), twist());
    const ContactResult r3 = often.wrench(b, pose_at(t), twist());
    often.end_step();
    ASSERT_EQ(r1.wrench.F_W, r2.wrench.F_W) << i;
    ASSERT_EQ(r2.wrench.F_W, r3.wrench.F_W);
    ASSERT_EQ(r1.wrench.M_W, r3.wrench.M_W);
  }
  EXPECT_EQ(once.hash(), often.hash());
}

TEST(NodeSpring, ASnapshotGoesOnBitForBit) {
  NodeSpringTerrain ground{NodeSpringParams{}}, other{NodeSpringParams{}};
  const auto id = ground.add_body(paper_wheel());
  other.add_body(paper_wheel());
  roll(ground, id, 150);
  const auto bytes = ground.snapshot();
  other.restore(bytes);
  EXPECT_EQ(other.hash(), ground.hash());
  const ContactResult a = roll(ground, id, 100, 150), b = roll(other, id, 100, 150);
  EXPECT_EQ(a.wrench.F_W, b.wrench.F_W);
  EXPECT_EQ(a.wrench.M_W, b.wrench.M_W);
  EXPECT_EQ(ground.hash(), other.hash());
  other.begin_step(0, kStep);  // as where an error comes within a step: taken back, it was never begun
  other.wrench(id, pose_at(0), twist());
  other.restore(bytes);
  EXPECT_EQ(roll(other, id, 100, 150).wrench.F_W, a.wrench.F_W);
  auto cut = bytes;
  cut.resize(cut.size() / 2);
  EXPECT_THROW(other.restore(cut), InputError);
  EXPECT_THROW(terrain::RigidTerrain{}.restore(bytes), InputError);
}

TEST(NodeSpring, LeavesARutAndCountsPasses) {
  NodeSpringTerrain ground{NodeSpringParams{}};
  const auto id = ground.add_body(paper_wheel());
  const double v = (1 - kSlip) * kOmega * 0.13;
  roll(ground, id, static_cast<int>(0.25 / v / kStep));
  EXPECT_NEAR(ground.height(0.1, 0.0), -kSinkage + ground.params().springback, 1e-6);
  EXPECT_EQ(ground.height(0.1, 0.2), 0.0);
  EXPECT_EQ(ground.height(0.5, 0.0), 0.0);
  EXPECT_EQ(ground.undisturbed_height(0.1, 0.0), 0.0);
  const terrain::Node* node = ground.grid().find(ground.grid().nearest(0.1, 0.0));
  ASSERT_NE(node, nullptr);
  EXPECT_EQ(node->passes, 1);
  EXPECT_NEAR(node->plastic, kSinkage, 1e-6);
}

TEST(NodeSpring, FlatGroundTakesMemoryWhereItWasTouchedOnly) {
  NodeSpringTerrain ground{NodeSpringParams{}};
  const auto id = ground.add_body(paper_wheel());
  EXPECT_EQ(ground.grid().tile_count(), 0u);
  ground.begin_step(0, kStep);
  Pose far = pose_at(0);
  far.p_W.x() = 4000.0;
  ground.wrench(id, far, twist());
  EXPECT_EQ(ground.grid().tile_count(), 0u);  // trials write nothing
  ground.end_step();
  EXPECT_GT(ground.grid().tile_count(), 0u);
  EXPECT_LE(ground.grid().tile_count(), 6u);
}

TEST(NodeSpring, RefusesWhatIsWrong) {
  NodeSpringParams bad;
  bad.spacing = -1;
  bad.springback = std::numeric_limits<double>::quiet_NaN();
  bad.soil.k = -5;
  EXPECT_EQ(bad.validate().size(), 3u);
  EXPECT_THROW(NodeSpringTerrain{bad}, InputError);
  NodeSpringTerrain ground{NodeSpringParams{}};
  EXPECT_THROW(ground.add_body(nullptr), InputError);
  const auto id = ground.add_body(paper_wheel());
  EXPECT_THROW(ground.wrench(id, pose_at(0), twist()), RunError);
  EXPECT_THROW(ground.end_step(), RunError);
  EXPECT_THROW(ground.begin_step(0, 0), InputError);
  ground.begin_step(0, kStep);
  EXPECT_THROW(ground.begin_step(0, kStep), RunError);
  EXPECT_THROW(ground.wrench(7, pose_at(0), twist()), InputError);
  Pose lost = pose_at(0);
  lost.p_W.z() = std::numeric_limits<double>::infinity();
  EXPECT_THROW(ground.wrench(id, lost, twist()), RunError);
  EXPECT_THROW(ground.snapshot(), RunError);
}

}  // namespace
}  // namespace terrode
