// SPDX-License-Identifier: MIT
// The pairs of bodies that could meet, each with Bullet's (or our own) contact routine and the contacts
// that it found. Kept by the bodies' numbers: whatever the addresses, the order is the same. A pair of
// sleeping bodies keeps its contacts, from whose impulses the solver goes on when they wake.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

namespace rikiseki::world {

struct ContactPair {
  btRigidBody* first = nullptr;  // of the lower number
  btRigidBody* second = nullptr;
  btCollisionAlgorithm* algorithm = nullptr;       // null until they are first asked
  std::vector<btPersistentManifold*> manifolds{};  // with contacts, of the last time
  std::uint64_t planned = 0;                       // the last plan that had it
  std::uint64_t asked = 0;                         // the last substep that asked it

  /// Places in MovingBody, or -1.
  int first_moving() const { return first->getUserIndex(); }
  int second_moving() const { return second->getUserIndex(); }
  /// The bodies' numbers.
  std::pair<int, int> Order() const { return {first->getUserIndex3(), second->getUserIndex3()}; }
  /// m, the least gap of the contacts; infinite without any.
  double Gap() const;
};

class ContactPairs {
 public:
  ContactPairs(btCollisionDispatcher& dispatcher, std::size_t moving_bodies)
      : dispatcher_(dispatcher), of_(moving_bodies) {}
  ~ContactPairs();
  ContactPairs(const ContactPairs&) = delete;
  ContactPairs& operator=(const ContactPairs&) = delete;

  /// False where a joint keeps them from each other.
  static bool MayMeet(const btRigidBody& a, const btRigidBody& b);

  /// Marks the pair as part of plan number `plan`, and makes it if it is new. Null for two that may
  /// not meet. Valid until it is dropped.
  ContactPair* Plan(btRigidBody& a, btRigidBody& b, std::uint64_t plan);

  /// Forgets the pairs of a moving body that are not in `plan`.
  void DropOthers(std::size_t moving, std::uint64_t plan);

  /// Finds the contacts of the pair anew.
  void Ask(ContactPair& pair);

  /// Null if there is none.
  const ContactPair* Find(const btCollisionObject& a, const btCollisionObject& b) const;

  /// All pairs of a moving body.
  std::span<ContactPair* const> Of(std::size_t moving) const { return of_[moving]; }

 private:
  using Key = std::pair<int, int>;  // numbers of the rigid bodies
  static Key KeyOf(const btCollisionObject& a, const btCollisionObject& b);
  void Release(ContactPair& pair);

  btCollisionDispatcher& dispatcher_;
  btDispatcherInfo info_;
  std::map<Key, ContactPair> pairs_;
  std::vector<std::vector<ContactPair*>> of_;
  btManifoldArray found_;
};

}  // namespace rikiseki::world
