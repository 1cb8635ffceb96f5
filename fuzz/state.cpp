// The state of a node-spring ground and of a rig on it, as checkpoints carry it.
#include <cstring>
#include <span>

#include "harness.h"
#include "terrain/node_spring.h"
#include "vehicle/rig.h"
#include "wheel/wheel.h"

FUZZ(state) {
  using namespace terrode;
  if (size == 0) return;
  const std::span<const std::uint8_t> bytes(data + 1, size - 1);
  const auto ground = [] {
    terrain::NodeSpringParams p;
    p.spacing = 0.02;
    return std::make_unique<terrain::NodeSpringTerrain>(p, bekker::PointLaw{});
  };
  const auto wheel = std::make_shared<wheel::Wheel>(wheel::WheelShape{});
  switch (data[0] % 2) {
    case 0: {
      auto g = ground();
      const auto body = g->add_body(wheel);
      g->restore(bytes);
      Pose pose;
      pose.p_W = Vec3(0, 0, 0.12);
      g->begin_step(0.0, 1e-3);
      g->wrench(body, pose, {});
      g->end_step();
      break;
    }
    default: {
      vehicle::Rig rig({}, {}, wheel, ground());
      recording::Checkpoint c;
      const std::size_t n = bytes.size() / sizeof(double);
      std::vector<double> numbers(n);
      if (n > 0) std::memcpy(numbers.data(), bytes.data(), n * sizeof(double));
      const recording::Checkpoint own = rig.checkpoint();
      c = own;
      for (const char* part : {"world", "contacts", "rig", "samples"}) {
        std::vector<double>& into = c.numbers[part];
        for (std::size_t i = 0; i < into.size() && i < n; ++i) into[i] = numbers[i];
      }
      rig.resume(c);
      for (int k = 0; k < 3; ++k) rig.step();
      break;
    }
  }
}
