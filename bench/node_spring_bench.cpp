// What the node-spring ground costs: CPU seconds per simulated second on one core, for the wheel and soil of Smith et al.
// (r 130 mm, b 160 mm, 115 N, 17 deg/s, Table 1), nodes over the whole width, beside Project Chrono's SCM terrain.
//
//   build/bench/node_spring_bench
//
// The Chrono numbers are quoted, not measured here: Chrono 10.0.0 (main, 7689fbc0), g++ 12 -O3 -march=native, one thread,
// time step 1e-3, the same wheel and soil; `default` is a cylinder on Bullet rays, `exact` a 180-facet mesh on its
// reference raster.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <memory>
#include <numbers>
#include <vector>

#include "terrain/implicit_step.h"
#include "terrain/node_spring.h"
#include "wheel/wheel.h"

namespace {

using namespace terrode;

// Quoted, CPU seconds per simulated second at slip 0.3 (default, exact), by grid.
constexpr double kQuotedChronoDefault10mm = 0.96, kQuotedChronoExact10mm = 1.68;
constexpr double kQuotedChronoDefault3mm = 7.6, kQuotedChronoExact3mm = 14.7;

constexpr double kRadius = 0.13, kWidth = 0.16, kLoad = 115.0, kMass = 3.2, kOmega = 17.0 * std::numbers::pi / 180.0;

struct Result {
  double cpu = 0.0;  // s per simulated second
  double pull = 0.0, torque = 0.0, sinkage = 0.0, ripple = 0.0;
  int nodes = 0;
};

double cpu_now() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Wheels side by side at imposed slip, each free to sink under its load; settled for `settle` seconds before the clock
// starts.
Result run(double spacing, double h, double slip, double yaw, int wheels = 1, double settle = 3.0, double duration = 1.0) {
  terrain::NodeSpringParams params;
  params.spacing = spacing;
  terrain::NodeSpringTerrain ground(params);
  const auto shape = std::make_shared<wheel::Wheel>(wheel::WheelShape{kRadius, kWidth, 0.0, {}});
  struct One {
    terrain::BodyId id;
    double z = kRadius - 0.0095, vz = 0.0;
  };
  std::vector<One> all;
  for (int i = 0; i < wheels; ++i) all.push_back({ground.add_body(shape)});
  const double v = (1 - slip) * kOmega * kRadius;
  const Vec3 heading(std::cos(yaw), std::sin(yaw), 0), axle(-std::sin(yaw), std::cos(yaw), 0);
  Result out;
  double start = 0.0, lo = 1e300, hi = -1e300;
  const int from = static_cast<int>(std::lround(settle / h)), to = from + static_cast<int>(std::lround(duration / h));
  for (int i = 0; i < to; ++i) {
    if (i == from) start = cpu_now();
    ground.begin_step(i * h, h);
    for (std::size_t k = 0; k < all.size(); ++k) {
      One& w = all[k];
      Pose pose;
      pose.p_W = Vec3(0.0, 0.3 * static_cast<double>(k), w.z) + v * i * h * heading;
      pose.R_WB = Quat(Eigen::AngleAxisd(yaw, Vec3::UnitZ())) * Quat(Eigen::AngleAxisd(kOmega * i * h, Vec3::UnitY()));
      Twist twist;
      twist.v_W = v * heading + w.vz * Vec3::UnitZ();
      twist.w_W = kOmega * axle;
      const auto r = ground.wrench(w.id, pose, twist);
      const auto taken = terrain::step_resistance(r, h, kMass);
      w.vz += h * (r.wrench.F_W.z() - kLoad - taken.releasing(2, 2) * w.vz) / (kMass + h * (taken.inertial(2, 2) + taken.releasing(2, 2)));
      w.z += h * w.vz;
      if (i >= from && k == 0) {
        const double n = to - from;
        out.pull += r.wrench.F_W.dot(heading) / n;
        out.torque -= r.wrench.M_W.dot(axle) / n;
        out.sinkage += (kRadius - w.z) / n;
        lo = std::min(lo, r.wrench.F_W.dot(heading));
        hi = std::max(hi, r.wrench.F_W.dot(heading));
        out.nodes = r.contact_count;
      }
    }
    ground.end_step();
  }
  out.cpu = (cpu_now() - start) / duration;
  out.ripple = 0.5 * (hi - lo) / std::abs(out.pull);
  return out;
}

void table() {
  std::printf("node-spring ground, paper's wheel and soil (Table 1), slip 0.3, nodes over the whole width\n");
  std::printf("%-9s %-9s %-8s %6s %14s %22s %20s %9s %9s %9s %8s\n", "grid", "step", "heading", "nodes", "CPU s / sim s",
              "Chrono default (quoted)", "Chrono exact (quoted)", "pull", "torque", "sinkage", "ripple");
  bekker::Operating op;
  op.slip = 0.3;
  op.angular_velocity = kOmega;
  op.normal_load = kLoad;
  const auto steady = bekker::SteadyWheel({kRadius, kWidth}, {}, {}).solve(op);
  const auto off = [](double a, double b) { return 100 * (a / b - 1); };
  struct Row {
    double spacing, step, yaw, quoted, exact;
  };
  for (const Row& row : {Row{0.01, 1e-3, 0.0, kQuotedChronoDefault10mm, kQuotedChronoExact10mm},
                         Row{0.01, 1e-3, 0.3, kQuotedChronoDefault10mm, kQuotedChronoExact10mm},
                         Row{1.0 / 300, 1e-3, 0.0, kQuotedChronoDefault3mm, kQuotedChronoExact3mm},
                         Row{1.0 / 300, 1e-3, 0.3, kQuotedChronoDefault3mm, kQuotedChronoExact3mm},
                         Row{1.0 / 300, 1e-4, 0.0, 0, 0}, Row{1.0 / 300, 1e-4, 0.3, 0, 0}}) {
    const Result r = run(row.spacing, row.step, 0.3, row.yaw, 1, row.step < 5e-4 ? 2.0 : 4.0);
    char quoted[64] = "-", exact[64] = "-";
    if (row.quoted > 0) {
      std::snprintf(quoted, sizeof quoted, "%.2f (%.0f x)", row.quoted, row.quoted / r.cpu);
      std::snprintf(exact, sizeof exact, "%.2f (%.0f x)", row.exact, row.exact / r.cpu);
    }
    std::printf("%6.2f mm %7.0e s %5.2f rad %6d %14.4f %22s %20s %+8.2f%% %+8.2f%% %+8.2f%% %7.2f%%\n", row.spacing * 1e3,
                row.step, row.yaw, r.nodes, r.cpu, quoted, exact, off(r.pull, steady.drawbar_pull),
                off(r.torque, steady.driving_torque), off(r.sinkage, steady.sinkage), 100 * r.ripple);
    if (row.step < 5e-4) std::printf("%-28s real time factor (simulated / CPU) %.2f\n", "", 1 / r.cpu);
  }
  std::printf("(pull, torque, sinkage: against the steady wheel; ripple: half of peak to peak of the pull over its mean)\n\n");
  std::printf("wheels on one ground, 10 mm grid, step 1e-3, heading 0.3 rad:\n");
  double first = 0;
  for (const int wheels : {1, 2, 4}) {
    const Result r = run(0.01, 1e-3, 0.3, 0.3, wheels, 1.0, 0.5);
    if (wheels == 1) first = r.cpu;
    std::printf("  %d: %.4f CPU s / sim s, %.2f of one wheel's each\n", wheels, r.cpu, r.cpu / first / wheels);
  }
  std::printf("The ground has no edges: its area costs nothing.\n\n");
  std::fflush(stdout);
}

void BM_Step(benchmark::State& state) {
  terrain::NodeSpringParams params;
  params.spacing = 1e-4 * static_cast<double>(state.range(0));
  const double yaw = state.range(1) ? 0.3 : 0.0;
  terrain::NodeSpringTerrain ground(params);
  const auto id = ground.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{kRadius, kWidth, 0.0, {}}));
  const double h = 1e-3, v = 0.7 * kOmega * kRadius;
  const Vec3 heading(std::cos(yaw), std::sin(yaw), 0);
  int i = 0;
  for (auto _ : state) {
    Pose pose;
    pose.p_W = Vec3(0, 0, kRadius - 0.01) + v * i * h * heading;
    pose.R_WB = Quat(Eigen::AngleAxisd(yaw, Vec3::UnitZ())) * Quat(Eigen::AngleAxisd(kOmega * i * h, Vec3::UnitY()));
    Twist twist;
    twist.v_W = v * heading;
    twist.w_W = kOmega * Vec3(-std::sin(yaw), std::cos(yaw), 0);
    ground.begin_step(i * h, h);
    benchmark::DoNotOptimize(ground.wrench(id, pose, twist));
    ground.end_step();
    ++i;
  }
}
BENCHMARK(BM_Step)->Args({100, 0})->Args({100, 1})->Args({50, 0})->Args({50, 1})->Args({33, 0})->Args({33, 1});

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  table();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
