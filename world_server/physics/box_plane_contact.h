// Contacts between a box and a half-space: the corners of the box's lowest face, all at once and
// exact at every substep. Bullet's own routine finds one corner per substep and keeps old ones at
// stale places, which costs a sliding box its stop distance and lets a fresh one rock.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>

#include <memory>

class btCollisionDispatcher;

namespace rikiseki::world {

/// Replaces Bullet's routine for this pair, in both orders. Outlives the dispatcher's use of it.
class BoxPlaneContact {
 public:
  explicit BoxPlaneContact(btCollisionDispatcher& dispatcher);
  ~BoxPlaneContact();

 private:
  std::unique_ptr<btCollisionAlgorithmCreateFunc> box_first_;
  std::unique_ptr<btCollisionAlgorithmCreateFunc> plane_first_;
};

}  // namespace rikiseki::world
