// SPDX-License-Identifier: MIT
#include "world_server/physics/sleep.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr double kStays = 2.5e-5;    // m, so near is where it was
constexpr double kSettling = 0.5;    // s, so long
constexpr double kTrembling = 0.01;  // m/s, no faster meanwhile
// Sooner where it is slower than could leave that place in that time: what is about to move, by 1e-3 m/s^2
// or more, is faster by then. A scene that begins at rest sleeps before its first tick is over.
constexpr double kStill = 2e-5;       // m/s
constexpr double kStillFor = 0.0295;  // s, three windows

// m, of any point of a body.
double WayBetween(const Pose& from, const Pose& to, double outer_radius) {
  return (to.position - from.position).norm() +
         outer_radius * to.orientation.angularDistance(from.orientation);
}

}  // namespace

Sleepers::Sleepers(std::vector<MovingBody>& moving, bool may_sleep)
    : moving_(moving),
      may_sleep_(may_sleep),
      awake_(moving.size()),
      island_of_(moving.size(), kAwake),
      rests_(moving.size()),
      parents_(moving.size()),
      held_(moving.size()) {
  std::iota(awake_.begin(), awake_.end(), std::size_t{0});
}

// All who fell asleep in a window at once.
void Sleepers::TakeOutSleepers() {
  if (!std::exchange(some_fell_asleep_, false)) return;
  std::erase_if(awake_, [this](std::size_t body) { return Sleeps(body); });
}

std::span<const std::size_t> Sleepers::awake() {
  TakeOutSleepers();
  return awake_;
}

void Sleepers::Wake(std::size_t body) {
  const std::size_t island = island_of_[body];
  if (island == kAwake) return;
  TakeOutSleepers();  // else one that wakes would stand there twice
  for (const std::size_t mate : islands_[island]) {
    island_of_[mate] = kAwake;
    rests_[mate] = {};
    moving_[mate].rigid->forceActivationState(ACTIVE_TAG);
    awake_.insert(std::lower_bound(awake_.begin(), awake_.end(), mate), mate);
  }
  islands_[island].clear();
  free_islands_.push_back(island);
}

bool Sleepers::SleepsOn(std::size_t body, const BodyState& state) const {
  if (!Sleeps(body) || !state.velocity.isZero(0) || !state.angular_velocity.isZero(0)) return false;
  return WayBetween(moving_[body].State().pose, state.pose, moving_[body].outer_radius) <= kStays;
}

std::size_t Sleepers::RootOf(std::size_t body) {
  while (parents_[body] != body) body = parents_[body] = parents_[parents_[body]];
  return body;
}

void Sleepers::WatchOne(std::size_t body, double time_s) {
  const Pose pose = FromBullet(moving_[body].rigid->getWorldTransform());
  const double speed = moving_[body].Speed();
  Rest& rest = rests_[body];
  const double way = WayBetween(rest.pose, pose, moving_[body].outer_radius);
  if (!(way <= kStays && speed <= kTrembling)) {
    rest = {.pose = pose};
    return;
  }
  rest.time_s += time_s;
  rest.still_s = speed <= kStill ? rest.still_s + time_s : 0;
}

bool Sleepers::HasRested(std::size_t body) const {
  return rests_[body].time_s >= kSettling || rests_[body].still_s >= kStillFor;
}

void Sleepers::Watch(std::span<const std::size_t> members, std::span<ContactPair* const> pairs,
                     std::span<btTypedConstraint* const> joints, std::span<const char> pushed,
                     double time_s) {
  if (!may_sleep_) return;
  bool some_rest = false;
  for (const std::size_t body : members) {
    if (Sleeps(body)) continue;
    WatchOne(body, time_s);
    some_rest = some_rest || HasRested(body);
    parents_[body] = body;
  }
  if (!some_rest) return;

  const auto each_tie = [&](const auto& tie) {
    for (const ContactPair* pair : pairs) {
      if (pair->Gap() <= kTouching) tie(pair->first_moving(), pair->second_moving());
    }
    for (const btTypedConstraint* joint : joints) {
      tie(joint->getRigidBodyA().getUserIndex(), joint->getRigidBodyB().getUserIndex());
    }
  };
  const auto awake = [this](int place) {
    return place >= 0 && !Sleeps(static_cast<std::size_t>(place));
  };
  each_tie([&](int a, int b) {
    if (!awake(a) || !awake(b)) return;
    const std::size_t root = RootOf(static_cast<std::size_t>(a));
    const std::size_t other = RootOf(static_cast<std::size_t>(b));
    parents_[std::max(root, other)] = std::min(root, other);
  });
  for (const std::size_t body : members) held_[body] = 0;
  each_tie([&](int a, int b) {
    if (a < 0 && awake(b)) held_[RootOf(static_cast<std::size_t>(b))] = 1;
    if (b < 0 && awake(a)) held_[RootOf(static_cast<std::size_t>(a))] = 1;
  });

  std::map<std::size_t, std::vector<std::size_t>> islands;  // by root
  for (const std::size_t body : members) {
    if (!Sleeps(body)) islands[RootOf(body)].push_back(body);
  }
  for (const auto& [root, bodies] : islands) {
    const bool held = held_[root] != 0;
    const bool rests = std::all_of(bodies.begin(), bodies.end(), [&](std::size_t body) {
      return HasRested(body) && pushed[body] == 0 && (held || moving_[body].Speed() == 0);
    });
    if (rests) PutToSleep(bodies);
  }
}

void Sleepers::PutToSleep(const std::vector<std::size_t>& bodies) {
  std::size_t island = islands_.size();
  if (free_islands_.empty()) {
    islands_.emplace_back();
  } else {
    island = free_islands_.back();
    free_islands_.pop_back();
  }
  islands_[island] = bodies;
  for (const std::size_t body : bodies) {
    island_of_[body] = island;
    btRigidBody& rigid = *moving_[body].rigid;
    rigid.setLinearVelocity(btVector3(0, 0, 0));
    rigid.setAngularVelocity(btVector3(0, 0, 0));
    rigid.forceActivationState(ISLAND_SLEEPING);
  }
  some_fell_asleep_ = true;
}

}  // namespace rikiseki::world
