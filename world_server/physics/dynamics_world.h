// Rigid-body dynamics as the world loop sees it. Behind it stand Bullet (bullet_world.h) and the
// one-dimensional sliding block of the paper's Fig. 6 (sliding_block.h).
#pragma once

#include <cstddef>
#include <span>

#include "common/geometry.h"

namespace rikiseki::world {

/// An impulse on one body, as a velocity kick.
struct Kick {
  std::size_t body = 0;
  Vec3 impulse = Vec3::Zero();          // N s, in W
  Vec3 angular_impulse = Vec3::Zero();  // N m s, about the body's centre of mass, in W
};

struct BodyState {
  Pose pose = {};                        // of the centre-of-mass frame, in W
  Vec3 velocity = Vec3::Zero();          // m/s, of the centre of mass
  Vec3 angular_velocity = Vec3::Zero();  // rad/s
};

class DynamicsWorld {
 public:
  virtual ~DynamicsWorld() = default;

  /// As many as the scene has, fixed ones included, in the scene's order.
  virtual std::size_t body_count() const = 0;
  virtual BodyState State(std::size_t body) const = 0;

  /// v += J/m and w += I^-1 L for every kick, then advances by `period_s` >= 0. Kicks of fixed bodies
  /// are ignored. The one place where impulses enter the dynamics.
  virtual void ApplyAndStep(std::span<const Kick> kicks, double period_s) = 0;
};

}  // namespace rikiseki::world
