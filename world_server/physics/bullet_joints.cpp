#include "world_server/physics/bullet_joints.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "world_server/physics/bullet_math.h"
#include "world_server/physics/linkage.h"

namespace rikiseki::world {
namespace {

constexpr double kMoved = 1e-12;  // m: Bullet moved a body otherwise than by its velocity

// One row for Bullet's solver: the rate is to become `rate`, by an impulse within the bounds.
struct BoundedRow {
  JointRow row;
  btScalar rate = 0;
  btScalar lowest = -SIMD_INFINITY;
  btScalar highest = SIMD_INFINITY;
};

// Hands a joint's rows to Bullet's solver, the child as its first body, and takes down the impulses.
class SolverRows final : public btTypedConstraint {
 public:
  SolverRows(btRigidBody& child, btRigidBody& parent)
      : btTypedConstraint(D6_CONSTRAINT_TYPE, child, parent) {
    setJointFeedback(&feedback_);
  }

  void Set(std::vector<BoundedRow> rows) {
    rows_ = std::move(rows);
    feedback_ = {};
  }

  void getInfo1(btConstraintInfo1* info) override {
    info->m_numConstraintRows = static_cast<int>(rows_.size());
    info->nub = 0;
  }

  void getInfo2(btConstraintInfo2* info) override {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const BoundedRow& bounded = rows_[i];
      const int at = static_cast<int>(i) * info->rowskip;
      for (int j = 0; j < 3; ++j) {
        info->m_J1linearAxis[at + j] = bounded.row.linear[j];
        info->m_J1angularAxis[at + j] = bounded.row.angular_child[j];
        info->m_J2linearAxis[at + j] = -bounded.row.linear[j];
        info->m_J2angularAxis[at + j] = bounded.row.angular_parent[j];
      }
      info->m_constraintError[at] = bounded.rate;
      info->m_lowerLimit[at] = bounded.lowest;
      info->m_upperLimit[at] = bounded.highest;
    }
  }

  void setParam(int, btScalar, int) override {}
  btScalar getParam(int, int) const override { return 0; }

  const btJointFeedback& feedback() const { return feedback_; }

 private:
  std::vector<BoundedRow> rows_;
  btJointFeedback feedback_{};
};

// What a joint holds, what it resists in its own direction, and its limits: the rate at which each
// would be reached after the substep.
std::vector<BoundedRow> RowsOf(const Linkage& linkage, std::size_t place, double step_s) {
  const Linkage::Link& link = linkage.links()[place];
  std::vector<BoundedRow> rows;
  for (const JointRow& row : linkage.HeldRows(place)) rows.push_back({.row = row});
  if (!link.has_axis()) return rows;
  const Joint& joint = link.joint;
  const JointRow& free = linkage.FreeRowOf(place);
  const double hold =
      step_s * (joint.friction + joint.damping * std::abs(linkage.Speed(place)));
  if (hold > 0) rows.push_back({.row = free, .lowest = -hold, .highest = hold});
  if (std::isfinite(joint.upper)) {
    rows.push_back({.row = free, .rate = (joint.upper - link.position) / step_s, .highest = 0});
  }
  if (std::isfinite(joint.lower)) {
    rows.push_back({.row = free, .rate = (joint.lower - link.position) / step_s, .lowest = 0});
  }
  return rows;
}

}  // namespace

// A linkage, its bodies' states at the start of the substep, and its joints' rows in Bullet.
struct BulletJoints::Joined {
  Linkage linkage;
  btRigidBody ground{0, nullptr, nullptr};  // stands for what does not move
  std::vector<std::unique_ptr<SolverRows>> rows;  // of the linkage's links
  std::vector<BodyState> start;
  std::vector<BodyState> guess;  // what the joints' last impulses gave to the velocities beforehand
  bool touches = false;
  bool awake = false;

  explicit Joined(Linkage given) : linkage(std::move(given)) {}
};

