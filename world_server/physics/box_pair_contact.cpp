#include "world_server/physics/box_pair_contact.h"

#include <btBulletCollisionCommon.h>

#include "world_server/physics/box_box_contact.h"
#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

// As far as the broad phase finds pairs: nothing slower than 20 m/s closes such a gap in 1 ms.
constexpr double kReach = 0.02;  // m

Box BoxOf(const btCollisionObjectWrapper& object) {
  const auto& shape = *static_cast<const btBoxShape*>(object.getCollisionShape());
  return {FromBullet(shape.getHalfExtentsWithMargin())};
}

class Algorithm final : public btCollisionAlgorithm {
 public:
  explicit Algorithm(const btCollisionAlgorithmConstructionInfo& info)
      : btCollisionAlgorithm(info) {}
  ~Algorithm() override {
    if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
  }

  void processCollision(const btCollisionObjectWrapper* body0,
                        const btCollisionObjectWrapper* body1, const btDispatcherInfo&,
                        btManifoldResult* result) override {
    if (manifold_ == nullptr) {
      manifold_ =
          m_dispatcher->getNewManifold(body0->getCollisionObject(), body1->getCollisionObject());
      manifold_->setContactBreakingThreshold(kReach);
    }
    result->setPersistentManifold(manifold_);
    for (const ContactPoint& point :
         FindBoxBoxContact(BoxOf(*body0), FromBullet(body0->getWorldTransform()), BoxOf(*body1),
                           FromBullet(body1->getWorldTransform()), kReach)) {
      result->addContactPoint(ToBullet(point.normal_W),
                              ToBullet(Vec3(point.point_W - point.gap * point.normal_W)),
                              point.gap);
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
  btPersistentManifold* manifold_ = nullptr;
};

class Create final : public btCollisionAlgorithmCreateFunc {
 public:
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper*,
                                                 const btCollisionObjectWrapper*) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
    return new (memory) Algorithm(info);
  }
};

}  // namespace

BoxPairContact::BoxPairContact(btCollisionDispatcher& dispatcher)
    : create_(std::make_unique<Create>()) {
  dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, create_.get());
}

BoxPairContact::~BoxPairContact() = default;

}  // namespace rikiseki::world
