// SPDX-License-Identifier: MIT
#include "world_server/physics/islands.h"

#include <algorithm>
#include <cmath>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr double kMargin = 1e-3;  // m
constexpr double kSpare = 2;  // what is hit by something heavier, and bounces, is that much faster
constexpr std::size_t kNoGroup = static_cast<std::size_t>(-1);
constexpr double kTooLarge = 1e12;  // m^2

// m, how far two boxes are apart at least; 0 = they overlap.
double Apart(const btBroadphaseProxy& a, const btBroadphaseProxy& b) {
  double apart = 0;
  for (int axis = 0; axis < 3; ++axis) {
    apart = std::max({apart, double{a.m_aabbMin[axis] - b.m_aabbMax[axis]},
                      double{b.m_aabbMin[axis] - a.m_aabbMax[axis]}});
  }
  return apart;
}

class Overlaps final : public btBroadphaseAabbCallback {
 public:
  Overlaps(const btVector3& low, const btVector3& high, std::vector<btRigidBody*>& found)
      : low_(low), high_(high), found_(found) {}

  bool process(const btBroadphaseProxy* proxy) override {
    // The tree's boxes are wider than the bodies'.
    if (TestAabbAgainstAabb2(low_, high_, proxy->m_aabbMin, proxy->m_aabbMax)) {
      found_.push_back(static_cast<btRigidBody*>(proxy->m_clientObject));
    }
    return true;
  }

 private:
  btVector3 low_, high_;
  std::vector<btRigidBody*>& found_;
};

}  // namespace

Islands::Islands(BulletBodies& bodies, ContactPairs& pairs, Sleepers& sleepers,
                 btDbvtBroadphase& broadphase, btDiscreteDynamicsWorld& world, bool contacts)
    : bodies_(bodies),
      pairs_(pairs),
      sleepers_(sleepers),
      broadphase_(broadphase),
      world_(world),
      contacts_(contacts),
      joints_of_(bodies.moving.size()),
      plan_of_(bodies.moving.size()),
      parents_(bodies.moving.size()),
      reaches_(bodies.moving.size()),
      asked_(bodies.moving.size()),
      numbers_(bodies.moving.size()),
      group_of_(bodies.moving.size()) {}

// Joints are added when the world is built, after this.
void Islands::KnowJoints() {
  if (known_joints_ == world_.getNumConstraints()) return;
  known_joints_ = world_.getNumConstraints();
  for (auto& joints : joints_of_) joints.clear();
  for (int i = 0; i < known_joints_; ++i) {
    btTypedConstraint* joint = world_.getConstraint(i);
    for (const btRigidBody* rigid : {&joint->getRigidBodyA(), &joint->getRigidBodyB()}) {
      const int place = rigid->getUserIndex();
      if (place >= 0) joints_of_[static_cast<std::size_t>(place)].push_back(joint);
    }
  }
}

double Islands::SpeedOf(std::size_t body) const {
  const MovingBody& moving = bodies_.moving[body];
  const double wind = moving.air.acts() ? moving.air.wind.norm() : 0;
  return moving.Speed() + wind + window_s_ * moving.gravity + pushed_speed_[body];
}

std::size_t Islands::RootOf(std::size_t body) {
  while (parents_[body] != body) body = parents_[body] = parents_[parents_[body]];
  return body;
}

void Islands::AddAlone(std::size_t body) {
  plan_of_[body] = plan_;
  parents_[body] = body;
  numbers_[body] = kNoGroup;
  asked_[body] = -1;
  members_.push_back(body);
  SetReach(body, sleepers_.Sleeps(body) ? 0 : kSpare * window_s_ * SpeedOf(body));
}

void Islands::SetReach(std::size_t body, double reach_m) {
  reaches_[body] = reach_m;
  to_ask_.emplace_back(reach_m, body);
  std::push_heap(to_ask_.begin(), to_ask_.end());
}

void Islands::Add(std::size_t body) {
  if (plan_of_[body] == plan_) return;
  AddAlone(body);
  if (!sleepers_.Sleeps(body)) return;
  for (const std::size_t mate : sleepers_.IslandOf(body)) {
    if (mate == body) continue;
    AddAlone(mate);
    Unite(body, mate);
  }
}

// What `body` may set in motion after a gap comes so much less far.
void Islands::Reach(std::size_t body, std::size_t other, double gap_m) {
  Add(other);
  const double left = reaches_[body] - gap_m;
  if (left > reaches_[other]) SetReach(other, left);
}

void Islands::AskJoined(std::size_t body) {
  for (const btTypedConstraint* joint : joints_of_[body]) {
    for (const btRigidBody* rigid : {&joint->getRigidBodyA(), &joint->getRigidBodyB()}) {
      const int other = rigid->getUserIndex();
      if (other < 0) continue;
      Reach(body, static_cast<std::size_t>(other), 0);
      Unite(body, static_cast<std::size_t>(other));
    }
  }
}

void Islands::Unite(std::size_t a, std::size_t b) {
  const std::size_t root = RootOf(a);
  const std::size_t other = RootOf(b);
  parents_[std::max(root, other)] = std::min(root, other);
}