BulletJoints::BulletJoints(const Scene& scene, std::vector<Place> places,
                           btDiscreteDynamicsWorld& world)
    : places_(std::move(places)), world_(world), joined_of_(scene.bodies.size(), nullptr) {
  IgnorePairs(scene);
  for (Linkage& linkage : Linkage::Of(scene)) {
    joined_.push_back(std::make_unique<Joined>(std::move(linkage)));
    Joined& joined = *joined_.back();
    const std::vector<std::size_t>& bodies = joined.linkage.bodies();
    joined.start.resize(bodies.size());
    for (const std::size_t body : bodies) {
      joined_of_[body] = &joined;
      places_[body].hooked->jointed = true;
    }
    const auto rigid = [&](std::size_t place) -> btRigidBody& {
      return place == Joint::kWorld ? joined.ground : *places_[bodies[place]].hooked->rigid;
    };
    for (const Linkage::Link& link : joined.linkage.links()) {
      joined.rows.push_back(std::make_unique<SolverRows>(rigid(link.child), rigid(link.parent)));
      world_.addConstraint(joined.rows.back().get());
    }
  }
}

BulletJoints::~BulletJoints() {
  for (const auto& joined : joined_) {
    for (const auto& rows : joined->rows) world_.removeConstraint(rows.get());
  }
}

void BulletJoints::IgnorePairs(const Scene& scene) {
  std::vector<std::vector<btCollisionObject*>> objects(scene.bodies.size());
  btCollisionObjectArray& all = world_.getCollisionObjectArray();
  for (int i = 0; i < all.size(); ++i) {
    objects[static_cast<std::size_t>(all[i]->getUserIndex2())].push_back(all[i]);
  }
  const auto ignore = [&](std::size_t a, std::size_t b) {
    for (btCollisionObject* first : objects[a]) {
      for (btCollisionObject* second : objects[b]) first->setIgnoreCollisionCheck(second, true);
    }
  };
  std::map<std::uint32_t, std::vector<std::size_t>> models;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    if (scene.bodies[i].model != 0) models[scene.bodies[i].model].push_back(i);
  }
  for (const auto& [model, bodies] : models) {
    for (const std::size_t a : bodies) {
      for (const std::size_t b : bodies) {
        if (a < b && !Collide(scene, a, b)) ignore(a, b);
      }
    }
  }
  for (const Joint& joint : scene.joints) {
    if (joint.parent != Joint::kWorld && joint.child != Joint::kWorld) {
      ignore(joint.parent, joint.child);
    }
  }
}

// As the engine has them now.
void BulletJoints::Read(const Joined& joined, std::span<BodyState> states) const {
  const std::vector<std::size_t>& bodies = joined.linkage.bodies();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Place& place = places_[bodies[i]];
    const btRigidBody& rigid = *place.hooked->rigid;
    states[i] = {.pose = FromBullet(rigid.getWorldTransform()) *
                         Pose{.orientation = place.q_BP.conjugate()},
                 .velocity = FromBullet(rigid.getLinearVelocity()),
                 .angular_velocity = FromBullet(rigid.getAngularVelocity())};
  }
}

void BulletJoints::WriteVelocities(const Joined& joined, std::span<const BodyState> states) {
  const std::vector<std::size_t>& bodies = joined.linkage.bodies();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    btRigidBody& rigid = *places_[bodies[i]].hooked->rigid;
    rigid.setLinearVelocity(ToBullet(states[i].velocity));
    rigid.setAngularVelocity(ToBullet(states[i].angular_velocity));
  }
}

// Whether any of its bodies is awake; then all are.
bool BulletJoints::Wakes(const Joined& joined) {
  const std::vector<std::size_t>& bodies = joined.linkage.bodies();
  const auto active = [&](std::size_t body) { return places_[body].hooked->rigid->isActive(); };
  if (std::none_of(bodies.begin(), bodies.end(), active)) return false;
  for (const std::size_t body : bodies) {
    if (!active(body)) places_[body].hooked->rigid->activate(true);
  }
  return true;
}

void BulletJoints::ProjectVelocities() {
  for (const auto& joined : joined_) {
    if (!Wakes(*joined)) continue;
    std::vector<BodyState> states(joined->start.size());
    Read(*joined, states);
    joined->linkage.ProjectVelocities(states);
    WriteVelocities(*joined, states);
  }
}

