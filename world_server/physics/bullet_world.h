// SPDX-License-Identifier: MIT
// Rigid bodies on Bullet in double precision, tuned as measured for this project: no margins, split
// impulse, 50 iterations, one friction direction, our own steps round Bullet's stations
// (group_substep.h), and hooks that make them accurate (bullet_hooks.h).
//
// What that gives at 1 ms substeps: a sliding box stops within a millionth of v^2/(2 mu g), free
// fall and the flight after a kick are exact, stacks of ten 5 cm boxes and mass ratios up to 1:300
// hold. Combined friction is sqrt(mu1 mu2). Repeatable to the bit for the same scene and calls.
//
// What it costs grows with what is awake, not with what is there. Time passes in windows of at most
// 10 ms, shorter where something is fast, in which bodies that could meet are stepped together
// (islands.h) and those that rest sleep (sleep.h). In Play a group that a push reaches takes the scene's
// substep, the others longer ones (substep_choice.h); ApplyAndStep takes the scene's substep everywhere.
#pragma once

#include <memory>
#include <vector>

#include "world_server/physics/contact_sites.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/physics/engine_parts.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class BulletWorld final : public DynamicsWorld {
 public:
  /// `substep_s` is the longest substep of what a push reaches. Throws std::invalid_argument on what
  /// the engine cannot take: a moving body without a mass, a positive definite inertia or a shape,
  /// with a half-space, or with shapes of different friction.
  BulletWorld(const Scene& scene, double substep_s);
  /// With other parts than the scene needs, for measurements.
  BulletWorld(const Scene& scene, double substep_s, const EngineParts& parts);
  ~BulletWorld() override;

  std::size_t body_count() const override;
  BodyState State(std::size_t body) const override;
  void SetState(std::size_t body, const BodyState& state) override;
  void ApplyAndStep(std::span<const Kick> kicks, double period_s) override;
  void Play(std::span<const Stretch> stretches) override;
  bool FindContacts(std::size_t body, double reach_m,
                    std::vector<ContactSite>& sites) const override;

  /// False for a scene in which nothing moves: no engine was built, and steps cost nothing.
  bool simulates() const;
  /// How many bodies were awake when time last passed.
  std::size_t awake() const;
  /// Substeps taken since the start, each of one group.
  std::uint64_t substeps() const;

 private:
  struct Engine;
  void ReadStates();

  Scene scene_;
  SiteFinder site_finder_{scene_};
  std::vector<BodyState> states_;  // of all bodies, now
  double substep_s_;
  std::unique_ptr<Engine> engine_;  // null where nothing moves
};

}  // namespace rikiseki::world
