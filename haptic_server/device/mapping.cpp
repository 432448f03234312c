// SPDX-License-Identifier: MIT
#include "haptic_server/device/mapping.h"

#include <numbers>

namespace rikiseki::haptic {
namespace {

Mat3 RotationOf(const Vec3& roll_pitch_yaw_deg) {
  const Vec3 angle = roll_pitch_yaw_deg * (std::numbers::pi / 180);
  return (Eigen::AngleAxisd(angle.z(), Vec3::UnitZ()) *
          Eigen::AngleAxisd(angle.y(), Vec3::UnitY()) * Eigen::AngleAxisd(angle.x(), Vec3::UnitX()))
      .toRotationMatrix();
}

}  // namespace

Mapping::Mapping(const MappingSettings& settings)
    : motion_scale_(settings.motion_scale),
      force_scale_(settings.force_scale),
      rotated_(!settings.rotation_deg.isZero(0)),
      rotation_(RotationOf(settings.rotation_deg)),
      origin_(settings.origin_mm * 1e-3),
      moved_(!settings.origin_mm.isZero(0)) {}

Vec3 Mapping::Follow(const Vec3& position, bool clutched) noexcept {
  if (clutched && followed_) {
    origin_ = finger_ - VelocityInWorld(position);
    moved_ = true;
  } else {
    finger_ = PointInWorld(position);
  }
  followed_ = true;
  return finger_;
}

Vec3 Mapping::PointInWorld(const Vec3& point) const noexcept {
  const Vec3 turned = VelocityInWorld(point);
  return moved_ ? Vec3(turned + origin_) : turned;
}

Vec3 Mapping::VelocityInWorld(const Vec3& velocity) const noexcept {
  return motion_scale_ * DirectionInWorld(velocity);
}

Vec3 Mapping::DirectionInWorld(const Vec3& direction) const noexcept {
  return rotated_ ? Vec3(rotation_ * direction) : direction;
}

Quat Mapping::OrientationInWorld(const Quat& orientation) const noexcept {
  const Vec3 turned = DirectionInWorld(orientation.vec());
  return {orientation.w(), turned.x(), turned.y(), turned.z()};
}

Vec3 Mapping::TorqueInWorld(const Vec3& torque) const noexcept {
  return motion_scale_ * ForceInWorld(torque);
}

Vec3 Mapping::PointOnDevice(const Vec3& point) const noexcept {
  return VelocityOnDevice(moved_ ? Vec3(point - origin_) : point);
}

Vec3 Mapping::VelocityOnDevice(const Vec3& velocity) const noexcept {
  return (rotated_ ? Vec3(rotation_.transpose() * velocity) : velocity) / motion_scale_;
}

Vec3 Mapping::ForceInWorld(const Vec3& force) const noexcept {
  return DirectionInWorld(force) / force_scale_;
}

Vec3 Mapping::ForceOnDevice(const Vec3& force) const noexcept {
  return force_scale_ * (rotated_ ? Vec3(rotation_.transpose() * force) : force);
}

}  // namespace rikiseki::haptic
