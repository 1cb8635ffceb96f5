// Rigid wheels: a circular rim, flat or crowned across its width, with grousers.
#pragma once

#include "wheel/body.h"
#include "wheel/convex.h"

namespace terrode::wheel {

enum class GrouserShape { straight, tapered, triangular };

// Lugs across the whole width. `thickness` is measured along the rim at the root; `tip_thickness` at the tip counts for
// `tapered` alone. `phase` is the angle [rad] of the first one, about +y from the downward direction -z towards -x
// (the way a driven rim's lowest point moves).
struct Grousers {
  int count = 0;          // 0: none
  double height = 0.0;    // [m] above the rim
  double thickness = 0.0; // [m]
  double tip_thickness = 0.0;  // [m]
  GrouserShape shape = GrouserShape::straight;
  double phase = 0.0;     // [rad]
};

struct WheelShape {
  double radius = 0.13;        // [m] of the rim without lugs, at mid-width
  double width = 0.16;         // [m]
  double crown_radius = 0.0;   // [m] of the rim's profile across the width; 0: a flat rim (cylinder)
  Grousers grousers;

  Problems validate() const;
};

// A surface of revolution about body y, radius R(y) = radius - (C - sqrt(C^2 - y^2)) with crown radius C (R = radius
// for a flat rim), closed by flat side walls at y = +-width/2, and grousers as convex prisms. The union of both touches.
class Wheel final : public Body {
 public:
  // Throws InputError with every problem of the shape.
  explicit Wheel(const WheelShape& shape);

  const WheelShape& shape() const { return shape_; }
  double radius_at(double y) const;

  bool ray(const Vec3& origin_B, const Vec3& direction_B, RayHit& hit) const override;
  Closest closest(const Vec3& p_B) const override;
  Vec3 support(const Vec3& direction_B) const override;
  double bounding_radius() const override { return bounding_radius_; }
  const Rolling* rolling() const override { return &rolling_; }
  bool plain_cylinder() const override { return shape_.crown_radius == 0.0 && lugs_.empty(); }
  std::string name() const override { return "wheel"; }

 private:
  struct Lug {
    double c, s;  // cosine and sine of its angle
  };
  bool rim_ray(const Vec3& o, const Vec3& d, RayHit& hit) const;
  Closest rim_closest(const Vec3& p) const;
  Vec3 to_lug(const Lug& lug, const Vec3& p) const { return {lug.c * p.x() - lug.s * p.z(), p.y(), lug.s * p.x() + lug.c * p.z()}; }
  Vec3 from_lug(const Lug& lug, const Vec3& p) const { return {lug.c * p.x() + lug.s * p.z(), p.y(), -lug.s * p.x() + lug.c * p.z()}; }

  WheelShape shape_;
  Rolling rolling_;
  std::vector<Lug> lugs_;
  std::vector<Prism> lug_shape_;  // one, in the frame of a lug that points down (empty without lugs)
  double bounding_radius_ = 0.0;
};

}  // namespace terrode::wheel
