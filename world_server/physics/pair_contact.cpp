// SPDX-License-Identifier: MIT
#include "world_server/physics/pair_contact.h"

#include <btBulletCollisionCommon.h>

#include <limits>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

// As far as the broad phase finds pairs: nothing slower than 20 m/s closes such a gap in 1 ms.
constexpr double kReach = 0.02;  // m

class Algorithm final : public btCollisionAlgorithm {
 public:
  Algorithm(const btCollisionAlgorithmConstructionInfo& info, FindPairContact find, bool swapped)
      : btCollisionAlgorithm(info), find_(find), swapped_(swapped) {}
  ~Algorithm() override {
    for (int i = 0; i < manifolds_.size(); ++i) m_dispatcher->releaseManifold(manifolds_[i]);
  }

  void processCollision(const btCollisionObjectWrapper* body0,
                        const btCollisionObjectWrapper* body1, const btDispatcherInfo&,
                        btManifoldResult*) override {
    const btCollisionObjectWrapper& first = swapped_ ? *body1 : *body0;
    const btCollisionObjectWrapper& second = swapped_ ? *body0 : *body1;
    const std::vector<ContactPoint> found = find_(first, second, kReach);
    std::vector<btManifoldPoint> last;
    for (int i = 0; i < manifolds_.size(); ++i) {
      btPersistentManifold& manifold = *manifolds_[i];
      for (int j = 0; j < manifold.getNumContacts(); ++j) {
        last.push_back(manifold.getContactPoint(j));
      }
      manifold.clearManifold();
    }
    std::size_t added = 0;
    for (const ContactPoint& point : found) {
      btManifoldPoint made = Make(point, *first.getCollisionObject(), *second.getCollisionObject());
      TakeImpulse(last, made);
      Manifold(static_cast<int>(added / MANIFOLD_CACHE_SIZE), first, second).addManifoldPoint(made);
      ++added;
    }
  }

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1;
  }

  void getAllContactManifolds(btManifoldArray& manifolds) override {
    for (int i = 0; i < manifolds_.size(); ++i) manifolds.push_back(manifolds_[i]);
  }

 private:
  btPersistentManifold& Manifold(int index, const btCollisionObjectWrapper& first,
                                 const btCollisionObjectWrapper& second) {
    if (index == manifolds_.size()) {
      manifolds_.push_back(
          m_dispatcher->getNewManifold(first.getCollisionObject(), second.getCollisionObject()));
      manifolds_[index]->setContactBreakingThreshold(kReach);
    }
    return *manifolds_[index];
  }

  static btManifoldPoint Make(const ContactPoint& point, const btCollisionObject& first,
                              const btCollisionObject& second) {
    const btVector3 on_first = ToBullet(point.point_W);
    const btVector3 on_second = ToBullet(Vec3(point.point_W - point.gap * point.normal_W));
    btManifoldPoint made(first.getWorldTransform().invXform(on_first),
                         second.getWorldTransform().invXform(on_second), ToBullet(point.normal_W),
                         point.gap);
    made.m_positionWorldOnA = on_first;
    made.m_positionWorldOnB = on_second;
    made.m_combinedFriction = btManifoldResult::calculateCombinedFriction(&first, &second);
    btPlaneSpace1(made.m_normalWorldOnB, made.m_lateralFrictionDir1, made.m_lateralFrictionDir2);
    return made;
  }

  // From the nearest of the last substep's points that has not given its impulse yet.
  static void TakeImpulse(std::vector<btManifoldPoint>& last, btManifoldPoint& point) {
    std::size_t nearest = last.size();
    btScalar distance = std::numeric_limits<btScalar>::infinity();
    for (std::size_t i = 0; i < last.size(); ++i) {
      const btScalar found = last[i].m_localPointA.distance2(point.m_localPointA);
      if (found >= distance) continue;
      distance = found;
      nearest = i;
    }
    if (nearest == last.size()) return;
    point.m_appliedImpulse = last[nearest].m_appliedImpulse;
    point.m_appliedImpulseLateral1 = last[nearest].m_appliedImpulseLateral1;
    point.m_appliedImpulseLateral2 = last[nearest].m_appliedImpulseLateral2;
    point.m_lateralFrictionDir1 = last[nearest].m_lateralFrictionDir1;
    point.m_lateralFrictionDir2 = last[nearest].m_lateralFrictionDir2;
    point.m_prevRHS = last[nearest].m_prevRHS;
    point.m_lifeTime = last[nearest].m_lifeTime;
    last.erase(last.begin() + static_cast<std::ptrdiff_t>(nearest));
  }

  FindPairContact find_;
  bool swapped_;
  btManifoldArray manifolds_;
};

class Create final : public btCollisionAlgorithmCreateFunc {
 public:
  Create(FindPairContact find, bool swapped) : find_(find), swapped_order_(swapped) {}
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper*,
                                                 const btCollisionObjectWrapper*) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
    return new (memory) Algorithm(info, find_, swapped_order_);
  }

 private:
  FindPairContact find_;
  bool swapped_order_;
};

}  // namespace

PairContact::PairContact(btCollisionDispatcher& dispatcher, int first_type, int second_type,
                         FindPairContact find)
    : in_order_(std::make_unique<Create>(find, false)),
      swapped_(std::make_unique<Create>(find, true)) {
  dispatcher.registerCollisionCreateFunc(second_type, first_type, swapped_.get());
  dispatcher.registerCollisionCreateFunc(first_type, second_type, in_order_.get());
}

PairContact::~PairContact() = default;
PairContact::PairContact(PairContact&&) noexcept = default;

}  // namespace rikiseki::world
