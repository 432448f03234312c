#include "world_server/physics/bullet_hooks.h"

#include <btBulletDynamicsCommon.h>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr double kStale = 1e-5;  // m of sliding in one substep

const btRigidBody* Body(const btCollisionObject* object) {
  return btRigidBody::upcast(object);
}

// Tangential relative velocity at a contact point.
Vec3 Slip(const btPersistentManifold& manifold, const btManifoldPoint& point) {
  const auto velocity = [](const btRigidBody* body, const btVector3& where) {
    return body->getVelocityInLocalPoint(where - body->getWorldTransform().getOrigin());
  };
  const btVector3 relative = velocity(Body(manifold.getBody0()), point.getPositionWorldOnA()) -
                             velocity(Body(manifold.getBody1()), point.getPositionWorldOnB());
  const btVector3& normal = point.m_normalWorldOnB;
  return FromBullet(relative - relative.dot(normal) * normal);
}

bool KeepsPoints(const btPersistentManifold& manifold) {
  const int shape_0 = manifold.getBody0()->getCollisionShape()->getShapeType();
  const int shape_1 = manifold.getBody1()->getCollisionShape()->getShapeType();
  const auto fresh = [](int shape) {
    return shape == STATIC_PLANE_PROXYTYPE || shape == SPHERE_SHAPE_PROXYTYPE;
  };
  return !fresh(shape_0) && !fresh(shape_1);
}

}  // namespace

void DropStaleContacts(std::span<btPersistentManifold* const> manifolds, double step_s) {
  for (btPersistentManifold* manifold : manifolds) {
    if (!KeepsPoints(*manifold)) continue;
    for (int j = 0; j < manifold->getNumContacts(); ++j) {
      if (Slip(*manifold, manifold->getContactPoint(j)).norm() * step_s > kStale) {
        manifold->clearManifold();
      }
    }
  }
}

void BeginSubstep(std::vector<MovingBody>& moving, std::span<const std::size_t> stepped) {
  for (const std::size_t place : stepped) {
    MovingBody& body = moving[place];
    body.velocity = FromBullet(body.rigid->getLinearVelocity());
    body.angular_velocity = FromBullet(body.rigid->getAngularVelocity());
    body.orientation = FromBullet(body.rigid->getWorldTransform().getRotation());
    body.pushing = {};
  }
}

void EndSubstep(std::span<btPersistentManifold* const> manifolds, std::vector<MovingBody>& moving,
                std::span<const std::size_t> stepped, double step_s, bool precess) {
  for (const btPersistentManifold* manifold : manifolds) {
    for (int j = 0; j < manifold->getNumContacts(); ++j) {
      const btManifoldPoint& point = manifold->getContactPoint(j);
      if (!(point.m_appliedImpulse > 0)) continue;
      const double slip = Slip(*manifold, point).norm();
      for (const btCollisionObject* object : {manifold->getBody0(), manifold->getBody1()}) {
        const int index = object->getUserIndex();
        if (index < 0) continue;
        moving[static_cast<std::size_t>(index)].pushing.Add(FromBullet(point.m_normalWorldOnB),
                                                            slip);
      }
    }
  }
  for (const std::size_t place : stepped) {
    MovingBody& body = moving[place];
    const Vec3 change = FromBullet(body.rigid->getLinearVelocity()) - body.velocity;
    btTransform pose = body.rigid->getWorldTransform();
    pose.setOrigin(pose.getOrigin() - ToBullet(step_s / 2 * body.pushing.HalfAct(change)));
    if (precess && !body.inertia.isotropic) {
      BodyState state{.pose = {.orientation = body.orientation},
                      .angular_velocity = FromBullet(body.rigid->getAngularVelocity())};
      AdvanceRotation(body.inertia, step_s, state);
      pose.setRotation(ToBullet(state.pose.orientation));
      body.rigid->setAngularVelocity(ToBullet(state.angular_velocity));
    }
    body.rigid->setCenterOfMassTransform(pose);
  }
}

}  // namespace rikiseki::world
