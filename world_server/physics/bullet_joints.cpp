// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_joints.h"

#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "world_server/physics/bullet_hooks.h"
#include "world_server/physics/bullet_math.h"
#include "world_server/physics/linkage.h"

namespace rikiseki::world {
namespace {

constexpr double kTorn = 1e-6;    // m or rad: no substep leaves a joint so far apart
constexpr double kSlips = 1e-9;   // m/s: slower, there is no direction of slip
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
  const double hold = step_s * (joint.friction + joint.damping * std::abs(linkage.Speed(place)));
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
  std::vector<std::size_t> places;                // of its bodies in `moving`
  btRigidBody ground{0, nullptr, nullptr};        // stands for what does not move
  std::vector<std::unique_ptr<SolverRows>> rows;  // of the linkage's links
  std::vector<BodyState> start;
  std::vector<BodyState> guess;  // what the joints' last impulses gave to the velocities beforehand

  explicit Joined(Linkage given) : linkage(std::move(given)) {}
};

BulletJoints::BulletJoints(const Scene& scene, BulletBodies& bodies, btDiscreteDynamicsWorld& world)
    : bodies_(bodies), world_(world), joined_of_(bodies.moving.size(), nullptr) {
  IgnorePairs(scene);
  for (Linkage& linkage : Linkage::Of(scene)) {
    joined_.push_back(std::make_unique<Joined>(std::move(linkage)));
    Joined& joined = *joined_.back();
    for (const std::size_t body : joined.linkage.bodies()) {
      joined.places.push_back(bodies.moving_of[body]);
      joined_of_[joined.places.back()] = &joined;
    }
    joined.start.resize(joined.places.size());
    const auto rigid = [&](std::size_t place) -> btRigidBody& {
      return place == Joint::kWorld ? joined.ground : *bodies.moving[joined.places[place]].rigid;
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
  std::vector<std::vector<btRigidBody*>> rigids(scene.bodies.size());
  for (const auto& rigid : bodies_.rigid_bodies) {
    rigids[static_cast<std::size_t>(rigid->getUserIndex2())].push_back(rigid.get());
  }
  const auto ignore = [&](std::size_t a, std::size_t b) {
    for (btRigidBody* first : rigids[a]) {
      for (btRigidBody* second : rigids[b]) {
        first->setIgnoreCollisionCheck(second, true);
        second->setIgnoreCollisionCheck(first, true);
      }
    }
  };
  std::map<std::uint32_t, std::vector<std::size_t>> models;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    if (scene.bodies[i].model != 0) models[scene.bodies[i].model].push_back(i);
  }
  for (const auto& [model, members] : models) {
    for (const std::size_t a : members) {
      for (const std::size_t b : members) {
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

// As the engine has them now, in the scene's frames.
void BulletJoints::Read(const Joined& joined, std::span<BodyState> states) const {
  for (std::size_t i = 0; i < states.size(); ++i) {
    states[i] = bodies_.moving[joined.places[i]].State();
  }
}

void BulletJoints::WriteVelocities(const Joined& joined, std::span<const BodyState> states) {
  for (std::size_t i = 0; i < states.size(); ++i) {
    btRigidBody& rigid = *bodies_.moving[joined.places[i]].rigid;
    rigid.setLinearVelocity(ToBullet(states[i].velocity));
    rigid.setAngularVelocity(ToBullet(states[i].angular_velocity));
  }
}

std::span<const std::size_t> BulletJoints::Settle(std::size_t moving) {
  const Joined* joined = joined_of_[moving];
  if (joined == nullptr) return {};
  std::vector<BodyState> states(joined->places.size());
  Read(*joined, states);
  joined->linkage.ProjectVelocities(states);
  WriteVelocities(*joined, states);
  return joined->places;
}

// Friction is aimed along the true slip, and across it: with what the joints gave last in the velocities, as
// the solver sees them, wheels would seem to slip along their axles, and nothing would make them roll.
void BulletJoints::AimFriction(std::span<btPersistentManifold* const> manifolds) const {
  for (btPersistentManifold* manifold : manifolds) {
    if (JoinedOf(*manifold->getBody0()) == nullptr && JoinedOf(*manifold->getBody1()) == nullptr) {
      continue;
    }
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
      btManifoldPoint& point = manifold->getContactPoint(i);
      const btVector3 held = point.m_appliedImpulseLateral1 * point.m_lateralFrictionDir1 +
                             point.m_appliedImpulseLateral2 * point.m_lateralFrictionDir2;
      const btVector3& normal = point.m_normalWorldOnB;
      const btVector3 slip = ToBullet(Slip(*manifold, point));
      if (slip.length() > kSlips) {
        point.m_lateralFrictionDir1 = slip.normalized();
        point.m_lateralFrictionDir2 = normal.cross(point.m_lateralFrictionDir1);
      } else {
        btPlaneSpace1(normal, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
      }
      point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
      point.m_appliedImpulseLateral1 = held.dot(point.m_lateralFrictionDir1);
      point.m_appliedImpulseLateral2 = held.dot(point.m_lateralFrictionDir2);
    }
  }
}

const BulletJoints::Joined* BulletJoints::JoinedOf(const btCollisionObject& object) const {
  const int place = object.getUserIndex();
  return place < 0 ? nullptr : joined_of_[static_cast<std::size_t>(place)];
}

void BulletJoints::BeginSubstep(std::span<btPersistentManifold* const> manifolds,
                                std::span<const std::size_t> stepped, double step_s) {
  stepped_.clear();
  if (joined_.empty()) return;
  AimFriction(manifolds);
  for (const std::size_t place : stepped) {
    Joined* found = joined_of_[place];
    if (found == nullptr || found->places.front() != place) continue;
    stepped_.push_back(found);
    Joined& joined = *found;
    std::vector<BodyState> states(joined.places.size());
    Read(joined, states);
    // Bodies that a new scene put elsewhere come together without the speed of doing so.
    if (joined.linkage.Apart(states) > kTorn) joined.linkage.ProjectPositions(states);
    joined.start = states;
    for (std::size_t i = 0; i < states.size(); ++i) {  // before the drag
      joined.start[i].velocity = bodies_.moving[joined.places[i]].velocity;
      joined.start[i].angular_velocity = bodies_.moving[joined.places[i]].angular_velocity;
    }
    joined.linkage.Begin(joined.start);

    // With what the joints gave last, contacts are solved under the load that they will bear.
    joined.guess = states;
    joined.linkage.GiveLastImpulses(states);
    WriteVelocities(joined, states);
    for (std::size_t i = 0; i < states.size(); ++i) {
      joined.guess[i].velocity = states[i].velocity - joined.guess[i].velocity;
      joined.guess[i].angular_velocity =
          states[i].angular_velocity - joined.guess[i].angular_velocity;
    }
    for (std::size_t i = 0; i < joined.rows.size(); ++i) {
      joined.rows[i]->Set(RowsOf(joined.linkage, i, step_s));
    }
  }
}

bool BulletJoints::Touches(const Joined& joined,
                           std::span<btPersistentManifold* const> manifolds) const {
  for (const btPersistentManifold* manifold : manifolds) {
    if (JoinedOf(*manifold->getBody0()) != &joined && JoinedOf(*manifold->getBody1()) != &joined) {
      continue;
    }
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
      if (manifold->getContactPoint(i).m_appliedImpulse > 0) return true;
    }
  }
  return false;
}

void BulletJoints::EndSubstep(std::span<btPersistentManifold* const> manifolds, double step_s) {
  for (Joined* joined : stepped_) End(*joined, Touches(*joined, manifolds), step_s);
}

void BulletJoints::End(Joined& joined, bool touches, double step_s) {
  std::vector<BodyState> states(joined.places.size());
  Read(joined, states);
  std::vector<Vec3> moved(states.size());  // otherwise than by the velocity: out of penetration
  bool any_moved = false;
  for (std::size_t i = 0; i < states.size(); ++i) {
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
  joined.linkage.End(touches, step_s, states);
  if (any_moved) {
    for (std::size_t i = 0; i < states.size(); ++i) states[i].pose.position += moved[i];
    joined.linkage.ProjectPositions(states);
  }
  for (std::size_t i = 0; i < states.size(); ++i) {
    const MovingBody& body = bodies_.moving[joined.places[i]];
    const Pose pose = states[i].pose * Pose{.orientation = body.q_BP};
    body.rigid->setCenterOfMassTransform(ToBullet(pose));
  }
  WriteVelocities(joined, states);
}

}  // namespace rikiseki::world
