// SPDX-License-Identifier: MIT
// Puts a routine of ours in the place of Bullet's for a pair of shape types: one that finds all
// points of a contact at once, before they close, and anew at every substep. Bullet's own find one
// point per substep, in the overlap, and keep the others at stale places: what slides on a face
// rocks and stops at the wrong place, what is hit takes the push a substep late.
//
// A point keeps the impulse of the last substep's nearest point of the first body, from which the
// solver goes on. All points are kept, in the routine's order, in as many manifolds as it takes.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>

#include <memory>
#include <vector>

#include "world_server/physics/contact_point.h"

class btCollisionDispatcher;
struct btCollisionObjectWrapper;

namespace rikiseki::world {

/// The points with a gap of at most `reach_m`.
using FindPairContact = std::vector<ContactPoint> (*)(const btCollisionObjectWrapper& first,
                                                      const btCollisionObjectWrapper& second,
                                                      double reach_m);

class PairContact {
 public:
  /// For the two types of Bullet's shapes, in both orders. Outlives the dispatcher's use of it.
  PairContact(btCollisionDispatcher& dispatcher, int first_type, int second_type,
              FindPairContact find);
  ~PairContact();
  PairContact(PairContact&&) noexcept;

 private:
  std::unique_ptr<btCollisionAlgorithmCreateFunc> in_order_;
  std::unique_ptr<btCollisionAlgorithmCreateFunc> swapped_;
};

}  // namespace rikiseki::world
