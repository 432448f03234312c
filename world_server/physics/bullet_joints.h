// SPDX-License-Identifier: MIT
// The joints of a scene within Bullet's substep. Bullet's solver has them as rows among the contacts,
// so that contacts know what the jointed body can do; what it found for the joints is then taken
// out again, and the linkage (linkage.h) moves the bodies instead, exactly.
//
// In the order of a substep: BeginSubstep, solver and hooks, EndSubstep. The bodies of a linkage sleep
// and wake together, and are stepped in one group: islands and sleepers see the rows in the world.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "world_server/physics/bullet_bodies.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class BulletJoints {
 public:
  /// `bodies`, which are in `world`, and `world` outlive this. Pairs of bodies that do not collide
  /// (Collide(scene, a, b)) ignore each other from here on.
  BulletJoints(const Scene& scene, BulletBodies& bodies, btDiscreteDynamicsWorld& world);
  ~BulletJoints();

  /// After a kick on one of `bodies.moving`: what its joints leave of it, all over its linkage. The
  /// places in `moving` whose velocities that changed; none without a joint.
  std::span<const std::size_t> Settle(std::size_t moving);

  /// Of the bodies that are stepped, places in `moving`, and their contacts; after the drag, before the
  /// solver.
  void BeginSubstep(std::span<btPersistentManifold* const> manifolds,
                    std::span<const std::size_t> stepped, double step_s);

  /// Of the same bodies, after the hooks' EndSubstep, which leaves jointed bodies to this.
  /// `manifolds` are theirs.
  void EndSubstep(std::span<btPersistentManifold* const> manifolds, double step_s);

 private:
  struct Joined;

  void IgnorePairs(const Scene& scene);
  const Joined* JoinedOf(const btCollisionObject& object) const;  // null without a joint
  void AimFriction(std::span<btPersistentManifold* const> manifolds) const;
  void Read(const Joined& joined, std::span<BodyState> states) const;
  void WriteVelocities(const Joined& joined, std::span<const BodyState> states);
  bool Touches(const Joined& joined, std::span<btPersistentManifold* const> manifolds) const;
  void End(Joined& joined, bool touches, double step_s);

  BulletBodies& bodies_;
  btDiscreteDynamicsWorld& world_;
  std::vector<std::unique_ptr<Joined>> joined_;
  std::vector<Joined*> joined_of_;  // of bodies.moving; null without a joint
  std::vector<Joined*> stepped_;    // in this substep
};

}  // namespace rikiseki::world
