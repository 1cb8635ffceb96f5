// Vectors and the small rigid-body quantities every room shares.
//
// World frame: x forward (direction of travel), y to the left, z up; right-handed. A wheel's own frame has y along its
// axle. Driving rotation is positive about +y (the rim's lowest point moves towards -x). Names carry the frame of
// expression as a suffix: p_W is a position in the world, F_W a force in the world.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace terrode {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;

// Position of a body's origin in the world [m] and the rotation that takes body axes to world axes.
struct Pose {
  Vec3 p_W = Vec3::Zero();
  Quat R_WB = Quat::Identity();
};

// Velocity of the body's origin [m/s] and angular velocity [rad/s], both in world axes.
struct Twist {
  Vec3 v_W = Vec3::Zero();
  Vec3 w_W = Vec3::Zero();
};

// Force [N] and moment [N m] about the body's origin, in world axes, acting on the body.
struct Wrench {
  Vec3 F_W = Vec3::Zero();
  Vec3 M_W = Vec3::Zero();

  Wrench& operator+=(const Wrench& o) {
    F_W += o.F_W;
    M_W += o.M_W;
    return *this;
  }
  Wrench operator*(double a) const { return {F_W * a, M_W * a}; }
};

}  // namespace terrode
