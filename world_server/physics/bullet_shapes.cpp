#include "world_server/physics/bullet_shapes.h"

#include <btBulletCollisionCommon.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

// A margin rounds edges (1.6 mm and 48 degrees wrong at the default); the last micrometre keeps
// Bullet's distance queries away from its penetration solver when surfaces just touch.
constexpr btScalar kMargin = 1e-6;

class EllipsoidShape final : public btConvexInternalShape {
 public:
  explicit EllipsoidShape(const Vec3& radii) : radii_(ToBullet(radii)) {
    m_shapeType = CUSTOM_CONVEX_SHAPE_TYPE;
    setMargin(0);
  }

  btVector3 localGetSupportingVertexWithoutMargin(const btVector3& direction) const override {
    const btVector3 stretched = radii_ * direction;
    const btScalar length = stretched.length();
    if (length < SIMD_EPSILON) return {radii_.x(), 0, 0};
    return radii_ * stretched / length;
  }
  void batchedUnitVectorGetSupportingVertexWithoutMargin(const btVector3* directions,
                                                         btVector3* supports,
                                                         int count) const override {
    for (int i = 0; i < count; ++i) {
      supports[i] = localGetSupportingVertexWithoutMargin(directions[i]);
    }
  }
  void calculateLocalInertia(btScalar mass, btVector3& inertia) const override {
    const btVector3 squared = radii_ * radii_;
    inertia =
        mass / 5 *
        btVector3(squared.y() + squared.z(), squared.x() + squared.z(), squared.x() + squared.y());
  }
  const char* getName() const override { return "Ellipsoid"; }

 private:
  btVector3 radii_;
};

std::unique_ptr<btCollisionShape> Make(const Box& box) {
  return std::make_unique<btBoxShape>(ToBullet(box.half_extents));
}
std::unique_ptr<btCollisionShape> Make(const Sphere& sphere) {
  return std::make_unique<btSphereShape>(sphere.radius);
}
std::unique_ptr<btCollisionShape> Make(const HalfSpace& half_space) {
  return std::make_unique<btStaticPlaneShape>(ToBullet(half_space.normal), 0);
}
std::unique_ptr<btCollisionShape> Make(const Cylinder& cylinder) {
  return std::make_unique<btCylinderShapeZ>(
      btVector3(cylinder.radius, cylinder.radius, cylinder.half_length));
}
std::unique_ptr<btCollisionShape> Make(const Capsule& capsule) {
  return std::make_unique<btCapsuleShapeZ>(capsule.radius, 2 * capsule.half_length);
}
std::unique_ptr<btCollisionShape> Make(const Ellipsoid& ellipsoid) {
  return std::make_unique<EllipsoidShape>(ellipsoid.radii);
}

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};

constexpr double kInfinite = std::numeric_limits<double>::infinity();

}  // namespace

std::unique_ptr<btCollisionShape> MakeBulletShape(const Shape& shape) {
  auto made = std::visit([](const auto& given) { return Make(given); }, shape);
  // The margin of a sphere or capsule is its radius, an ellipsoid has none.
  if (made->getShapeType() == BOX_SHAPE_PROXYTYPE ||
      made->getShapeType() == CYLINDER_SHAPE_PROXYTYPE) {
    made->setMargin(kMargin);
  }
  return made;
}

double InnerRadius(const Shape& shape) {
  return std::visit(
      Overloaded{[](const Box& box) { return box.half_extents.minCoeff(); },
                 [](const Sphere& sphere) { return sphere.radius; },
                 [](const HalfSpace&) { return kInfinite; },
                 [](const Cylinder& c) { return std::min(c.radius, c.half_length); },
                 [](const Capsule& capsule) { return capsule.radius; },
                 [](const Ellipsoid& ellipsoid) { return ellipsoid.radii.minCoeff(); }},
      shape);
}

double OuterRadius(const Shape& shape) {
  return std::visit(
      Overloaded{[](const Box& box) { return box.half_extents.norm(); },
                 [](const Sphere& sphere) { return sphere.radius; },
                 [](const HalfSpace&) { return kInfinite; },
                 [](const Cylinder& c) { return std::hypot(c.radius, c.half_length); },
                 [](const Capsule& capsule) { return capsule.radius + capsule.half_length; },
                 [](const Ellipsoid& ellipsoid) { return ellipsoid.radii.maxCoeff(); }},
      shape);
}

}  // namespace rikiseki::world
