#include "multibody/collisions.h"

#include <ode/ode.h>

#include <cmath>
#include <limits>

#include "multibody/world.h"

namespace terrode::multibody {

namespace {

constexpr int most_points = 16;  // of one pair of shapes
// Velocity that friction gives way per newton [m/s/N]: contact points of a flat face are redundant, and this shares
// their load. A rock of 100 N creeps by 1e-5 m/s.
constexpr double friction_slip = 1e-7;

Vec3 vec(const dReal* v) { return {v[0], v[1], v[2]}; }

}  // namespace

Problems CollisionShape::validate(const std::string& key) const {
  Problems p;
  if (kind == ShapeKind::box) {
    if (!(size.allFinite() && size.minCoeff() > 0.0))
      p.push_back({{}, 0, 0, key + ".size", "has an edge of 0 or less", "three lengths above 0"});
    return p;
  }
  require(p, key + ".radius", radius, "m", radius > 0.0, "a length above 0");
  if (kind == ShapeKind::cylinder) require(p, key + ".width", width, "m", width > 0.0, "a length above 0");
  return p;
}

Problems ContactLaw::validate(const std::string& key) const {
  Problems p;
  require(p, key + ".friction", friction, "-", friction >= 0.0, "0 or more");
  require(p, key + ".stiffness", stiffness, "N/m", stiffness > 0.0, "above 0");
  require(p, key + ".damping", damping, "N s/m", damping >= 0.0, "0 or more");
  return p;
}

struct Collisions::Touch {
  dJointID joint;
  dJointFeedback feedback;
  std::size_t first, second;  // items
};

Collisions::Collisions(World& world) : world_(world) {}

Collisions::~Collisions() {
  for (Item& i : items_) dGeomDestroy(i.geom);
  if (group_ != nullptr) dJointGroupDestroy(group_);
}

void Collisions::set_law(const ContactLaw& law) {
  throw_if_any(law.validate("contact"));
  law_ = law;
}

void Collisions::add(Body* body, const CollisionShape& shape, const Pose& pose, int group) {
  throw_if_any(shape.validate(body != nullptr ? body->name() : "shape"));
  Item item;
  item.body = body;
  item.group = group;
  Quat turn = pose.R_WB;
  switch (shape.kind) {
    case ShapeKind::sphere:
      item.geom = dCreateSphere(nullptr, shape.radius);
      break;
    case ShapeKind::box:
      item.geom = dCreateBox(nullptr, shape.size.x(), shape.size.y(), shape.size.z());
      break;
    case ShapeKind::cylinder: {
      // ODE's cylinders stand along z.
      item.geom = dCreateCylinder(nullptr, shape.radius, shape.width);
      const Quat along_y(Eigen::AngleAxisd(-0.5 * M_PI, Vec3::UnitX()));
      turn = turn * along_y;
      if (body != nullptr) {
        dGeomSetBody(item.geom, body->id_);
        const dQuaternion q = {along_y.w(), along_y.x(), along_y.y(), along_y.z()};
        dGeomSetOffsetQuaternion(item.geom, q);
      }
      break;
    }
  }
  if (body != nullptr) {
    dGeomSetBody(item.geom, body->id_);
  } else {
    const dQuaternion q = {turn.w(), turn.x(), turn.y(), turn.z()};
    dGeomSetPosition(item.geom, pose.p_W.x(), pose.p_W.y(), pose.p_W.z());
    dGeomSetQuaternion(item.geom, q);
  }
  if (group_ == nullptr) group_ = dJointGroupCreate(0);
  items_.push_back(item);
  touches_.reserve(256);
}

void Collisions::begin_step(double h) {
  touches_.clear();
  count_ = 0;
  if (items_.empty()) return;
  dJointGroupEmpty(group_);  // of a step that failed
  for (Item& i : items_) {
    if (i.body == nullptr) continue;
    const Twist u = i.body->twist();
    i.velocity = u.v_W;
    i.spin = u.w_W;
    i.body->contact_load_ = {};
  }
  const double d = h * law_.stiffness + law_.damping;
  dContactGeom points[most_points];
  for (std::size_t a = 0; a < items_.size(); ++a) {
    dReal box_a[6];
    dGeomGetAABB(items_[a].geom, box_a);
    for (std::size_t b = a + 1; b < items_.size(); ++b) {
      const Item &p = items_[a], &q = items_[b];
      if ((p.body == nullptr && q.body == nullptr) || (p.group == q.group && p.group != 0)) continue;
      dReal box_b[6];
      dGeomGetAABB(q.geom, box_b);
      bool apart = false;
      for (int i = 0; i < 6; i += 2) apart = apart || box_a[i] > box_b[i + 1] || box_b[i] > box_a[i + 1];
      if (apart) continue;
      // The first shape has a body: ODE mirrors joints that hang on their second body alone.
      const std::size_t one = p.body != nullptr ? a : b, two = p.body != nullptr ? b : a;
      const Item &first = items_[one], &second = items_[two];
      const int n = dCollide(first.geom, second.geom, most_points, points, sizeof(dContactGeom));
      for (int i = 0; i < n; ++i) {
        dContact c = {};
        c.geom = points[i];
        c.surface.mode = dContactApprox1 | dContactSoftERP | dContactSoftCFM | dContactSlip1 | dContactSlip2;
        c.surface.mu = law_.friction;
        c.surface.soft_erp = h * law_.stiffness / d;
        c.surface.soft_cfm = 1.0 / d;
        c.surface.slip1 = c.surface.slip2 = friction_slip;
        const Vec3 at = vec(points[i].pos), normal = vec(points[i].normal);
        Vec3 slide = first.velocity + first.spin.cross(at - first.body->pose().p_W);
        if (second.body != nullptr) slide -= second.velocity + second.spin.cross(at - second.body->pose().p_W);
        slide -= slide.dot(normal) * normal;
        const double speed = slide.norm();
        constexpr double sliding = 1e-6;  // m/s
        if (speed > sliding) {
          c.surface.mode |= dContactFDir1;
          for (int k = 0; k < 3; ++k) c.fdir1[k] = slide[k] / speed;
        }
        touches_.push_back({dJointCreateContact(world_.id_, group_, &c), {}, one, two});
        dJointAttach(touches_.back().joint, first.body->id_, second.body != nullptr ? second.body->id_ : nullptr);
      }
    }
  }
  // Their addresses hold from here on.
  for (Touch& t : touches_) {
    t.feedback.f1[0] = std::numeric_limits<double>::quiet_NaN();
    dJointSetFeedback(t.joint, &t.feedback);
  }
  count_ = touches_.size();
}

void Collisions::end_step(double h) {
  if (items_.empty()) return;
  for (const Touch& t : touches_) {
    if (std::isnan(t.feedback.f1[0])) continue;
    const auto take = [&](const Item& i, const Vec3& F, const Vec3& M) {
      if (i.body == nullptr) return;
      const Twist after = i.body->twist();
      i.body->contact_load_ += Wrench{F, M};
      work -= 0.5 * h * (F.dot(i.velocity + after.v_W) + M.dot(i.spin + after.w_W));
    };
    take(items_[t.first], vec(t.feedback.f1), vec(t.feedback.t1));
    take(items_[t.second], vec(t.feedback.f2), vec(t.feedback.t2));
  }
  dJointGroupEmpty(group_);
}

}  // namespace terrode::multibody
