// What the paper's wheel on particles costs: core-hours for one slip of 19 s, from rates measured here over a few steps, for the
// whole bed of 600 x 1000 x 160 mm and for the window that follows the wheel, at three time steps. The paper (Smith et al.
// 2014, section 4.2.3) took 166 hours on 8 cores for it: 1,328 core-hours.
//
//   build/bench/wheel_cost_bench [--quick]     # --quick: a third of the width, for a look
#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>

#include "dem/dem_terrain.h"
#include "wheel/wheel.h"

using namespace terrode;

namespace {

constexpr double kPaperCoreHours = 1328.0, kSeconds = 19.0, kRadius = 0.13, kWidth = 0.16, kOmega = 0.2967, kSlip = 0.3;

double cpu_clock() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Cost {
  double seconds = 0.0;  // of processor time a simulated second
  std::size_t moving = 0;
  double step = 0.0;  // s
};

// The wheel ploughs on 10 mm deep; two steps of the rig are warm-up, two are measured.
Cost measure(dem::DemTerrainParams params, double time_step, bool full) {
  params.time_step = time_step;
  if (full) {
    params.full_length = 1.0;
    params.full_behind = 0.2;
  }
  dem::DemTerrain ground(std::move(params));
  ground.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{kRadius, kWidth, 0.0, {}}));
  constexpr double h = 1e-3;
  Twist twist;
  twist.v_W = Vec3(kOmega * kRadius * (1 - kSlip), 0, 0);
  twist.w_W = Vec3(0, kOmega, 0);
  Pose pose;
  pose.p_W = Vec3(0, 0, kRadius + 0.02);
  double start = 0.0;
  constexpr int lowering = 10, measured = 2;
  for (int k = 0; k < lowering + measured; ++k) {
    if (k == lowering) start = cpu_clock();
    ground.begin_step(k * h, h);
    Twist now = twist;
    if (k < lowering) now.v_W.z() = -0.03 / (lowering * h);
    ground.wrench(0, pose, now);
    ground.end_step();
    pose.p_W += h * now.v_W;
  }
  return {(cpu_clock() - start) / (measured * h), ground.particles().free_count(), ground.particles().time_step()};
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  dem::BedRecipe recipe;  // the paper's prism and grains (Table 2, section 3.3)
  recipe.width = recipe.length = 0.05;
  recipe.height = 0.16;
  recipe.sizes.smallest = 2.5e-3;
  recipe.sizes.largest = 10e-3;
  recipe.bulk_density = 1600.0;
  recipe.contact.friction = 0.86;
  recipe.contact.restitution = 0.4;
  recipe.contact.rolling = "epsd";
  recipe.contact.rolling_friction = 1.0;
  dem::DemTerrainParams params;
  params.prism = dem::cached_bed(recipe, {}, 1, {});
  params.tiles_y = quick ? 4 : 12;
  params.soil = params.wheel = recipe.contact;
  params.floor = recipe.floor;
  const double rayleigh = dem::rayleigh_time(0.5 * recipe.sizes.smallest, params.prism.grain_density, recipe.grain);
  std::printf("%zu grains in the prism, Rayleigh time of the smallest %.3g s; paper: %.0f core-hours\n", params.prism.grains.size(), rayleigh, kPaperCoreHours);
  std::printf("%-22s %10s %12s %16s %14s %10s\n", "bed", "step [s]", "grains", "CPU s / sim. s", "core-hours", "ratio");
  const auto row = [&](const char* bed, const Cost& c, double step) {
    const double seconds = c.seconds * c.step / step, hours = seconds * kSeconds / 3600.0;
    std::printf("%-22s %10.2e %12zu %16.0f %14.2f %10.0f%s\n", bed, step, c.moving, seconds, hours, kPaperCoreHours / hours,
                step < 0.99 * c.step ? "  (from the step above)" : "");
  };
  for (const bool full : {true, false}) {
    const char* bed = full ? "whole" : "window of the wheel";
    const Cost paper = measure(params, 3.8e-6, full);
    row(bed, paper, paper.step);
    row(bed, paper, 1.5e-6);
    const Cost largest = measure(params, 0.2 * rayleigh, full);
    row(bed, largest, largest.step);
  }
}