void BulletJoints::BeginSubstep(double step_s) {
  for (const auto& owned : joined_) {
    Joined& joined = *owned;
    joined.awake = Wakes(joined);
    if (!joined.awake) continue;
    const Linkage& linkage = joined.linkage;
    Read(joined, joined.start);
    std::vector<BodyState> states = joined.start;  // the drag included, `start` not
    for (std::size_t i = 0; i < states.size(); ++i) {
      const HookedBody& hooked = *places_[linkage.bodies()[i]].hooked;
      joined.start[i].velocity = hooked.velocity;
      joined.start[i].angular_velocity = hooked.angular_velocity;
    }
    joined.linkage.Begin(joined.start);

    // With what the joints gave last, contacts are solved under the load that they will bear.
    joined.guess = states;
    linkage.GiveLastImpulses(joined.guess);
    for (std::size_t i = 0; i < states.size(); ++i) {
      std::swap(joined.guess[i], states[i]);
      joined.guess[i].velocity = states[i].velocity - joined.guess[i].velocity;
      joined.guess[i].angular_velocity =
          states[i].angular_velocity - joined.guess[i].angular_velocity;
    }
    WriteVelocities(joined, states);
    for (std::size_t i = 0; i < joined.rows.size(); ++i) {
      joined.rows[i]->Set(RowsOf(linkage, i, step_s));
    }
  }
}

void BulletJoints::FindTouched() {
  for (const auto& joined : joined_) joined->touches = false;
  btDispatcher& dispatcher = *world_.getDispatcher();
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    bool pushes = false;
    for (int j = 0; j < manifold.getNumContacts(); ++j) {
      pushes = pushes || manifold.getContactPoint(j).m_appliedImpulse > 0;
    }
    if (!pushes) continue;
    for (const btCollisionObject* object : {manifold.getBody0(), manifold.getBody1()}) {
      Joined* joined = joined_of_[static_cast<std::size_t>(object->getUserIndex2())];
      if (joined != nullptr) joined->touches = true;
    }
  }
}

void BulletJoints::EndSubstep(double step_s) {
  FindTouched();
  for (const auto& owned : joined_) {
    Joined& joined = *owned;
    if (!joined.awake) continue;
    const std::vector<std::size_t>& bodies = joined.linkage.bodies();
    std::vector<BodyState> states(bodies.size());
    if (!places_[bodies.front()].hooked->rigid->isActive()) {  // fell asleep just now
      WriteVelocities(joined, states);
      continue;
    }
    Read(joined, states);
    std::vector<Vec3> moved(bodies.size());  // otherwise than by the velocity: out of penetration
    bool any_moved = false;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      BodyState& state = states[i];
      const Pose& start = joined.start[i].pose;
      moved[i] = state.pose.position - start.position - step_s * state.velocity;
      any_moved = any_moved || moved[i].cwiseAbs().maxCoeff() > kMoved;
      state.pose = start;
      state.velocity -= joined.guess[i].velocity;
      state.angular_velocity -= joined.guess[i].angular_velocity;
    }
    for (std::size_t i = 0; i < joined.rows.size(); ++i) {
      const Linkage::Link& link = joined.linkage.links()[i];
      const btJointFeedback& given = joined.rows[i]->feedback();
      const auto take_out = [&](std::size_t place, const btVector3& force, const btVector3& torque) {
        if (place == Joint::kWorld) return;
        ApplyImpulse(joined.linkage.inertias()[place], -step_s * FromBullet(force),
                     -step_s * FromBullet(torque), states[place]);
      };
      take_out(link.child, given.m_appliedForceBodyA, given.m_appliedTorqueBodyA);
      take_out(link.parent, given.m_appliedForceBodyB, given.m_appliedTorqueBodyB);
    }
    joined.linkage.End(joined.touches, step_s, states);
    if (any_moved) {
      for (std::size_t i = 0; i < bodies.size(); ++i) states[i].pose.position += moved[i];
      joined.linkage.ProjectPositions(states);
    }
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Place& place = places_[bodies[i]];
      const btTransform pose = ToBullet(states[i].pose * Pose{.orientation = place.q_BP});
      place.hooked->rigid->setCenterOfMassTransform(pose);  // turns the inertia too
    }
    WriteVelocities(joined, states);
  }
}

}  // namespace rikiseki::world
