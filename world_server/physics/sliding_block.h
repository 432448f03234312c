// SPDX-License-Identifier: MIT
// One block that slides along x on a floor with Coulomb friction: the world of the paper's Fig. 6,
// in closed form per world period, where rigid-body engines would add their own error.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "world_server/physics/dynamics_world.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// How friction acts over one period. numerics.md section 5.
enum class SlideRule {
  kExact,         // EX: uniform deceleration, stops after v^2 / (2 mu g)
  kSemiImplicit,  // SE: friction first, then x += Tw v; stops v Tw / 2 short
};

/// The scene's only moving body slides; the others stay. One period is one step of the rule, or as
/// many as SubstepCount says where a longest substep is given.
/// Rotation, and impulses across x, do nothing.
class SlidingBlock final : public DynamicsWorld {
 public:
  /// `friction` is that of block and floor combined; the weight is along z of `scene.gravity`.
  /// Throws std::invalid_argument unless exactly one body moves and has a mass.
  SlidingBlock(const Scene& scene, double friction, SlideRule rule,
               double longest_substep_s = std::numeric_limits<double>::infinity());

  std::size_t body_count() const override { return states_.size(); }
  BodyState State(std::size_t body) const override;
  void SetState(std::size_t body, const BodyState& state) override;
  void ApplyAndStep(std::span<const Kick> kicks, double period_s) override;

  /// The floor, under the block's centre.
  bool FindContacts(std::size_t body, double reach_m,
                    std::vector<ContactSite>& sites) const override;

 private:
  void Substep(double step_s);

  std::vector<BodyState> states_;  // at the start
  std::size_t block_ = 0;
  std::size_t floor_ = 0;  // a fixed body, if there is one
  double friction_;
  double mass_kg_ = 0;
  double deceleration_ = 0;  // mu g, m/s^2
  SlideRule rule_;
  double longest_substep_s_;
  double displacement_ = 0;  // m along x since the start
  double velocity_ = 0;      // m/s along x
};

}  // namespace rikiseki::world
