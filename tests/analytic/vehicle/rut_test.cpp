// What the front wheels leave is what the rear wheels run on: the same machine with its rear wheels beside the ruts, and a
// machine that comes back over its own track.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "terrain/node_spring.h"
#include "vehicle/controllers.h"
#include "vehicle/machines.h"
#include "vehicle/vehicle.h"

namespace terrode::vehicle {
namespace {

std::unique_ptr<terrain::Terrain> soft() {
  terrain::NodeSpringParams p;  // Smith et al., Table 1
  p.spacing = 0.01;
  return std::make_unique<terrain::NodeSpringTerrain>(p);
}

double mean_of_last_half(const recording::Run& run, const std::string& channel) {
  const std::vector<double>& v = run.find(channel)->values;
  double sum = 0.0;
  for (std::size_t i = v.size() / 2; i < v.size(); ++i) sum += v[i];
  return sum / static_cast<double>(v.size() - v.size() / 2);
}

recording::Run straight(const VehicleSpec& spec) {
  Vehicle v(spec, {}, soft());
  std::vector<Manoeuvre> moves(1);
  moves[0].duration = 6.0;
  moves[0].speed = 0.2;
  Script script(moves);
  return v.run(script, 6.0);
}

// The rut is soil that has yielded already: a rear wheel compacts it little further, so that its motion resistance (torque
// over radius less drawbar pull) is smaller there than on fresh soil beside it, and it runs deeper below the ground as it was.
TEST(Ruts, RearWheelsMeetLessResistanceInTheRutThanBesideIt) {
  const VehicleSpec in_line = skid_steer_robot();
  VehicleSpec beside = in_line;
  for (VehicleWheelSpec& w : beside.wheels)
    if (w.centre.x() < 0.0) w.centre.y() += w.centre.y() > 0.0 ? 0.12 : -0.12;  // half again as far as a wheel is wide
  const recording::Run in_rut = straight(in_line), fresh = straight(beside);
  for (const std::string side : {"_left", "_right"}) {
    const double load = mean_of_last_half(fresh, "rear" + side + "_normal_load");
    EXPECT_NEAR(mean_of_last_half(in_rut, "rear" + side + "_normal_load"), load, 0.05 * load);
    const auto resistance = [&](const recording::Run& run) {
      return mean_of_last_half(run, "rear" + side + "_driving_torque") / in_line.wheels.front().shape.radius -
             mean_of_last_half(run, "rear" + side + "_drawbar_pull");
    };
    EXPECT_GT(resistance(in_rut), 0.0);
    EXPECT_LT(resistance(in_rut), 0.75 * resistance(fresh)) << side;
    EXPECT_GT(mean_of_last_half(in_rut, "rear" + side + "_sinkage"), 1.02 * mean_of_last_half(fresh, "rear" + side + "_sinkage")) << side;
    // In fresh soil both axles sink as their loads say: the rear one no more than the front one does for its share.
    const double front_load = mean_of_last_half(fresh, "front" + side + "_normal_load");
    const double front = mean_of_last_half(fresh, "front" + side + "_sinkage"), rear = mean_of_last_half(fresh, "rear" + side + "_sinkage");
    EXPECT_EQ(rear > front, load > front_load) << side;
  }
  const auto torque = [&](const recording::Run& run) {
    double sum = 0.0;
    for (const VehicleWheelSpec& w : in_line.wheels) sum += mean_of_last_half(run, w.name + "_driving_torque");
    return sum;
  };
  EXPECT_LT(torque(in_rut), 0.9 * torque(fresh));
}

// Out and back: on its own track the machine needs less energy for the same way.
TEST(Ruts, ComingBackOnItsOwnTrackCostsLess) {
  Vehicle v(skid_steer_robot(), {}, soft());
  const auto energy_of = [&](double speed, double seconds) {
    const double before = v.energy().drives;
    std::vector<Manoeuvre> moves(1);
    moves[0].duration = seconds;
    moves[0].speed = speed;
    Script script(moves);
    v.run(script, seconds);
    return v.energy().drives - before;
  };
  const double out = energy_of(0.2, 5.0), back = energy_of(-0.2, 5.0);
  EXPECT_GT(out, 0.0);
  EXPECT_LT(back, 0.85 * out);
}

}  // namespace
}  // namespace terrode::vehicle
