#include "world_server/physics/bullet_contacts.h"

#include <btBulletCollisionCommon.h>

#include "world_server/physics/box_box_contact.h"
#include "world_server/physics/box_plane_contact.h"
#include "world_server/physics/bullet_math.h"
#include "world_server/physics/bullet_shapes.h"
#include "world_server/physics/cylinder_contact.h"
#include "world_server/physics/hull_contact.h"

namespace rikiseki::world {
namespace {

using Object = btCollisionObjectWrapper;
using Points = std::vector<ContactPoint>;

Pose PoseOf(const Object& object) {
  return FromBullet(object.getWorldTransform());
}

Box BoxOf(const Object& object) {
  const auto& shape = *static_cast<const btBoxShape*>(object.getCollisionShape());
  return {FromBullet(shape.getHalfExtentsWithMargin())};
}

Cylinder CylinderOf(const Object& object) {
  const auto& shape = *static_cast<const btCylinderShapeZ*>(object.getCollisionShape());
  const btVector3 half = shape.getHalfExtentsWithMargin();
  return {half.x(), half.z()};
}

const Polyhedron& HullOf(const Object& object) {
  return FacesOf(*static_cast<const btConvexHullShape*>(object.getCollisionShape()));
}

// normal . x <= offset, in W.
struct Plane {
  Vec3 normal;
  double offset;

  explicit Plane(const Object& object) {
    const auto& shape = *static_cast<const btStaticPlaneShape*>(object.getCollisionShape());
    const btTransform& pose = object.getWorldTransform();
    normal = FromBullet(pose.getBasis() * shape.getPlaneNormal());
    offset = normal.dot(FromBullet(pose.getOrigin())) + shape.getPlaneConstant();
  }
};

Points BoxOnPlane(const Object& first, const Object& second, double reach_m) {
  const Plane plane(second);
  return FindBoxPlaneContact(BoxOf(first), PoseOf(first), plane.normal, plane.offset, reach_m);
}
Points BoxOnBox(const Object& first, const Object& second, double reach_m) {
  return FindBoxBoxContact(BoxOf(first), PoseOf(first), BoxOf(second), PoseOf(second), reach_m);
}
Points CylinderOnPlane(const Object& first, const Object& second, double reach_m) {
  const Plane plane(second);
  return FindCylinderPlaneContact(CylinderOf(first), PoseOf(first), plane.normal, plane.offset,
                                  reach_m);
}
Points CylinderOnBox(const Object& first, const Object& second, double reach_m) {
  return FindCylinderBoxContact(CylinderOf(first), PoseOf(first), BoxOf(second), PoseOf(second),
                                reach_m);
}
Points HullOnPlane(const Object& first, const Object& second, double reach_m) {
  const Plane plane(second);
  return FindHullPlaneContact(HullOf(first), PoseOf(first), plane.normal, plane.offset, reach_m);
}
Points HullOnBox(const Object& first, const Object& second, double reach_m) {
  return FindHullBoxContact(HullOf(first), PoseOf(first), BoxOf(second), PoseOf(second), reach_m);
}

}  // namespace

std::vector<PairContact> ReplaceContacts(btCollisionDispatcher& dispatcher) {
  std::vector<PairContact> replaced;
  const auto replace = [&](int first, int second, FindPairContact find) {
    replaced.emplace_back(dispatcher, first, second, find);
  };
  replace(BOX_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE, BoxOnPlane);
  replace(BOX_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, BoxOnBox);
  replace(CYLINDER_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE, CylinderOnPlane);
  replace(CYLINDER_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, CylinderOnBox);
  replace(CONVEX_HULL_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE, HullOnPlane);
  replace(CONVEX_HULL_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, HullOnBox);
  return replaced;
}

}  // namespace rikiseki::world
