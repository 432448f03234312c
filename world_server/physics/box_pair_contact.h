// Contacts between two boxes, as the haptic side's copies know them (box_box_contact.h): before they
// close, all at once, and anew at every substep. Bullet's own routine knows of a contact only when
// the boxes overlap already: a cube that was hit took its push a substep late, from 0.3 mm inside,
// and left 3 % too fast.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>

#include <memory>

class btCollisionDispatcher;

namespace rikiseki::world {

/// Replaces Bullet's routine for this pair. Outlives the dispatcher's use of it.
class BoxPairContact {
 public:
  explicit BoxPairContact(btCollisionDispatcher& dispatcher);
  ~BoxPairContact();

 private:
  std::unique_ptr<btCollisionAlgorithmCreateFunc> create_;
};

}  // namespace rikiseki::world
