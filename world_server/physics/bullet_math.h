// SPDX-License-Identifier: MIT
// Between Eigen and Bullet.
#pragma once

#include <LinearMath/btTransform.h>

#include "common/geometry.h"

namespace rikiseki::world {

inline btVector3 ToBullet(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}
inline btQuaternion ToBullet(const Quat& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}
inline btTransform ToBullet(const Pose& pose) {
  return btTransform(ToBullet(pose.orientation), ToBullet(pose.position));
}
inline Vec3 FromBullet(const btVector3& v) {
  return {v.x(), v.y(), v.z()};
}
inline Quat FromBullet(const btQuaternion& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}
inline Pose FromBullet(const btTransform& pose) {
  return {FromBullet(pose.getOrigin()), FromBullet(pose.getRotation()).normalized()};
}

}  // namespace rikiseki::world
