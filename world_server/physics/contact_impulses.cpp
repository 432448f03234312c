// SPDX-License-Identifier: MIT
#include "world_server/physics/contact_impulses.h"

#include <limits>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr double kSameDirection = 0.9;  // least cosine

ContactSite* NearestSite(std::span<ContactSite> sites, std::size_t other, const Vec3& normal,
                         const Vec3& where, const Pose& pose_WB) {
  ContactSite* nearest = nullptr;
  double nearest_distance = std::numeric_limits<double>::infinity();
  for (ContactSite& site : sites) {
    if (site.other != other || site.normal.dot(normal) < kSameDirection) continue;
    const Vec3 place = pose_WB * site.p_B - site.radius * site.normal;
    const double distance = (place - where).norm();
    if (distance >= nearest_distance) continue;
    nearest = &site;
    nearest_distance = distance;
  }
  return nearest;
}

}  // namespace

void AddImpulses(const MovingBody& body, const Pose& pose_WB, std::span<ContactPair* const> pairs,
                 double scale, std::span<ContactSite> sites) {
  for (const ContactPair* pair : pairs) {
    for (const btPersistentManifold* manifold : pair->manifolds) {
      const bool is_first = manifold->getBody0() == body.rigid;
      const btCollisionObject* other = is_first ? manifold->getBody1() : manifold->getBody0();
      for (int i = 0; i < manifold->getNumContacts(); ++i) {
        const btManifoldPoint& point = manifold->getContactPoint(i);
        if (!(point.m_appliedImpulse > 0)) continue;
        const double side = is_first ? scale : -scale;
        const Vec3 normal = (is_first ? 1 : -1) * FromBullet(point.m_normalWorldOnB);
        const Vec3 where =
            FromBullet(is_first ? point.getPositionWorldOnA() : point.getPositionWorldOnB());
        ContactSite* nearest = NearestSite(sites, static_cast<std::size_t>(other->getUserIndex2()),
                                           normal, where, pose_WB);
        if (nearest == nullptr) continue;
        nearest->impulse +=
            side * (point.m_appliedImpulse * FromBullet(point.m_normalWorldOnB) +
                    point.m_appliedImpulseLateral1 * FromBullet(point.m_lateralFrictionDir1) +
                    point.m_appliedImpulseLateral2 * FromBullet(point.m_lateralFrictionDir2));
      }
    }
  }
}

}  // namespace rikiseki::world
