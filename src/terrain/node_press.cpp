// Contact of any other body: plates, feet, rocks, wheels that lie on their side. Each node answers for itself.
#include <algorithm>
#include <cmath>

#include "terrain/node_contact.h"

namespace terrode::terrain {

ContactResult NodeSpringTerrain::press(BodyState& s, const Pose& pose, const Twist& twist,
                                       std::vector<PatchNode>* record) const {
  ContactResult r;
  const double dx = params_.spacing;
  const bool elastic = params_.unloading == Unloading::elastic;
  const BodyState::History& kept = s.kept;
  s.shear_trial.clear();

  const Quat to_body = pose.R_WB.conjugate();
  const auto reach = [&](const Vec3& d) { return (pose.p_W + pose.R_WB * s.shape->support(to_body * d)).dot(d); };
  const int ix0 = static_cast<int>(std::ceil((-reach(-Vec3::UnitX()) - 0.5 * dx) / dx));
  const int ix1 = static_cast<int>(std::floor((reach(Vec3::UnitX()) + 0.5 * dx) / dx));
  const int iy0 = static_cast<int>(std::ceil((-reach(-Vec3::UnitY()) - 0.5 * dx) / dx));
  const int iy1 = static_cast<int>(std::floor((reach(Vec3::UnitY()) + 0.5 * dx) / dx));
  const double lowest = -reach(-Vec3::UnitZ());
  const Vec3 up_B = to_body * Vec3::UnitZ();
  const double start = -2.5 * s.shape->bounding_radius();  // of the lines, below the body's origin

  bekker::Context context;
  context.time = t_;
  context.normal_load = kept.load;
  context.unit_weight = params_.soil.unit_weight();
  context.width = s.width;
  context.forward_velocity = std::hypot(twist.v_W.x(), twist.v_W.y());

  static const Node virgin{};
  Vec3 normal_force = Vec3::Zero(), normal_moment = Vec3::Zero(), shear_force = Vec3::Zero(), shear_moment = Vec3::Zero();
  double unload = 0.0, load = 0.0;
  for (int iy = iy0; iy <= iy1; ++iy) {
    for (int ix = ix0; ix <= ix1; ++ix) {
      const double px = ix * dx, py = iy * dx;
      const double pz = grid_.surface_at({ix, iy}).z;
      const Node* found = grid_.find({ix, iy});
      const Node& node = found ? *found : virgin;
      if (node.removed || lowest > pz + node.raised - node.entry + 0.5 * dx) continue;
      const bool in_contact = node.body == s.id;

      // Lines through the four quarters of the cell; where the body's edge lies between them, through sixty-four parts.
      struct Line {
        double x, y, share;
        wheel::RayHit hit;
      };
      Line lines[64];
      int count = 0, missed = 0;
      const auto cast = [&](int parts) {
        count = missed = 0;
        for (int i = 0; i < parts; ++i)
          for (int j = 0; j < parts; ++j) {
            Line& line = lines[count];
            line.x = px + dx * ((i + 0.5) / parts - 0.5);
            line.y = py + dx * ((j + 0.5) / parts - 0.5);
            line.share = 1.0 / (parts * parts);
            const Vec3 origin(line.x - pose.p_W.x(), line.y - pose.p_W.y(), start);
            if (s.shape->ray(to_body * origin, up_B, line.hit)) ++count;
            else ++missed;
          }
      };
      cast(2);
      if (count > 0 && missed > 0) cast(8);
      if (count == 0) continue;

      // The node as a whole: the mean sinkage under it.
      double mean = 0.0, share = 0.0;
      for (int i = 0; i < count; ++i) {
        const double z = pose.p_W.z() + (pose.R_WB * lines[i].hit.p_B).z();
        mean += lines[i].share * (pz - z + node.raised);
        share += lines[i].share;
      }
      mean /= share;
      if (mean <= node.entry) continue;
      // Below the deepest point it was ever pressed to, the node answers along its unloading line.
      double hold = 1.0, gap = 0.0;
      const double deepest = std::max(node.plastic, in_contact ? node.reached : 0.0);
      if (!elastic && deepest > mean) {
        const double back = springback(soil_at(px, py, deepest), deepest, s.width);
        gap = deepest - mean;
        hold = std::max(0.0, 1.0 - gap / std::max(back, 1e-12));
      }
      // Displacement of the body's surface along the ground since the node came into contact.
      Vec3 middle = Vec3::Zero();
      for (int i = 0; i < count; ++i) middle += lines[i].hit.p_B / count;
      const Vec3 slid = kept.placed ? Vec3(pose.p_W + pose.R_WB * middle - kept.pose.p_W - kept.pose.R_WB * middle) : Vec3::Zero();
      const Vec3 n_mid = pose.R_WB * lines[0].hit.n_B;
      const Vec3 along = slid - slid.dot(n_mid) * n_mid;
      BodyState::Touch touch{{ix, iy}, mean, 0.0, 0.0};
      const ShearPath before = in_contact ? ShearPath{node.shear_x, node.shear_y} : ShearPath{};
      const ShearPath carried = carried_on(before, {along.x(), along.y()}, soil_.shear_modulus);
      touch.shear_x = carried.along;
      touch.shear_y = carried.across;
      s.touches.push_back(touch);

      PatchNode shown;
      bool loaded = false;
      for (int i = 0; i < count; ++i) {
        const Line& line = lines[i];
        const Vec3 arm = pose.R_WB * line.hit.p_B, n = pose.R_WB * line.hit.n_B;
        constexpr double steepest = 1e-3;
        if (-n.z() < steepest) continue;
        const double ground = grid_.level() ? pz : grid_.base(line.x, line.y);
        const double z = ground - (pose.p_W.z() + arm.z()) + node.raised - node.entry;
        if (z <= 0) continue;
        const double sinkage = z + node.entry + gap, held = hold;
        Vec3 j(touch.shear_x, touch.shear_y, 0.0);
        j -= j.dot(n) * n;
        const double length = j.norm();
        const bekker::LocalSoil soil = soil_at(px, py, sinkage);
        const Vec3 v = twist.v_W + twist.w_W.cross(arm);
        bekker::Stress stress;
        if (law_.plain) {
          stress.sigma = held * bekker::power_law_pressure(soil, sinkage);
          stress.tau = (soil.cohesion + stress.sigma * soil.tan_phi) * bekker::janosi_mobilised(soil, length);
        } else {
          bekker::Point point;
          point.sinkage = point.depth = sinkage;
          point.cos_theta = -n.z();
          point.sin_theta = std::sqrt(std::max(0.0, 1.0 - n.z() * n.z()));
          point.theta = std::atan2(point.sin_theta, point.cos_theta);
          point.shear_displacement = length;
          point.slide_speed = (v - v.dot(n) * n).norm();
          point.penetration_speed = std::max(0.0, v.dot(n));
          bekker::Context own = context;
          own.sinkage = sinkage;
          own.pass = node.passes + 1;
          stress = bekker::stress_at(soil, law_, own, point);
          const double full = soil.cohesion + stress.sigma * soil.tan_phi;
          stress.tau *= full > 0 ? (soil.cohesion + held * stress.sigma * soil.tan_phi) / full : held;
          stress.sigma *= held;
        }
        if (held <= 0) continue;
        const double area = line.share * dx * dx * (params_.area == NodeArea::arc ? 1.0 / -n.z() : 1.0);
        const double stiffness = exponent(soil, sinkage) * stress.sigma / sinkage;
        if (damps()) {
          const double press = v.dot(n);
          const double damped = std::max(0.0, stress.sigma + (params_.damping + params_.damping_time * stiffness) * press);
          r.damping_power += area * (damped - stress.sigma) * press;
          stress.sigma = damped;
        }
        const Vec3 push = -area * stress.sigma * n;
        const Vec3 drag = length > 0 ? Vec3(-area * stress.tau / length * j) : Vec3::Zero();
        normal_force += push;
        normal_moment += arm.cross(push);
        shear_force += drag;
        shear_moment += arm.cross(drag);
        r.contact_area += area;
        r.max_sinkage = std::max(r.max_sinkage, z + node.entry - node.raised);
        const double back = std::max(springback(soil, sinkage, s.width), 1e-12);
        if (!elastic) r.stored_energy += 0.5 * area * stress.sigma * held * back;
        unload += area * -n.z() * stress.sigma / back;
        load += area * -n.z() * stiffness;
        loaded = true;
        if (record) {
          shown.area += area;
          shown.p_W += area * (pose.p_W + arm);
          shown.n_W += area * n;
          shown.pressure += area * stress.sigma;
          shown.shear_W += drag;
          shown.sinkage = std::max(shown.sinkage, z + node.entry);
          shown.shear_displacement = length;
        }
      }
      if (!loaded) continue;
      ++r.contact_count;
      if (record && shown.area > 0) {
        shown.p_W /= shown.area;
        shown.n_W.normalize();
        shown.pressure /= shown.area;
        shown.shear_W /= shown.area;
        shown.passes = node.passes;
        record->push_back(shown);
      }
    }
  }
  r.wrench = {normal_force + shear_force, normal_moment + shear_moment};
  r.shear = {shear_force, shear_moment};
  const Vec3 flat(twist.v_W.x(), twist.v_W.y(), 0.0);
  if (flat.norm() > 0) r.compaction_resistance = -normal_force.dot(flat.normalized());
  r.slip_power = -(shear_force.dot(twist.v_W) + shear_moment.dot(twist.w_W));
  r.plastic_power = -(normal_force.dot(twist.v_W) + normal_moment.dot(twist.w_W)) - r.damping_power;
  if (kept.placed && t_ > kept.time) r.plastic_power -= (r.stored_energy - kept.stored) / (t_ - kept.time);
  r.stiffness(2, 2) = load;
  if (!elastic) r.release_stiffness = load + unload;
  if (damps()) r.damping(2, 2) = params_.damping * r.contact_area + params_.damping_time * load;
  s.trial.touching = r.contact_count > 0;
  s.trial.load = r.wrench.F_W.z();
  s.trial.stored = r.stored_energy;
  return r;
}

}  // namespace terrode::terrain
