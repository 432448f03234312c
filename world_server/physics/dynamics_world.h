// SPDX-License-Identifier: MIT
// Dynamics as the world loop sees it. Behind it stand Bullet (bullet_world.h), soft bodies beside it
// (deformable_world.h), and the one-dimensional sliding block of the paper's Fig. 6 (sliding_block.h).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry.h"
#include "common/rigid_body.h"

namespace rikiseki::world {

class PushBudget;
class SoftSurface;

/// An impulse on one body, as a velocity kick.
struct Kick {
  std::size_t body = 0;
  Vec3 impulse = Vec3::Zero();          // N s, in W
  Vec3 angular_impulse = Vec3::Zero();  // N m s, about the body's centre of mass, in W
};

/// An impulse of which it is known where in the world it acts, but not yet where its body will be: what the
/// ledger owes a body, too.
struct PlacedImpulse {
  std::size_t body = 0;
  Vec3 impulse = Vec3::Zero();          // N s, in W
  Vec3 angular_impulse = Vec3::Zero();  // N m s, about the world origin, in W
  std::optional<Vec3> point = {};       // m, where it acted, if that is known, in W
  PushBudget* budget = nullptr;         // that bounds what of it the body takes
};

/// What has gone away from where it was pushed is pushed at its nearest place, within `reach_m` of its
/// centre: as long as its lever was, the impulse would be a torque that no contact with the body has.
inline PlacedImpulse WithinReach(PlacedImpulse push, const Vec3& centre, double reach_m) {
  if (!push.point) return push;
  const Vec3 lever = *push.point - centre;
  const double length = lever.norm();
  if (!(length > reach_m)) return push;
  push.angular_impulse += (reach_m / length - 1) * lever.cross(push.impulse);
  *push.point = centre + reach_m / length * lever;
  return push;
}

/// The push as a kick of a body whose centre of mass c is there [m, in W]: L_c = L - c x J.
inline Kick KickOf(const PlacedImpulse& push, const Vec3& centre) {
  return {.body = push.body,
          .impulse = push.impulse,
          .angular_impulse = push.angular_impulse - centre.cross(push.impulse)};
}

/// A part of a period, and what enters at its start.
struct Stretch {
  double length_s = 0;
  std::span<const PlacedImpulse> pushes = {};
};

/// Where a body touches, or may soon touch, another: a point of the body and a plane of the other.
struct ContactSite {
  static constexpr std::size_t kNobody = static_cast<std::size_t>(-1);  // a joint to the world

  std::size_t other = 0;
  Vec3 p_B = Vec3::Zero();             // m, in the body's frame; the centre of a rounding
  double radius = 0;                   // m, of the rounding: contact is at p_B - radius * normal
  Vec3 normal = Vec3::UnitZ();         // unit, in W, out of the other
  double gap = 0;                      // m, beyond the depth at which the solver lets bodies rest
  double friction = 0;                 // Coulomb, of the pair
  Vec3 other_velocity = Vec3::Zero();  // m/s, of the other there
  double other_inverse_mass = 0;       // 1/kg, how the other yields there along the normal
  Vec3 impulse = Vec3::Zero();         // N s, in W, on the body in the last substep
};

class DynamicsWorld {
 public:
  virtual ~DynamicsWorld() = default;

  /// As many as the scene has, fixed ones included, in the scene's order.
  virtual std::size_t body_count() const = 0;
  virtual BodyState State(std::size_t body) const = 0;

  /// Puts a moving body somewhere, at some velocity, between two steps: where a scene that takes
  /// another's place goes on with a body of it.
  virtual void SetState(std::size_t body, const BodyState& state) = 0;

  /// v += J/m and w += I^-1 L for every kick, then advances by `period_s` >= 0. Kicks of fixed bodies
  /// are ignored. The one place where impulses enter the dynamics.
  virtual void ApplyAndStep(std::span<const Kick> kicks, double period_s) = 0;

  /// The stretches one after the other, the pushes as kicks at where the bodies are by then. No stretch is
  /// stepped together with the next where a push comes between; what no push reaches may be advanced in
  /// other steps, but has come as far when this returns. By default: ApplyAndStep, stretch by stretch.
  virtual void Play(std::span<const Stretch> stretches);

  /// Every contact of a moving body whose gap is at most `reach_m`, appended to `sites`, deepest
  /// first. False, and nothing, where that cannot be told: the body then has no local copy.
  virtual bool FindContacts(std::size_t body, double reach_m,
                            std::vector<ContactSite>& sites) const = 0;

  /// The surface of a body that deforms; null of any other.
  virtual const SoftSurface* FindSoft(std::size_t /*body*/) const { return nullptr; }
};

}  // namespace rikiseki::world