// Others whose boxes are that near, until the next call.
std::span<btRigidBody* const> Islands::Overlapping(const btRigidBody& rigid, double reach_m) {
  const btBroadphaseProxy& proxy = *rigid.getBroadphaseHandle();
  const btVector3 reach(reach_m, reach_m, reach_m);
  const btVector3 low = proxy.m_aabbMin - reach;
  const btVector3 high = proxy.m_aabbMax + reach;
  overlapping_.clear();
  Overlaps overlaps(low, high, overlapping_);
  broadphase_.aabbTest(low, high, overlaps);
  std::erase(overlapping_, &rigid);
  return overlapping_;
}

// Whom it may hit, and whoever comes to meet it: that one reaches no farther, or is asked itself.
void Islands::Ask(std::size_t body) {
  const btRigidBody& rigid = *bodies_.moving[body].rigid;
  const double way = reaches_[body] + kMargin;
  for (btRigidBody* other : Overlapping(rigid, reaches_[body] + way)) {
    const double gap = Apart(*rigid.getBroadphaseHandle(), *other->getBroadphaseHandle());
    near_.push_back({body, other, gap});
    const int place = other->getUserIndex();
    if (place < 0 || gap > way || !ContactPairs::MayMeet(rigid, *other)) continue;
    Reach(body, static_cast<std::size_t>(place), gap);
  }
}

// Once it is known how far both may come.
void Islands::PlanPair(const Near& near) {
  double reach = reaches_[near.body] + kMargin;
  const int place = near.other->getUserIndex();
  if (place >= 0) {
    const auto other = static_cast<std::size_t>(place);
    if (plan_of_[other] == plan_) {
      // Told by the one that looked farther.
      if (std::pair(asked_[other], near.body) > std::pair(asked_[near.body], other)) return;
      reach += reaches_[other];
    }
  }
  if (near.gap_m > reach) return;
  ContactPair* pair = pairs_.Plan(*bodies_.moving[near.body].rigid, *near.other, plan_);
  if (pair == nullptr) return;
  planned_.push_back(pair);
  if (place >= 0) Unite(near.body, static_cast<std::size_t>(place));
}

std::vector<std::size_t> Islands::NearTo(std::size_t body, double reach_m) {
  std::vector<std::size_t> near;
  for (const btRigidBody* other : Overlapping(*bodies_.moving[body].rigid, reach_m)) {
    near.push_back(static_cast<std::size_t>(other->getUserIndex2()));
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  return near;
}

void Islands::UpdateBox(std::size_t body) {
  btRigidBody& rigid = *bodies_.moving[body].rigid;
  btVector3 low, high;
  rigid.getAabb(low, high);
  // Who was thrown out of the world meets nobody any more.
  if (!((high - low).length2() < kTooLarge)) return;
  broadphase_.setAabb(rigid.getBroadphaseHandle(), low, high, world_.getDispatcher());
}

std::span<Group> Islands::Plan(double window_s, std::span<const double> pushed_speed) {
  KnowJoints();
  ++plan_;
  window_s_ = window_s;
  pushed_speed_ = pushed_speed;
  members_.clear();
  to_ask_.clear();
  planned_.clear();
  near_.clear();
  for (const std::size_t body : sleepers_.awake()) UpdateBox(body);
  for (const std::size_t body : sleepers_.awake()) Add(body);
  while (!to_ask_.empty()) {
    // Who reaches farthest first: what others may make of it is known by then, and nobody asks twice.
    std::pop_heap(to_ask_.begin(), to_ask_.end());
    const std::size_t body = to_ask_.back().second;
    to_ask_.pop_back();
    if (asked_[body] >= reaches_[body]) continue;
    asked_[body] = reaches_[body];
    AskJoined(body);
    if (contacts_) Ask(body);
  }
  for (const Near& near : near_) PlanPair(near);

  std::sort(members_.begin(), members_.end());
  std::size_t count = 0;
  for (const std::size_t body : members_) {
    pairs_.DropOthers(body, plan_);
    // The first member that comes by makes the group.
    const std::size_t root = RootOf(body);
    if (numbers_[root] == kNoGroup) {
      numbers_[root] = count;
      if (groups_.size() == count) groups_.emplace_back();
      groups_[count].Clear();
      ++count;
    }
    group_of_[body] = numbers_[root];
    Group& group = groups_[group_of_[body]];
    group.members.push_back(body);
    for (btTypedConstraint* joint : joints_of_[body]) {
      const int first = joint->getRigidBodyA().getUserIndex();
      const int second = joint->getRigidBodyB().getUserIndex();
      const int least = first < 0 || second < 0 ? std::max(first, second) : std::min(first, second);
      if (least == static_cast<int>(body)) group.joints.push_back(joint);
    }
  }
  std::sort(planned_.begin(), planned_.end(),
            [](const ContactPair* a, const ContactPair* b) { return a->Order() < b->Order(); });
  for (ContactPair* pair : planned_) {
    const int place = std::max(pair->first_moving(), pair->second_moving());
    groups_[group_of_[static_cast<std::size_t>(place)]].pairs.push_back(pair);
  }
  return std::span(groups_).first(count);
}

}  // namespace rikiseki::world
