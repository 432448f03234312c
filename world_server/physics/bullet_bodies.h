// SPDX-License-Identifier: MIT
// The scene's bodies as Bullet's: shapes, rigid bodies, and what our own parts of the engine know of each
// that can move. Built once for a scene; Bullet's user indices say which rigid body is whose:
//   getUserIndex()  its place among the moving ones, or -1
//   getUserIndex2() its body in the scene
//   getUserIndex3() its number among the rigid bodies
#pragma once

#include <btBulletDynamicsCommon.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "common/rigid_body.h"
#include "world_server/physics/air.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// A body that can move. Its frame is Bullet's: the principal axes of inertia.
struct MovingBody {
  btRigidBody* rigid = nullptr;
  BodyInertia inertia;
  Quat q_BP = Quat::Identity();  // principal axes in the scene body's frame
  AirDrag air;
  double inner_radius = 0;  // m, of the largest ball in it
  double outer_radius = 0;  // m, of the ball about its centre of mass that holds it
  double gravity = 0;       // m/s^2, that acts on it
  bool jointed = false;     // bullet_joints.h moves it

  // At the start of the substep, the kick included.
  Vec3 velocity = Vec3::Zero();
  Vec3 angular_velocity = Vec3::Zero();
  Quat orientation = Quat::Identity();
  PushingContacts pushing;  // of this substep
  double grip = 0;          // N s, what friction could give in it at most

  Vec3 last_velocity = Vec3::Zero();  // m/s, at the end of the last substep, before any kick
  double last_step_s = 0;             // length of the last substep that it was in

  /// No point of it is faster [m/s].
  double Speed() const;
  /// In the scene body's frame.
  BodyState State() const;
  void SetState(const BodyState& state);
};

class BulletBodies {
 public:
  static constexpr std::size_t kFixed = static_cast<std::size_t>(-1);

  /// Throws std::invalid_argument on what cannot be simulated.
  explicit BulletBodies(const Scene& scene);

  std::vector<MovingBody> moving;
  std::vector<std::size_t>
      moving_of;  // of each body of the scene: its place in `moving`, or kFixed
  std::vector<std::unique_ptr<btRigidBody>> rigid_bodies;
  std::vector<double> restitutions;  // of rigid_bodies
  double smallest = 0;               // m, least diameter of a shape of what can move

 private:
  void AddFixed(const SceneBody& body);
  void AddMoving(const SceneBody& body, const Vec3& gravity, bool jointed);
  btRigidBody* Add(double mass, const Vec3& moments, btCollisionShape* shape,
                   const Collider& surface, const Pose& pose);

  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
};

/// Exactly J/m and R I^-1 R^T L, between substeps. Never as a force: Bullet's friction rows do not
/// see the torque of forces.
void ApplyKick(const MovingBody& body, const Vec3& impulse, const Vec3& angular_impulse);

}  // namespace rikiseki::world
