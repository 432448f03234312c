// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_hooks.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

const btRigidBody* Body(const btCollisionObject* object) {
  return btRigidBody::upcast(object);
}

// The way that a body slid before it came to stick within the substep: as friction can brake it, at most
// as long as the substep. Not where a kick came, which friction may have undone.
Vec3 LastWay(const MovingBody& body, double step_s) {
  if (!body.pushing.Sticks() || body.velocity != body.last_velocity || !(body.grip > 0)) {
    return Vec3::Zero();
  }
  const Vec3 lost = body.pushing.Along(body.velocity - FromBullet(body.rigid->getLinearVelocity()));
  const double braking_s = step_s * std::min(1.0, lost.norm() * body.inertia.mass_kg / body.grip);
  return braking_s / 2 * lost;
}

}  // namespace

Vec3 Slip(const btPersistentManifold& manifold, const btManifoldPoint& point) {
  const auto velocity = [](const btRigidBody* body, const btVector3& where) {
    return body->getVelocityInLocalPoint(where - body->getWorldTransform().getOrigin());
  };
  const btVector3 relative = velocity(Body(manifold.getBody0()), point.getPositionWorldOnA()) -
                             velocity(Body(manifold.getBody1()), point.getPositionWorldOnB());
  const btVector3& normal = point.m_normalWorldOnB;
  return FromBullet(relative - relative.dot(normal) * normal);
}

void BeginSubstep(std::vector<MovingBody>& moving, std::span<const std::size_t> stepped) {
  for (const std::size_t place : stepped) {
    MovingBody& body = moving[place];
    body.velocity = FromBullet(body.rigid->getLinearVelocity());
    body.angular_velocity = FromBullet(body.rigid->getAngularVelocity());
    body.orientation = FromBullet(body.rigid->getWorldTransform().getRotation());
    body.pushing = {};
    body.grip = 0;
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
        MovingBody& body = moving[static_cast<std::size_t>(index)];
        body.pushing.Add(FromBullet(point.m_normalWorldOnB), slip);
        body.grip += point.m_combinedFriction * point.m_appliedImpulse;
      }
    }
  }
  for (const std::size_t place : stepped) {
    MovingBody& body = moving[place];
    if (body.jointed) continue;
    const Vec3 change = FromBullet(body.rigid->getLinearVelocity()) - body.velocity;
    btTransform pose = body.rigid->getWorldTransform();
    pose.setOrigin(pose.getOrigin() - ToBullet(step_s / 2 * body.pushing.HalfAct(change)) +
                   ToBullet(LastWay(body, step_s)));
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
