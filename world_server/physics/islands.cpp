#include "world_server/physics/islands.h"

#include <algorithm>
#include <cmath>

#include "world_server/physics/bullet_math.h"

namespace rikiseki::world {
namespace {

constexpr double kMargin = 1e-3;         // m
constexpr double kLeastSpeed = 1. / 64;  // m/s
constexpr double kTooLarge = 1e12;       // m^2

// The next power of two: a group that gets a little faster need not be asked again.
double RoundedUp(double speed) {
  if (!(speed > kLeastSpeed)) return kLeastSpeed;
  return std::exp2(std::ceil(std::log2(speed)));
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
      speeds_(bodies.moving.size()),
      asked_(bodies.moving.size()),
      united_(bodies.moving.size()),
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
  const double speed = moving.rigid->getLinearVelocity().length() +
                       moving.outer_radius * moving.rigid->getAngularVelocity().length();
  const double wind = moving.air.acts() ? moving.air.wind.norm() : 0;
  return speed + wind + window_s_ * moving.gravity + pushed_speed_[body];
}

std::size_t Islands::RootOf(std::size_t body) {
  while (parents_[body] != body) body = parents_[body] = parents_[parents_[body]];
  return body;
}

void Islands::AddAlone(std::size_t body) {
  plan_of_[body] = plan_;
  parents_[body] = body;
  united_[body] = {body};
  asked_[body] = 0;
  speeds_[body] = sleepers_.Sleeps(body) ? 0 : SpeedOf(body);
  members_.push_back(body);
  to_ask_.push_back(body);
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

void Islands::AddJoined(std::size_t body) {
  for (const btTypedConstraint* joint : joints_of_[body]) {
    for (const btRigidBody* rigid : {&joint->getRigidBodyA(), &joint->getRigidBodyB()}) {
      if (rigid->getUserIndex() < 0) continue;
      const auto other = static_cast<std::size_t>(rigid->getUserIndex());
      Add(other);
      Unite(body, other);
    }
  }
}

void Islands::Unite(std::size_t a, std::size_t b) {
  std::size_t root = RootOf(a);
  std::size_t other = RootOf(b);
  if (root == other) return;
  if (united_[root].size() < united_[other].size()) std::swap(root, other);
  const double speed = std::max(speeds_[root], speeds_[other]);
  for (const std::size_t side : {root, other}) {
    if (RoundedUp(speed) <= RoundedUp(speeds_[side])) continue;
    to_ask_.insert(to_ask_.end(), united_[side].begin(), united_[side].end());
  }
  parents_[other] = root;
  speeds_[root] = speed;
  united_[root].insert(united_[root].end(), united_[other].begin(), united_[other].end());
  united_[other].clear();
}

// Twice the way: whoever comes to meet it is no faster, or asks itself.
void Islands::Ask(std::size_t body, double reach_m) {
  btRigidBody& rigid = *bodies_.moving[body].rigid;
  const btBroadphaseProxy& proxy = *rigid.getBroadphaseHandle();
  const btVector3 reach(reach_m, reach_m, reach_m);
  const btVector3 low = proxy.m_aabbMin - reach;
  const btVector3 high = proxy.m_aabbMax + reach;
  std::vector<btRigidBody*> found;
  Overlaps overlaps(low, high, found);
  broadphase_.aabbTest(low, high, overlaps);
  for (btRigidBody* other : found) {
    if (other == &rigid) continue;
    ContactPair* pair = pairs_.Plan(rigid, *other, plan_);
    if (pair == nullptr) continue;
    planned_.push_back(pair);
    if (other->getUserIndex() < 0) continue;
    const auto place = static_cast<std::size_t>(other->getUserIndex());
    Add(place);
    Unite(body, place);
  }
}

std::span<Group> Islands::Plan(double window_s, std::span<const double> pushed_speed) {
  KnowJoints();
  ++plan_;
  window_s_ = window_s;
  pushed_speed_ = pushed_speed;
  members_.clear();
  to_ask_.clear();
  planned_.clear();
  for (const std::size_t body : sleepers_.awake()) {
    btRigidBody& rigid = *bodies_.moving[body].rigid;
    btVector3 low, high;
    rigid.getAabb(low, high);
    // Who was thrown out of the world meets nobody any more.
    if (!((high - low).length2() < kTooLarge)) continue;
    broadphase_.setAabb(rigid.getBroadphaseHandle(), low, high, world_.getDispatcher());
  }
  for (const std::size_t body : sleepers_.awake()) Add(body);
  while (!to_ask_.empty()) {
    const std::size_t body = to_ask_.back();
    to_ask_.pop_back();
    if (asked_[body] == 0) AddJoined(body);
    const double speed = RoundedUp(speeds_[RootOf(body)]);
    if (asked_[body] >= speed) continue;
    asked_[body] = speed;
    if (contacts_) Ask(body, 2 * speed * window_s + kMargin);
  }

  std::sort(members_.begin(), members_.end());
  std::size_t count = 0;
  for (const std::size_t body : members_) {
    pairs_.DropOthers(body, plan_);
    // The first member that comes by makes the group.
    const std::size_t root = RootOf(body);
    if (!united_[root].empty()) {
      united_[root].clear();
      numbers_[root] = count;
      if (groups_.size() == count) groups_.emplace_back();
      groups_[count] = {};
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
  planned_.erase(std::unique(planned_.begin(), planned_.end()), planned_.end());
  for (ContactPair* pair : planned_) {
    const int place = std::max(pair->first_moving(), pair->second_moving());
    groups_[group_of_[static_cast<std::size_t>(place)]].pairs.push_back(pair);
  }
  return std::span(groups_).first(count);
}

}  // namespace rikiseki::world
