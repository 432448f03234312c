// SPDX-License-Identifier: MIT
// A rigid body's state and inertia, and how both of our integrators - the local copies of the haptic
// side and the hooks round the world's engine - move it through one substep.
#pragma once

#include <cstddef>

#include "common/geometry.h"

namespace rikiseki {

struct BodyState {
  Pose pose = {};                        // of the centre-of-mass frame B, in W
  Vec3 velocity = Vec3::Zero();          // m/s, of the centre of mass
  Vec3 angular_velocity = Vec3::Zero();  // rad/s, in W

  /// Of the body's material at a place in W.
  Vec3 VelocityAt(const Vec3& point_W) const {
    return velocity + angular_velocity.cross(point_W - pose.position);
  }
};

/// Mass properties, with what a step needs of them worked out once.
struct BodyInertia {
  double mass_kg = 1;
  Mat3 inertia_B = Mat3::Identity();  // kg m^2, about the centre of mass
  Mat3 inverse_B = Mat3::Identity();
  bool isotropic = true;  // angular momentum is along the angular velocity: nothing precesses

  /// `inertia_B` must be symmetric and positive definite, `mass_kg` > 0.
  static BodyInertia Of(double mass_kg, const Mat3& inertia_B);

  /// The inverse inertia in world axes.
  Mat3 InverseInertia(const Quat& q_WB) const;
};

/// v += J/m, w += I^-1 L, with L [N m s] about the centre of mass.
void ApplyImpulse(const BodyInertia& inertia, const Vec3& impulse_ns,
                  const Vec3& angular_impulse_nms, BodyState& state) noexcept;

/// How a substep turns velocities into positions.
enum class PositionRule {
  kSecondOrder,   // x += h v - h/2 dv: exact under uniform acceleration and friction
  kSemiImplicit,  // x += h v: of the written experiments (numerics, Fig. 6 files)
};

/// The contacts that push on one body in a substep, as far as the position rule must know them.
class PushingContacts {
 public:
  /// A contact with a positive normal impulse: its unit normal and the slip speed [m/s] after the
  /// step.
  void Add(const Vec3& normal, double slip_speed) noexcept;

  /// The part of a velocity change `dv` that acted for half of the substep only. The push of the
  /// finger, a kick at the start, must not be in it. Nothing along a pushing contact's normal, since
  /// there the new velocity is what keeps the bodies apart; and nothing at all while every contact
  /// sticks, since there friction undoes the kick, and half of it would be left as creep
  /// (0.5 mm in 5 s for 1 N on a sticking 1 kg block).
  Vec3 HalfAct(const Vec3& dv) const noexcept;

  /// Whether there are contacts and all stick.
  bool Sticks() const noexcept { return rank_ > 0 && !slips_; }
  /// What of a velocity is along all of the contacts.
  Vec3 Along(const Vec3& v) const noexcept;

 private:
  std::size_t rank_ = 0;
  Vec3 basis_[3];  // orthonormal, spans the normals
  bool slips_ = false;
};

/// Turns by `rotation` [rad, axis times angle, in W]: exp(rotation) q.
Quat Turned(const Quat& q, const Vec3& rotation) noexcept;

/// Turns the body for `step_s`. The angular momentum stays as it is: midpoint rule, and the angular
/// velocity follows the new attitude. For isotropic inertia that is the exact turn.
void AdvanceRotation(const BodyInertia& inertia, double step_s, BodyState& state) noexcept;

}  // namespace rikiseki
