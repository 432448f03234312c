#include "world_server/physics/box_plane_contact.h"

#include <btBulletCollisionCommon.h>

namespace rikiseki::world {
namespace {

class Algorithm final : public btCollisionAlgorithm {
 public:
  Algorithm(const btCollisionAlgorithmConstructionInfo& info, bool plane_first)
      : btCollisionAlgorithm(info), plane_first_(plane_first) {}
  ~Algorithm() override {
    if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
  }

  void processCollision(const btCollisionObjectWrapper* body0,
                        const btCollisionObjectWrapper* body1, const btDispatcherInfo&,
                        btManifoldResult* result) override {
    const auto* box_object = plane_first_ ? body1 : body0;
    const auto* plane_object = plane_first_ ? body0 : body1;
    const auto& box = *static_cast<const btBoxShape*>(box_object->getCollisionShape());
    const auto& plane = *static_cast<const btStaticPlaneShape*>(plane_object->getCollisionShape());
    if (manifold_ == nullptr) {
      // The box comes first, so that Bullet recognises a contact by its corner, and its accumulated
      // impulse rides along when the box slides.
      manifold_ = m_dispatcher->getNewManifold(box_object->getCollisionObject(),
                                               plane_object->getCollisionObject());
    }
    result->setPersistentManifold(manifold_);

    const btTransform& plane_pose = plane_object->getWorldTransform();
    const btTransform& box_pose = box_object->getWorldTransform();
    const btVector3 normal = plane_pose.getBasis() * plane.getPlaneNormal();
    const btVector3 normal_in_box = normal * box_pose.getBasis();
    const btVector3 half = box.getHalfExtentsWithMargin();

    const int axis = normal_in_box.absolute().maxAxis();
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    for (const int sign_u : {-1, 1}) {
      for (const int sign_v : {-1, 1}) {
        btVector3 corner = half;
        if (normal_in_box[axis] > 0) corner[axis] = -half[axis];
        corner[u] = sign_u * half[u];
        corner[v] = sign_v * half[v];
        const btVector3 corner_W = box_pose * corner;
        const btScalar distance =
            normal.dot(corner_W - plane_pose.getOrigin()) - plane.getPlaneConstant();
        if (distance > manifold_->getContactBreakingThreshold()) continue;
        result->addContactPoint(normal, corner_W - distance * normal, distance);
      }
    }
    result->refreshContactPoints();
  }

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1;
  }

  void getAllContactManifolds(btManifoldArray& manifolds) override {
    if (manifold_ != nullptr) manifolds.push_back(manifold_);
  }

 private:
  bool plane_first_;
  btPersistentManifold* manifold_ = nullptr;
};

class Create final : public btCollisionAlgorithmCreateFunc {
 public:
  explicit Create(bool plane_first) : plane_first_(plane_first) {}
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper*,
                                                 const btCollisionObjectWrapper*) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
    return new (memory) Algorithm(info, plane_first_);
  }

 private:
  bool plane_first_;
};

}  // namespace

BoxPlaneContact::BoxPlaneContact(btCollisionDispatcher& dispatcher)
    : box_first_(std::make_unique<Create>(false)), plane_first_(std::make_unique<Create>(true)) {
  dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE,
                                         box_first_.get());
  dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, BOX_SHAPE_PROXYTYPE,
                                         plane_first_.get());
}

BoxPlaneContact::~BoxPlaneContact() = default;

}  // namespace rikiseki::world
