// Inside of the node-spring ground: what is remembered of a body, and the sums over its nodes. Included by
// node_spring.cpp, node_roll.cpp and node_press.cpp alone.
#pragma once

#include <algorithm>
#include <cmath>

#include "terrain/node_spring.h"
#include "terrain/rim_shear.h"
#include "wheel/body.h"
#include "wheel/wheel.h"

namespace terrode::terrain {

// What a part of the contact gives per metre of width, moments about the axle's middle.
struct RollCell {
  Vec3 normal = Vec3::Zero(), normal_moment = Vec3::Zero(), shear = Vec3::Zero(), shear_moment = Vec3::Zero();
  double drive = 0, drag = 0, area = 0, compaction = 0, stored = 0, damping_power = 0, unload = 0, load = 0, slide = 0, stick = 0, rear = 0;
  double max_sinkage = 0, max_shear = 0, side = 0;
  bool loaded = false;

  // Adds `w` times the sums of another.
  void add(const RollCell& c, double w) {
    normal += w * c.normal;
    normal_moment += w * c.normal_moment;
    shear += w * c.shear;
    shear_moment += w * c.shear_moment;
    drive += w * c.drive;
    drag += w * c.drag;
    area += w * c.area;
    compaction += w * c.compaction;
    stored += w * c.stored;
    damping_power += w * c.damping_power;
    unload += w * c.unload;
    load += w * c.load;
    slide += w * c.slide;
    stick += w * c.stick;
    rear += w * c.rear;
  }
};

// A piece of a contact that is alike in all strips: what it gives at three Gauss points, and how much of the width the
// nodes put on each.
struct RollPanel {
  double begin = 0.0, end = 0.0, length = 0.0;  // along the travel [m]
  int root = 0;                      // +1: the coordinate is squared at the end, -1: at the beginning
  RollCell at[3];                    // times dx/du
  double width[3] = {}, moment[3] = {};  // [m], [m2] about the middle of the axle

  // Place of x within the panel, from 0 to 1, in its own coordinate.
  double coordinate(double x) const {
    const double share = std::clamp((x - begin) / length, 0.0, 1.0);
    return root == 0 ? share : root > 0 ? std::sqrt(1.0 - share) : std::sqrt(share);
  }
};

struct NodeSpringTerrain::BodyState {
  // What one node will remember of a trial.
  struct Touch {
    NodeIndex index;
    double reached = 0.0;  // sinkage of the node under the body [m]
    double shear_x = 0.0, shear_y = 0.0;
  };

  // What a trial computes and a commit keeps, apart from nodes and shear.
  struct History {
    bool placed = false;  // a pose is known
    Pose pose;
    double time = 0.0;
    double direction = 1.0;  // of travel along the heading: +1 or -1
    double backing = 0.0;    // [m] moved against it
    double spin = 0.0;       // [rad] of the body about its axle, from the contact frame
    Vec3 heading = Vec3::UnitX(), axle = Vec3::UnitY();
    bool touching = false;
    double exit = 0.0;    // moving part of theta_r [rad]
    double slip_now = 0.0;  // of the motion at that instant
    double rolled = 1.0, gone = 1.0;  // of the rim and of the axle per path, lately; their ratio is the slip that the soil feels
    double load = 0.0;    // [N]
    double stored = 0.0;  // [J]
    double travel = 0.0;  // [m]
    double turned = 0.0;  // [rad]
  };

  BodyId id = 0;
  std::shared_ptr<const wheel::Body> shape;
  double width = 0.0;  // of the contact, the smaller way [m]
  const wheel::Wheel* wheel = nullptr;  // the same, where it is one
  History kept, trial;
  bool tried = false;
  Pose trial_pose;
  Twist trial_twist;

  // Rolling bodies: strips of the width, from right to left.
  std::vector<double> offsets;      // of a strip's middle along the axle [m]
  std::vector<double> entry_angle, kept_entry;  // of the last trial; of the last commit, the next ones' first guess
  std::vector<bekker::ContactArc> arcs;
  std::vector<double> exit_sine;
  std::vector<double> rear_end, rear_share;  // end of the part that gives way as the exit moves [m]; 1/its angle [1/rad]
  std::vector<double> rear_reach;  // place of the exit in steady rolling [m], 0 or behind
  RimShear shear, shear_trial;
  std::vector<RollPanel> panels;

  std::vector<Touch> touches;      // of the last trial
  std::vector<NodeIndex> contact;  // as committed
};

// Sums over nodes, in the frame of the contact, about the body's origin.
struct NodeSpringTerrain::Sums {
  Vec3 normal = Vec3::Zero(), normal_moment = Vec3::Zero();
  Vec3 shear = Vec3::Zero(), shear_moment = Vec3::Zero();
  double drive = 0.0, drag = 0.0;  // [N] of soil wedges
  double area = 0.0, compaction = 0.0, stored = 0.0, damping_power = 0.0, max_sinkage = 0.0;
  double unload_stiffness = 0.0, load_stiffness = 0.0;  // [N/m] along the ground's normal
  double exit_stiffness = 0.0;   // [N/rad] lost as the exit moves forwards
  double shear_stiffness = 0.0, stick_stiffness = 0.0;  // [N/m] along the ground: at most; in the sense in which it is sheared
  int count = 0;
};

}  // namespace terrode::terrain
