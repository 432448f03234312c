// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_rebound.h"

#include <algorithm>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr int kSweeps = 20;  // over the contacts that bounce at once

struct Bounce {
  btRigidBody *first, *second;
  btVector3 normal;  // out of the second
  btVector3 arm_first, arm_second;
  btScalar yield = 0;   // m/s per N s
  btScalar target = 0;  // m/s, apart
  btScalar impulse = 0;

  btScalar Speed() const {
    return normal.dot(first->getVelocityInLocalPoint(arm_first) -
                      second->getVelocityInLocalPoint(arm_second));
  }
};

// Of the body's material at the start of the substep.
btVector3 SpeedBefore(const btRigidBody& rigid, const BulletBodies& bodies, const btVector3& arm) {
  if (rigid.getUserIndex() < 0) return btVector3(0, 0, 0);
  const MovingBody& body = bodies.moving[static_cast<std::size_t>(rigid.getUserIndex())];
  return ToBullet(body.velocity) + ToBullet(body.angular_velocity).cross(arm);
}

}  // namespace

bool Rebound(std::span<btPersistentManifold* const> manifolds, const BulletBodies& bodies,
             double gravity, double step_s) {
  const btScalar slowest = std::max(kSlowestBounce, 2 * gravity * step_s);
  std::vector<Bounce> bounces;
  for (const btPersistentManifold* each : manifolds) {
    const btPersistentManifold& manifold = *each;
    auto* first = const_cast<btRigidBody*>(btRigidBody::upcast(manifold.getBody0()));
    auto* second = const_cast<btRigidBody*>(btRigidBody::upcast(manifold.getBody1()));
    const btScalar restitution =
        bodies.restitutions[static_cast<std::size_t>(first->getUserIndex3())] *
        bodies.restitutions[static_cast<std::size_t>(second->getUserIndex3())];
    if (!(restitution > 0)) continue;
    for (int j = 0; j < manifold.getNumContacts(); ++j) {
      const btManifoldPoint& point = manifold.getContactPoint(j);
      if (!(point.m_appliedImpulse > 0)) continue;
      Bounce bounce{first, second, point.m_normalWorldOnB,
                    point.getPositionWorldOnA() - first->getCenterOfMassPosition(),
                    point.getPositionWorldOnB() - second->getCenterOfMassPosition()};
      const btScalar closing = bounce.normal.dot(SpeedBefore(*second, bodies, bounce.arm_second) -
                                                 SpeedBefore(*first, bodies, bounce.arm_first));
      if (closing < slowest) continue;
      bounce.target = restitution * closing;
      bounce.yield = first->computeImpulseDenominator(point.getPositionWorldOnA(), bounce.normal) +
                     second->computeImpulseDenominator(point.getPositionWorldOnB(), bounce.normal);
      if (bounce.yield > 0) bounces.push_back(bounce);
    }
  }
  for (int sweep = 0; sweep < (bounces.size() > 1 ? kSweeps : 1); ++sweep) {
    for (Bounce& bounce : bounces) {
      const btScalar before = bounce.impulse;
      bounce.impulse =
          std::max(before + (bounce.target - bounce.Speed()) / bounce.yield, btScalar(0));
      const btVector3 change = (bounce.impulse - before) * bounce.normal;
      bounce.first->applyImpulse(change, bounce.arm_first);
      bounce.second->applyImpulse(-change, bounce.arm_second);
    }
  }
  return !bounces.empty();
}

}  // namespace rikiseki::world
