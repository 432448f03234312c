// SPDX-License-Identifier: MIT
// The few Eigen names that every room uses. Vectors are in SI units and named by their frame (`p_WB`:
// position of B in world axes W) wherever it can be mistaken.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

namespace rikiseki {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;

/// A rigid pose: x_W = orientation * x_B + position.
struct Pose {
  Vec3 position = Vec3::Zero();
  Quat orientation = Quat::Identity();

  Vec3 operator*(const Vec3& p_B) const { return orientation * p_B + position; }
  Pose operator*(const Pose& other) const {
    return {*this * other.position, (orientation * other.orientation).normalized()};
  }
  Pose Inverse() const {
    const Quat back = orientation.conjugate();
    return {-(back * position), back};
  }
  bool operator==(const Pose&) const = default;
};

inline Vec3 ToVec3(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}
inline std::array<double, 3> ToArray(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}
inline Quat ToQuat(const std::array<double, 4>& q) {
  return {q[0], q[1], q[2], q[3]};
}
inline std::array<double, 4> ToArray(const Quat& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

}  // namespace rikiseki
