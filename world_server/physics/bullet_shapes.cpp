// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_shapes.h"

#include <btBulletCollisionCommon.h>

#include <vector>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

// A margin rounds edges (1.6 mm and 48 degrees wrong at the default); the last micrometre keeps
// Bullet's distance queries away from its penetration solver when surfaces just touch.
constexpr btScalar kMargin = 1e-6;

class EllipsoidShape : public btConvexInternalShape {
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

// Bullet's mesh keeps pointers to what it is made of.
struct MeshData {
  std::vector<btVector3> corners;
  std::vector<int> indices;
  btTriangleIndexVertexArray view;

  explicit MeshData(const TriangleMesh& mesh) {
    for (const Vec3& corner : mesh.corners()) corners.push_back(ToBullet(corner));
    for (const TriangleMesh::Face& face : mesh.faces()) {
      for (const std::uint32_t corner : face.corners) indices.push_back(static_cast<int>(corner));
    }
    btIndexedMesh part;
    part.m_numTriangles = static_cast<int>(mesh.faces().size());
    part.m_triangleIndexBase = reinterpret_cast<const unsigned char*>(indices.data());
    part.m_triangleIndexStride = 3 * sizeof(int);
    part.m_numVertices = static_cast<int>(corners.size());
    part.m_vertexBase = reinterpret_cast<const unsigned char*>(corners.data());
    part.m_vertexStride = sizeof(btVector3);
    part.m_vertexType = PHY_DOUBLE;
    view.addIndexedMesh(part, PHY_INTEGER);
  }
};

class MeshShape : private MeshData, public btBvhTriangleMeshShape {
 public:
  explicit MeshShape(const TriangleMesh& mesh)
      : MeshData(mesh), btBvhTriangleMeshShape(&view, /*useQuantizedAabbCompression=*/true) {
    setMargin(0);
  }
};

// A shape of Bullet's that knows which shape of ours it stands for.
template <typename BulletShape>
class Standing final : public BulletShape {
 public:
  template <typename... Arguments>
  explicit Standing(const Shape& shape, const Arguments&... arguments)
      : BulletShape(arguments...), solid_(shape) {
    this->setUserPointer(&solid_);
  }

 private:
  Solid solid_;
};

template <typename BulletShape, typename... Arguments>
std::unique_ptr<btCollisionShape> Stand(const Shape& shape, const Arguments&... arguments) {
  return std::make_unique<Standing<BulletShape>>(shape, arguments...);
}

std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Box& box) {
  return Stand<btBoxShape>(shape, ToBullet(box.half_extents));
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Sphere& sphere) {
  return Stand<btSphereShape>(shape, sphere.radius);
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const HalfSpace& half_space) {
  return Stand<btStaticPlaneShape>(shape, ToBullet(half_space.normal), btScalar(0));
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Cylinder& cylinder) {
  return Stand<btCylinderShapeZ>(shape,
                                 btVector3(cylinder.radius, cylinder.radius, cylinder.half_length));
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Capsule& capsule) {
  return Stand<btCapsuleShapeZ>(shape, capsule.radius, 2 * capsule.half_length);
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Ellipsoid& ellipsoid) {
  return Stand<EllipsoidShape>(shape, ellipsoid.radii);
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Hull& hull) {
  auto made = std::make_unique<Standing<btConvexHullShape>>(shape);
  for (const Vec3& corner : hull.mesh->corners()) made->addPoint(ToBullet(corner), false);
  made->recalcLocalAabb();
  return made;
}
std::unique_ptr<btCollisionShape> Make(const Shape& shape, const Mesh& mesh) {
  return Stand<MeshShape>(shape, *mesh.mesh);
}

}  // namespace

std::unique_ptr<btCollisionShape> MakeBulletShape(const Shape& shape) {
  auto made = std::visit([&](const auto& given) { return Make(shape, given); }, shape);
  // The margin of a sphere or capsule is its radius, an ellipsoid and a mesh have none.
  if (made->getShapeType() == BOX_SHAPE_PROXYTYPE ||
      made->getShapeType() == CYLINDER_SHAPE_PROXYTYPE ||
      made->getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE) {
    made->setMargin(kMargin);
  }
  return made;
}

const Solid& SolidOf(const btCollisionShape& made) {
  return *static_cast<const Solid*>(made.getUserPointer());
}

}  // namespace rikiseki::world
