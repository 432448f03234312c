// SPDX-License-Identifier: MIT
#include "world_server/physics/contact_pairs.h"

#include <algorithm>
#include <limits>

namespace rikiseki::world {

double ContactPair::Gap() const {
  double least = std::numeric_limits<double>::infinity();
  for (const btPersistentManifold* manifold : manifolds) {
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
      least = std::min(least, manifold->getContactPoint(i).getDistance());
    }
  }
  return least;
}

ContactPairs::~ContactPairs() {
  for (auto& [key, pair] : pairs_) Release(pair);
}

ContactPairs::Key ContactPairs::KeyOf(const btCollisionObject& a, const btCollisionObject& b) {
  return std::minmax({a.getUserIndex3(), b.getUserIndex3()});
}

bool ContactPairs::MayMeet(const btRigidBody& a, const btRigidBody& b) {
  const btBroadphaseProxy& proxy_a = *a.getBroadphaseHandle();
  const btBroadphaseProxy& proxy_b = *b.getBroadphaseHandle();
  return (proxy_a.m_collisionFilterGroup & proxy_b.m_collisionFilterMask) != 0 &&
         (proxy_b.m_collisionFilterGroup & proxy_a.m_collisionFilterMask) != 0 &&
         a.checkCollideWith(&b) && b.checkCollideWith(&a);
}

ContactPair* ContactPairs::Plan(btRigidBody& a, btRigidBody& b, std::uint64_t plan) {
  if (!MayMeet(a, b)) return nullptr;
  const auto [place, is_new] = pairs_.try_emplace(KeyOf(a, b));
  ContactPair& pair = place->second;
  if (is_new) {
    const bool in_order = a.getUserIndex3() < b.getUserIndex3();
    pair.first = in_order ? &a : &b;
    pair.second = in_order ? &b : &a;
    for (const int moving : {pair.first_moving(), pair.second_moving()}) {
      if (moving >= 0) of_[static_cast<std::size_t>(moving)].push_back(&pair);
    }
  }
  pair.planned = plan;
  return &pair;
}

void ContactPairs::DropOthers(std::size_t moving, std::uint64_t plan) {
  std::vector<ContactPair*>& mine = of_[moving];
  for (std::size_t i = 0; i < mine.size();) {
    ContactPair& pair = *mine[i];
    if (pair.planned == plan) {
      ++i;
      continue;
    }
    for (const int place : {pair.first_moving(), pair.second_moving()}) {
      if (place >= 0) std::erase(of_[static_cast<std::size_t>(place)], &pair);
    }
    Release(pair);
    pairs_.erase(KeyOf(*pair.first, *pair.second));
  }
}

void ContactPairs::Ask(ContactPair& pair) {
  const btCollisionObjectWrapper first(nullptr, pair.first->getCollisionShape(), pair.first,
                                       pair.first->getWorldTransform(), -1, -1);
  const btCollisionObjectWrapper second(nullptr, pair.second->getCollisionShape(), pair.second,
                                        pair.second->getWorldTransform(), -1, -1);
  if (pair.algorithm == nullptr) {
    pair.algorithm =
        dispatcher_.findAlgorithm(&first, &second, nullptr, BT_CONTACT_POINT_ALGORITHMS);
  }
  btManifoldResult result(&first, &second);
  pair.algorithm->processCollision(&first, &second, info_, &result);
  found_.resizeNoInitialize(0);
  pair.algorithm->getAllContactManifolds(found_);
  pair.manifolds.clear();
  for (int i = 0; i < found_.size(); ++i) {
    if (found_[i]->getNumContacts() > 0) pair.manifolds.push_back(found_[i]);
  }
}

const ContactPair* ContactPairs::Find(const btCollisionObject& a,
                                      const btCollisionObject& b) const {
  const auto found = pairs_.find(KeyOf(a, b));
  return found == pairs_.end() ? nullptr : &found->second;
}

void ContactPairs::Release(ContactPair& pair) {
  if (pair.algorithm == nullptr) return;
  pair.algorithm->~btCollisionAlgorithm();
  dispatcher_.freeCollisionAlgorithm(pair.algorithm);
}

}  // namespace rikiseki::world
