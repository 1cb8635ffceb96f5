// Soft soil under a wheel of one's own ODE world: the ground answers with a wrench, ODE moves the wheel.
#include <ode/ode.h>

#include <cstdio>
#include <memory>

#include "terrain/node_spring.h"
#include "wheel/wheel.h"

int main() {
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dWorldSetGravity(world, 0, 0, -9.81);
  dBodyID body = dBodyCreate(world);
  dMass mass;
  dMassSetCylinderTotal(&mass, 11.7, 2, 0.13, 0.16);  // 115 N, axle along y
  dBodySetMass(body, &mass);
  dBodySetPosition(body, 0, 0, 0.13);

  terrode::terrain::NodeSpringTerrain ground(terrode::terrain::NodeSpringParams{});
  const auto wheel = ground.add_body(std::make_shared<terrode::wheel::Wheel>(terrode::wheel::WheelShape{}));

  const double h = 1e-3;
  for (int step = 0; step < 3000; ++step) {
    const dReal *p = dBodyGetPosition(body), *q = dBodyGetQuaternion(body);
    const dReal *v = dBodyGetLinearVel(body), *w = dBodyGetAngularVel(body);
    const terrode::Pose pose{{p[0], p[1], p[2]}, terrode::Quat(q[0], q[1], q[2], q[3])};
    const terrode::Twist twist{{v[0], v[1], v[2]}, {w[0], w[1], w[2]}};
    ground.begin_step(step * h, h);
    const terrode::Wrench soil = ground.wrench(wheel, pose, twist).wrench;
    dBodyAddForce(body, soil.F_W.x(), soil.F_W.y(), soil.F_W.z());
    dBodyAddTorque(body, soil.M_W.x(), soil.M_W.y(), soil.M_W.z());
    if (step > 1000) dBodyAddTorque(body, 0, 3.0, 0);  // drive: 3 N m
    dWorldStep(world, h);
    ground.end_step();
  }
  const dReal* p = dBodyGetPosition(body);
  std::printf("after 3 s: %.3f m travelled, %.1f mm sunk, rut %.1f mm deep\n", p[0], 1e3 * (0.13 - p[2]),
              -1e3 * ground.height(0.5 * p[0], 0.0));
  const bool plausible = p[0] > 0.01 && p[2] < 0.13 && p[2] > 0.08;
  dWorldDestroy(world);
  dCloseODE();
  return plausible ? 0 : 1;
}
