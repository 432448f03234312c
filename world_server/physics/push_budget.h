// SPDX-License-Identifier: MIT
// A body takes from the finger no more energy than the finger gave. What the finger meets of a body without
// a local copy is where it was a period or two ago: it pushes as if the body stood, and a light one
// would fly off with many times the work that was done on it, which is what makes a slow world unstable
// (numerics 3). With the energy bounded it is not, whatever the mass and the period: a body that is pushed
// from rest goes off no faster than after an elastic blow, twice as fast as the finger, while one that
// something holds takes all of the push, since that costs nothing.
#pragma once

#include "common/rigid_body.h"
#include "world_server/physics/dynamics_world.h"

namespace rikiseki::world {

class PushBudget {
 public:
  /// Of the pushes that come now.
  struct Means {
    double work_j = 0;       // that the fingers did on the body meanwhile
    double spring_j = 0;     // bounds what is kept from before: no more was in their springs then
    double debt_kept = 1;    // 0..1, of what the body lacks from before
    double overdraft_j = 0;  // that the body may lack; not 0: a kick is charged afterwards
  };

  /// Adds to what is kept from before. What lacks must be let go of in time: a body that could never be
  /// pushed again would sink through the finger. `state` is the body's present one.
  void Grant(const Means& means, const BodyState& state);

  /// Scales the kick of a body in `state` to what it may take, 0..1 of it: what a free body gains by it is
  /// within the budget; or, where the finger took back more than the body has, leaves the body least. What
  /// a kick before cost more than the body has gained, held as it was, is good again.
  void Limit(const BodyInertia& inertia, const BodyState& state, Kick& kick);

  /// Of all kicks since Grant, what was not taken [N s].
  const Vec3& refused() const { return refused_; }

 private:
  void Settle(const BodyState& state);

  double overdraft_j_ = 0;
  double left_j_ = 0;  // < 0: lacking
  Vec3 refused_ = Vec3::Zero();
  // The newest kick, for which a free body was charged.
  Kick newest_;
  BodyState before_;
  double charged_j_ = 0;  // of it, for what the kick itself added to the speed
};

}  // namespace rikiseki::world
