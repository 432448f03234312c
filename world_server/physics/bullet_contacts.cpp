// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_contacts.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <array>

#include "world_server/physics/bullet_math.h"
#include "world_server/physics/bullet_shapes.h"
#include "world_server/physics/shape_contact.h"

namespace rikiseki::world {
namespace {

// Of a mesh there may be many triangles within reach: no more of them are looked at than the body can
// come to in a long substep.
constexpr double kLongSubstep = 1e-2;  // s
constexpr double kAtRest = 1e-3;       // m

double ReachOf(const btCollisionObject& object) {
  const btRigidBody* body = btRigidBody::upcast(&object);
  if (body == nullptr) return kAtRest;
  btVector3 centre;
  btScalar radius = 0;
  body->getCollisionShape()->getBoundingSphere(centre, radius);
  return kAtRest + kLongSubstep * (body->getLinearVelocity().length() +
                                   radius * body->getAngularVelocity().length());
}

std::vector<ContactPoint> Find(const btCollisionObjectWrapper& first,
                               const btCollisionObjectWrapper& second, double reach_m) {
  const Solid& solid = SolidOf(*first.getCollisionShape());
  const Solid& other = SolidOf(*second.getCollisionShape());
  if (std::holds_alternative<Mesh>(other.shape)) {
    reach_m = std::min(reach_m, ReachOf(*first.getCollisionObject()));
  }
  return FindShapeContact(solid, FromBullet(first.getWorldTransform()), other,
                          FromBullet(second.getWorldTransform()), reach_m);
}

}  // namespace

std::vector<PairContact> ReplaceContacts(btCollisionDispatcher& dispatcher) {
  constexpr std::array kConvex = {SPHERE_SHAPE_PROXYTYPE,   BOX_SHAPE_PROXYTYPE,
                                  CAPSULE_SHAPE_PROXYTYPE,  CYLINDER_SHAPE_PROXYTYPE,
                                  CUSTOM_CONVEX_SHAPE_TYPE, CONVEX_HULL_SHAPE_PROXYTYPE};
  std::vector<PairContact> replaced;
  for (std::size_t i = 0; i < kConvex.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      replaced.emplace_back(dispatcher, kConvex[i], kConvex[j], Find);
    }
    replaced.emplace_back(dispatcher, kConvex[i], STATIC_PLANE_PROXYTYPE, Find);
    replaced.emplace_back(dispatcher, kConvex[i], TRIANGLE_MESH_SHAPE_PROXYTYPE, Find);
  }
  return replaced;
}

}  // namespace rikiseki::world
