// SPDX-License-Identifier: MIT
// One substep of one group: Bullet's own stations, called one by one for the group's bodies alone, with
// our hooks between them. Bullet's step of a whole world costs 0.5 us for every body that sleeps in it;
// this costs nothing for who is not in the group.
#pragma once

#include <memory>
#include <vector>

#include "world_server/physics/bullet_bodies.h"
#include "world_server/physics/bullet_joints.h"
#include "world_server/physics/contact_pairs.h"
#include "world_server/physics/engine_parts.h"
#include "world_server/physics/islands.h"
#include "world_server/physics/sleep.h"

namespace rikiseki::world {

/// The contact solver that suits the parts.
std::unique_ptr<btSequentialImpulseConstraintSolver> MakeSolver(const EngineParts& parts);

/// Bullet's world as the keeper of bodies and joints, stepped by groups and never as a whole. (Derived,
/// since Bullet shows the stations of its step to its children only.)
class GroupedWorld final : public btDiscreteDynamicsWorld {
 public:
  /// All outlive this. `resting_depth` [m]: so deep bodies rest in each other.
  GroupedWorld(const Scene& scene, btCollisionDispatcher& dispatcher, btDbvtBroadphase& broadphase,
               btSequentialImpulseConstraintSolver& solver, btCollisionConfiguration& configuration,
               BulletBodies& bodies, ContactPairs& pairs, Sleepers& sleepers,
               const EngineParts& parts, double resting_depth);
  ~GroupedWorld() override;

  /// Advances the group's awake bodies; the solver goes `sweeps` times over its contacts. Who sleeps and is about to be touched wakes first.
  void Step(const Group& group, double step_s, int sweeps);

  BulletJoints& joints() { return *jointed_; }

 private:
  void FindStepped(const Group& group);
  void SweepFastBodies(const Group& group, double step_s);
  void FindContacts(const Group& group, double step_s);
  bool WillTouch(const ContactPair& pair, double step_s) const;
  void ScaleImpulses(double step_s);
  void BlowAir(double step_s);
  void Solve(const Group& group, double step_s);

  BulletBodies& bodies_;
  ContactPairs& pairs_;
  Sleepers& sleepers_;
  EngineParts parts_;
  double gravity_ = 0;  // m/s^2, the strongest
  std::uint64_t substep_ = 0;
  std::vector<std::size_t> stepped_;              // places in moving
  std::vector<btRigidBody*> rigids_;              // the same
  std::vector<btPersistentManifold*> manifolds_;  // of the stepped
  std::vector<btTypedConstraint*> joints_;        // likewise
  std::unique_ptr<BulletJoints> jointed_;
};

}  // namespace rikiseki::world
