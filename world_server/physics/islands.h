// SPDX-License-Identifier: MIT
// Who could meet whom within a short window of time. Bodies that could are one group; groups know nothing
// of each other until the window has passed, so that each may be stepped alone and in its own steps.
//
// A body reaches as far as twice its speed carries it, pushes of the window included; whom it may hit,
// as far as is left of that after the gap. Two meet if their reaches do. A sleeping island within reach
// is part of the group, asleep. All follows from numbers and places, never from addresses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "world_server/physics/bullet_bodies.h"
#include "world_server/physics/contact_pairs.h"
#include "world_server/physics/sleep.h"

namespace rikiseki::world {

struct Group {
  std::vector<std::size_t> members;        // places in BulletBodies::moving, ascending
  std::vector<ContactPair*> pairs;         // that could meet, in the order of their numbers
  std::vector<btTypedConstraint*> joints;  // of the members

  void Clear() {
    members.clear();
    pairs.clear();
    joints.clear();
  }
};

class Islands {
 public:
  /// All outlive this. `world` says the joints. Without `contacts` nobody ever meets anybody.
  Islands(BulletBodies& bodies, ContactPairs& pairs, Sleepers& sleepers,
          btDbvtBroadphase& broadphase, btDiscreteDynamicsWorld& world, bool contacts);

  /// The groups of all that is awake, by their first members. `pushed_speed` [m/s], by place in `moving`,
  /// is what the pushes of the window may add. Valid until the next plan.
  std::span<Group> Plan(double window_s, std::span<const double> pushed_speed);

  /// Keeps the broad phase true to where the body is.
  void UpdateBox(std::size_t body);
  /// The scene's bodies that may be within `reach_m` of a moving body where it was at UpdateBox, itself
  /// excluded; ascending.
  std::vector<std::size_t> NearTo(std::size_t body, double reach_m);

  /// The place among the last plan's groups of a body that is in it.
  std::size_t GroupOf(std::size_t body) const { return group_of_[body]; }

 private:
  // Two that may come near each other.
  struct Near {
    std::size_t body = 0;
    btRigidBody* other = nullptr;
    double gap_m = 0;
  };

  void KnowJoints();
  void Add(std::size_t body);  // with all that sleep with it
  void AddAlone(std::size_t body);
  void SetReach(std::size_t body, double reach_m);
  void Reach(std::size_t body, std::size_t other, double gap_m);
  void AskJoined(std::size_t body);
  void Unite(std::size_t a, std::size_t b);
  std::size_t RootOf(std::size_t body);
  void Ask(std::size_t body);
  void PlanPair(const Near& near);
  std::span<btRigidBody* const> Overlapping(const btRigidBody& rigid, double reach_m);
  double SpeedOf(std::size_t body) const;

  BulletBodies& bodies_;
  ContactPairs& pairs_;
  Sleepers& sleepers_;
  btDbvtBroadphase& broadphase_;
  btDiscreteDynamicsWorld& world_;
  bool contacts_;

  std::vector<std::vector<btTypedConstraint*>> joints_of_;  // each moving body
  int known_joints_ = -1;

  std::uint64_t plan_ = 0;
  double window_s_ = 0;
  std::span<const double> pushed_speed_;
  std::vector<std::uint64_t> plan_of_;  // the last that each was in
  std::vector<std::size_t> parents_;
  std::vector<double> reaches_;       // m, how far each may come, or send others
  std::vector<double> asked_;         // m, the reach with which it was asked; -1 = not yet
  std::vector<std::size_t> members_;  // of the plan
  std::vector<std::pair<double, std::size_t>> to_ask_;  // a heap, by reach
  std::vector<Near> near_;
  std::vector<btRigidBody*> overlapping_;
  std::vector<ContactPair*> planned_;
  std::vector<std::size_t> numbers_;  // of roots: that of the group
  std::vector<std::size_t> group_of_;
  std::vector<Group> groups_;
};

}  // namespace rikiseki::world
