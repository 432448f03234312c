#include "world_server/physics/bullet_shapes.h"

#include <btBulletCollisionCommon.h>

#include <vector>

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

class MeshShape final : private MeshData, public btBvhTriangleMeshShape {
 public:
  explicit MeshShape(const TriangleMesh& mesh)
      : MeshData(mesh), btBvhTriangleMeshShape(&view, /*useQuantizedAabbCompression=*/true) {
    setMargin(0);
  }
};

class HullShape final : public btConvexHullShape {
 public:
  explicit HullShape(const TriangleMesh& hull) : faces_(hull) {
    for (const Vec3& corner : hull.corners()) addPoint(ToBullet(corner), false);
    recalcLocalAabb();
  }
  const Polyhedron& faces() const { return faces_; }

 private:
  Polyhedron faces_;
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

std::unique_ptr<btCollisionShape> Make(const Hull& hull) {
  return std::make_unique<HullShape>(*hull.mesh);
}
std::unique_ptr<btCollisionShape> Make(const Mesh& mesh) {
  return std::make_unique<MeshShape>(*mesh.mesh);
}

}  // namespace

std::unique_ptr<btCollisionShape> MakeBulletShape(const Shape& shape) {
  auto made = std::visit([](const auto& given) { return Make(given); }, shape);
  // The margin of a sphere or capsule is its radius, an ellipsoid and a mesh have none.
  if (made->getShapeType() == BOX_SHAPE_PROXYTYPE ||
      made->getShapeType() == CYLINDER_SHAPE_PROXYTYPE ||
      made->getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE) {
    made->setMargin(kMargin);
  }
  return made;
}

const Polyhedron& FacesOf(const btConvexHullShape& hull) {
  return static_cast<const HullShape&>(hull).faces();
}

}  // namespace rikiseki::world
