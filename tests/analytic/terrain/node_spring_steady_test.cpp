// The node-spring wheel approaches the steady Bekker wheel; the ground sums nodes and never calls that solution.
#include <gtest/gtest.h>

#include "bench_rig.h"
#include "terrain/node_spring.h"

namespace terrode {
namespace {

terrain::NodeSpringParams table1() { return {}; }

terrain::NodeSpringParams table8() {
  terrain::NodeSpringParams p;
  p.soil.cohesion = 96.240;
  p.soil.shear_modulus = 4.534e-3;
  p.soil.k = 2.305e4;
  p.soil.n = 0.418;
  p.angles = {0.09, 0.90, 0.0};
  return p;
}

struct Both {
  test::RigResult nodes;
  bekker::SteadyState steady;
};

Both run_both(const terrain::NodeSpringParams& params, const test::RigRun& run, double width = 0.16) {
  terrain::NodeSpringTerrain ground(params);
  const auto id = ground.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{0.13, width, 0.0, {}}));
  bekker::Operating op;
  op.slip = run.slip;
  op.normal_load = run.load;
  op.angular_velocity = run.angular_velocity;
  Both out;
  out.steady = bekker::SteadyWheel({0.13, width}, params.soil, params.angles).solve(op);
  out.nodes = test::drive(ground, id, 0.13, run);
  return out;
}

class Steady : public testing::TestWithParam<std::tuple<int, double, double>> {};

TEST_P(Steady, DefaultSettingsAreWithinTwoPercentAndSmooth) {
  const auto [table, slip, spacing] = GetParam();
  auto params = table == 1 ? table1() : table8();
  params.spacing = spacing;
  test::RigRun run;
  run.slip = slip;
  const Both both = run_both(params, run);
  constexpr double close = 0.02;   // asked of the default settings
  constexpr double ripple = 0.01;  // of the mean, half of peak to peak
  EXPECT_NEAR(both.nodes.pull, both.steady.drawbar_pull, close * std::abs(both.steady.drawbar_pull));
  EXPECT_NEAR(both.nodes.torque, both.steady.driving_torque, close * both.steady.driving_torque);
  EXPECT_NEAR(both.nodes.sinkage, both.steady.sinkage, close * both.steady.sinkage);
  EXPECT_LT(both.nodes.pull_ripple, ripple * std::abs(both.nodes.pull));
  EXPECT_LT(both.nodes.torque_ripple, ripple * both.nodes.torque);
  EXPECT_LT(both.nodes.normal_ripple, ripple * run.load);
}

INSTANTIATE_TEST_SUITE_P(Tables, Steady,
                         testing::Combine(testing::Values(1, 8), testing::Values(0.1, 0.3, 0.5), testing::Values(0.005, 0.01)));

TEST(NodeSpring, FineSettingsAreWithinOnePercent) {
  for (const int table : {1, 8})
    for (const double slip : {0.1, 0.5}) {
      auto params = table == 1 ? table1() : table8();
      params.spacing = 1.0 / 300.0;
      // A slice of the wheel with its share of load and mass: the same per width, at a sixteenth of the cost.
      test::RigRun run;
      run.slip = slip;
      run.load = 115.0 / 16;
      run.mass = 3.2 / 16;
      run.step = 1e-4;
      // The wheel is dropped; what that leaves dies out as it travels the length of its contact, slowly at high slip.
      run.duration = slip < 0.3 ? 6.0 : 8.0;
      const Both both = run_both(params, run, 0.01);
      constexpr double close = 0.01;
      EXPECT_NEAR(both.nodes.pull, both.steady.drawbar_pull, close * std::abs(both.steady.drawbar_pull)) << table << " " << slip;
      EXPECT_NEAR(both.nodes.torque, both.steady.driving_torque, close * both.steady.driving_torque);
      EXPECT_NEAR(both.nodes.sinkage, both.steady.sinkage, close * both.steady.sinkage);
    }
}

TEST(NodeSpring, ClosedFormShearFollowsTheSteadyWheelWhereItBrakes) {
  for (const int table : {1, 8})
    for (const double slip : {-0.7, -0.5, -0.3, -0.1}) {
      auto params = table == 1 ? table1() : table8();
      params.shear_history = terrain::ShearHistory::closed_form;
      test::RigRun run;
      run.slip = slip;
      const Both both = run_both(params, run);
      constexpr double close = 0.02;
      EXPECT_NEAR(both.nodes.pull, both.steady.drawbar_pull, close * std::abs(both.steady.drawbar_pull)) << table << " " << slip;
      EXPECT_NEAR(both.nodes.torque, both.steady.driving_torque, close * 115 * 0.13);
      EXPECT_NEAR(both.nodes.sinkage, both.steady.sinkage, close * both.steady.sinkage);
    }
}

TEST(NodeSpring, StaysStableAtLongSteps) {
  for (const bool implicit : {true, false}) {
    test::RigRun run;
    run.step = 2e-3;
    run.implicit = implicit;
    const Both both = run_both(table1(), run);
    constexpr double close = 0.02;
    EXPECT_NEAR(both.nodes.sinkage, both.steady.sinkage, close * both.steady.sinkage);
    EXPECT_LT(both.nodes.normal_ripple, 0.01 * run.load);
  }
}

TEST(NodeSpring, TurnedAndShiftedWorldsGiveTheSame) {
  test::RigRun run;
  run.duration = 4.0;
  run.average = 1.0;
  const Both straight = run_both(table1(), run);
  constexpr double ripple = 0.005;  // the lattice lies otherwise under the wheel: less than half the allowed ripple
  for (const double yaw : {0.3, 0.7853981633974483, 1.5707963267948966, 2.5}) {
    run.yaw = yaw;
    run.start_x = 0.0017;
    run.start_y = -0.0011;
    const Both turned = run_both(table1(), run);
    EXPECT_NEAR(turned.nodes.pull, straight.nodes.pull, ripple * straight.nodes.pull);
    EXPECT_NEAR(turned.nodes.sinkage, straight.nodes.sinkage, ripple * straight.nodes.sinkage);
    constexpr double side = 1e-3;  // of the load: a symmetric wheel has no side force but for the lattice's
    EXPECT_NEAR(turned.nodes.side, 0.0, side * run.load);
  }
}

}  // namespace
}  // namespace terrode
