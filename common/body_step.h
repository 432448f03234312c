// SPDX-License-Identifier: MIT
// One step of a few rigid bodies with contact planes and Coulomb friction: what a local copy of the
// haptic side does every tick. The world's engine has its own contact solver; what both must have in
// common - the kick at the start of the substep, the position rule, how penetration recovers - stands
// here and in rigid_body.h, and a test holds the one against the other. numerics.md section 4.
#pragma once

#include <cstddef>
#include <span>

#include "common/geometry.h"
#include "common/rigid_body.h"

namespace rikiseki {

inline constexpr std::size_t kMaxStepBodies = 4;
inline constexpr std::size_t kMaxStepContacts = 64;
inline constexpr std::size_t kMaxStepSprings = 8;

/// Of a penetration, what the velocity of one substep takes back.
inline constexpr double kPenetrationRecovery = 0.2;
/// Deeper [m], and the position is mended without giving velocity.
inline constexpr double kDeepPenetration = 1e-4;

struct StepBody {
  BodyState state;
  BodyInertia inertia;
  Vec3 acceleration = Vec3::Zero();          // m/s^2, by what does not answer the push: gravity
  Vec3 angular_acceleration = Vec3::Zero();  // rad/s^2, likewise
};

/// A point of a body that a plane keeps out. The plane belongs to another of the bodies, or to the
/// surroundings, which do not yield: a heavy neighbour mostly rests on something itself.
struct StepContact {
  static constexpr std::size_t kSurroundings = static_cast<std::size_t>(-1);

  std::size_t body = 0;
  std::size_t other = kSurroundings;
  Vec3 p_B = Vec3::Zero();       // m, in the body's frame; the centre of a rounding
  double radius = 0;             // m, of the rounding: the contact is at p_B - radius * normal
  Vec3 point = Vec3::Zero();     // m, on the plane: in W, or in the other's frame
  Vec3 normal = Vec3::UnitZ();   // unit, out of the other: in W, or in the other's frame
  double friction = 0;           // Coulomb, of the pair
  Vec3 velocity = Vec3::Zero();  // m/s, of surroundings that move
  double normal_impulse = 0;     // N s, of the step before: where the solver starts
};

/// The finger on a body as a spring and damper that is solved together with the contacts (backward
/// Euler against the held finger): impulse = base + per_speed * (speed of the body's point along
/// `normal`), >= 0, and acts along -normal.
struct StepSpring {
  std::size_t body = 0;
  Vec3 point_W = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  // unit, out of the body
  double base_ns = 0;           // N s
  double per_speed_kg = 0;      // N s per m/s
  double impulse_ns = 0;        // the result
};

/// Velocities after `step_s` with gravity, contacts and springs; positions stay. Projected
/// Gauss-Seidel to 1e-10 m/s, at most 50 sweeps: normals, then friction in its exact cone. The
/// spans are at most as long as the constants above. // RT:
void SolveVelocities(std::span<StepBody> bodies, std::span<StepContact> contacts,
                     std::span<StepSpring> springs, double step_s) noexcept;

/// One whole step: SolveVelocities without springs, then positions by the rule. What pushes from
/// outside is applied before, by ApplyImpulse. // RT:
void StepBodies(std::span<StepBody> bodies, std::span<StepContact> contacts, double step_s,
                PositionRule rule) noexcept;

/// Into how many equal substeps a time is divided, none longer than `longest_s` - or than a quarter
/// more, so that the tick of a jittery clock remains one step on both sides.
int SubstepCount(double time_s, double longest_s) noexcept;

/// 1/M_eff [1/kg] of a body at a point along a unit direction:
/// 1/M + ((r x n)^T I^-1 (r x n)). numerics.md.
double InverseEffectiveMass(const BodyInertia& inertia, const Pose& pose_WB, const Vec3& point_W,
                            const Vec3& direction) noexcept;

}  // namespace rikiseki
