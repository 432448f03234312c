// SPDX-License-Identifier: MIT
// Joins device and world: C = s_x R C_device + origin, f_device = s_f R^T f_world. Positions,
// forces and impulses that leave the process are the world's; what protects device and hand (cap,
// slew, speed) acts in device units. The device feels the stiffness s_f s_x k_p. numerics 1.
#pragma once

#include "common/geometry.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// A part that is not used - no rotation, a scale of 1, an origin of 0 - leaves every bit alone.
class Mapping {
 public:
  explicit Mapping(const MappingSettings& settings);

  /// The finger [m, W] for a measured position [m, device axes]. While `clutched` it stays where it
  /// was and the origin moves with the hand instead, so that nothing jumps when the clutch is
  /// released. One call per sound sample. // RT:
  Vec3 Follow(const Vec3& position, bool clutched) noexcept;

  /// With the present origin. // RT:
  Vec3 PointInWorld(const Vec3& point) const noexcept;
  Vec3 VelocityInWorld(const Vec3& velocity) const noexcept;
  /// The way back. Not while the clutch has moved the origin.
  Vec3 PointOnDevice(const Vec3& point) const noexcept;
  Vec3 VelocityOnDevice(const Vec3& velocity) const noexcept;
  Vec3 ForceInWorld(const Vec3& force) const noexcept;
  Vec3 ForceOnDevice(const Vec3& force) const noexcept;

  Vec3 DirectionInWorld(const Vec3& direction) const noexcept;
  /// Upright stays upright: it is the turn of the grip since the middle that is laid into the world.
  Quat OrientationInWorld(const Quat& orientation) const noexcept;
  /// About a point that is laid into the world too. Does the work there that force and way do.
  Vec3 TorqueInWorld(const Vec3& torque) const noexcept;

  /// World newtons per device newton: for limits. 1/s_f.
  double force_in_world() const noexcept { return 1 / force_scale_; }

  /// Joule at the device per joule in the world: s_f/s_x.
  double energy_on_device() const noexcept { return force_scale_ / motion_scale_; }

 private:
  double motion_scale_;
  double force_scale_;
  bool rotated_;
  Mat3 rotation_;  // R
  Vec3 origin_;    // m, W, of the device's origin
  bool moved_;     // the origin is not 0
  bool followed_ = false;
  Vec3 finger_ = Vec3::Zero();  // as of the last Follow
};

}  // namespace rikiseki::haptic
