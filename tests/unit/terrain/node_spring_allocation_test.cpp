// A step on ground that was reserved allocates nothing, and costs in memory what is touched.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "../../sanitized.h"
#include "terrain/node_spring.h"
#include "wheel/wheel.h"

namespace {
std::atomic<long> allocations{0};
std::atomic<bool> counting{false};
}  // namespace

#if !TERRODE_SANITIZED
// Kept whole: where the compiler inlines one of a pair it warns that the two do not match.
[[gnu::noinline]] void* operator new(std::size_t size) {
  if (counting) ++allocations;
  if (void* p = std::malloc(size ? size : 1)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
#endif

namespace terrode {
namespace {

TEST(NodeSpring, AStepAllocatesNothing) {
  if (kSanitized) GTEST_SKIP() << "operator new is that of the sanitizer, which does not count";
  for (const double crown : {0.0, 0.5})
    for (const double yaw : {0.0, 0.3}) {
      terrain::NodeSpringTerrain ground{terrain::NodeSpringParams{}};
      const auto id = ground.add_body(std::make_shared<wheel::Wheel>(wheel::WheelShape{0.13, 0.16, crown, {}}));
      ground.reserve(-0.5, -0.5, 0.5, 0.5);
      for (int i = 0; i < 60; ++i) {
        if (i == 20) {
          allocations = 0;
          counting = true;
        }
        const double t = i * 0.02, v = 0.027;
        Pose pose;
        pose.p_W = Vec3(v * t * std::cos(yaw), v * t * std::sin(yaw), 0.12);
        pose.R_WB = Quat(Eigen::AngleAxisd(yaw, Vec3::UnitZ())) * Quat(Eigen::AngleAxisd(0.3 * t, Vec3::UnitY()));
        Twist twist;
        twist.v_W = Vec3(v * std::cos(yaw), v * std::sin(yaw), 0);
        twist.w_W = 0.3 * Vec3(-std::sin(yaw), std::cos(yaw), 0);
        ground.begin_step(t, 0.02);
        ground.wrench(id, pose, twist);
        ground.end_step();
      }
      counting = false;
      EXPECT_EQ(allocations.load(), 0) << crown << " " << yaw;
    }
}

}  // namespace
}  // namespace terrode
