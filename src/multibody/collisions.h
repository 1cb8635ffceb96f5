// Rigid bodies that touch each other: shapes on bodies or fixed in the world, found and held apart by ODE's colliders
// and contact joints. Soil is not among them: it answers through forces.
//
// Every contact is a unilateral spring and damper, solved with the step (ODE's soft contact: erp = h k/(h k + c),
// cfm = 1/(h k + c)), and Coulomb friction whose first direction is that of sliding.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/frames.h"
#include "core/problem.h"

struct dxGeom;
struct dxJointGroup;

namespace terrode::multibody {

class World;
class Body;

enum class ShapeKind { sphere, box, cylinder };

// Centred on the body's origin. A cylinder's axis is the body's y.
struct CollisionShape {
  ShapeKind kind = ShapeKind::box;
  double radius = 0.0;                // m, sphere and cylinder
  double width = 0.0;                 // m, of the cylinder
  Vec3 size = Vec3::Zero();           // m, edges of the box
  Problems validate(const std::string& key) const;
};

struct ContactLaw {
  double friction = 0.7;    // Coulomb's mu
  double stiffness = 1e6;   // N/m of each contact point
  double damping = 5e3;     // N s/m
  Problems validate(const std::string& key) const;
};

// The shapes of a world and their contacts in the present step. Belongs to a World, which calls it.
class Collisions {
 public:
  explicit Collisions(World& world);
  ~Collisions();
  Collisions(const Collisions&) = delete;
  Collisions& operator=(const Collisions&) = delete;

  // Shapes of one group do not feel each other; those of group 0 feel all. Without a body the shape stands fixed at
  // `pose`. Throws InputError.
  void add(Body* body, const CollisionShape& shape, const Pose& pose, int group);
  void set_law(const ContactLaw& law);

  void begin_step(double h);  // makes the contact joints
  void end_step(double h);    // reads their forces and removes them

  // Work that bodies have given into their contacts since the start [J]: friction, damping and springs.
  double work = 0.0;
  std::size_t count() const { return count_; }  // contact points of the last step

 private:
  struct Item {
    dxGeom* geom = nullptr;
    Body* body = nullptr;
    int group = 0;
    Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  // of its body at the step's beginning
  };
  struct Touch;
  World& world_;
  ContactLaw law_;
  std::vector<Item> items_;
  std::vector<Touch> touches_;
  dxJointGroup* group_ = nullptr;
  std::size_t count_ = 0;
};

}  // namespace terrode::multibody
