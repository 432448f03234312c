// Rigid bodies on Bullet in double precision, tuned as measured for this project: no margins, split
// impulse, 50 iterations, one friction direction, our own fixed substeps, and three hooks round
// Bullet's substep (bullet_hooks.h) that make it accurate.
//
// What that gives at 1 ms substeps: a sliding box stops within a millionth of v^2/(2 mu g), free
// fall and the flight after a kick are exact, stacks of ten 5 cm boxes and mass ratios up to 1:300
// hold. Combined friction is sqrt(mu1 mu2). Repeatable to the bit for the same scene and calls.
#pragma once

#include <memory>
#include <vector>

#include "world_server/physics/contact_sites.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

class BulletWorld final : public DynamicsWorld {
 public:
  /// A period is divided into equal substeps, see SubstepCount. Throws
  /// std::invalid_argument on what the engine cannot take: a moving body without a mass, a positive
  /// definite inertia or a shape, with a half-space, or with shapes of different friction.
  BulletWorld(const Scene& scene, double longest_substep_s);
  ~BulletWorld() override;

  std::size_t body_count() const override;
  BodyState State(std::size_t body) const override;
  void SetState(std::size_t body, const BodyState& state) override;
  void ApplyAndStep(std::span<const Kick> kicks, double period_s) override;
  bool FindContacts(std::size_t body, double reach_m,
                    std::vector<ContactSite>& sites) const override;

  /// False for a scene in which nothing moves: no engine was built, and steps cost nothing.
  bool simulates() const;

 private:
  struct Engine;
  Scene scene_;
  SiteFinder site_finder_{scene_};
  std::vector<BodyState> states_;  // of all bodies, now
  double longest_substep_s_;
  std::unique_ptr<Engine> engine_;  // null where nothing moves
};

}  // namespace rikiseki::world
