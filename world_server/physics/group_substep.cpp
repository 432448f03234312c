// SPDX-License-Identifier: MIT
#include "world_server/physics/group_substep.h"

#include <algorithm>

#include "common/body_step.h"
#include "world_server/physics/bullet_hooks.h"
#include "world_server/physics/bullet_math.h"
#include "world_server/physics/bullet_rebound.h"
#include "world_server/physics/jointed_solver.h"

namespace rikiseki::world {
namespace {

// Without friction there are no rows of it to sweep over. Only the pool's length is taken back: Bullet
// still reads the rows, impulse 0 as they were made, when it writes the contacts back.
class FrictionlessSolver final : public JointedSolver {
 protected:
  void convertContacts(btPersistentManifold** manifolds, int count,
                       const btContactSolverInfo& info) override {
    btSequentialImpulseConstraintSolver::convertContacts(manifolds, count, info);
    m_tmpSolverContactFrictionConstraintPool.resizeNoInitialize(0);
  }
};

}  // namespace

std::unique_ptr<btSequentialImpulseConstraintSolver> MakeSolver(const EngineParts& parts) {
  if (!parts.friction) return std::make_unique<FrictionlessSolver>();
  return std::make_unique<JointedSolver>();
}

GroupedWorld::GroupedWorld(const Scene& scene, btCollisionDispatcher& dispatcher,
                           btDbvtBroadphase& broadphase,
                           btSequentialImpulseConstraintSolver& solver,
                           btCollisionConfiguration& configuration, BulletBodies& bodies,
                           ContactPairs& pairs, Sleepers& sleepers, const EngineParts& parts,
                           double resting_depth)
    : btDiscreteDynamicsWorld(&dispatcher, &broadphase, &solver, &configuration),
      bodies_(bodies),
      pairs_(pairs),
      sleepers_(sleepers),
      parts_(parts) {
  btContactSolverInfo& info = getSolverInfo();
  info.m_leastSquaresResidualThreshold = 0;  // always all iterations: no early end, same bits
  // The whole of the last substep's impulses: with less, each substep lets a stack sink a little into
  // motion, and it creeps.
  info.m_warmstartingFactor = 1;
  info.m_splitImpulse = 1;  // penetration is mended without giving velocity
  info.m_splitImpulsePenetrationThreshold = -kDeepPenetration;
  info.m_erp2 = kPenetrationRecovery;
  info.m_linearSlop = resting_depth;
  // With two directions friction is a box in velocity space, 20 % and 45 degrees wrong at any step;
  // with one, Bullet takes the direction of slip.
  info.m_solverMode &= ~SOLVER_USE_2_FRICTION_DIRECTIONS;
  getDispatchInfo().m_allowedCcdPenetration = 1e-5;
  for (const MovingBody& body : bodies.moving) {
    gravity_ = std::max(gravity_, body.gravity);
    if (!parts.fast_bodies) body.rigid->setCcdMotionThreshold(0);
  }
  for (const auto& rigid : bodies.rigid_bodies) addRigidBody(rigid.get());
  jointed_ = std::make_unique<BulletJoints>(scene, bodies, *this);
}

GroupedWorld::~GroupedWorld() {
  jointed_.reset();
  releasePredictiveContacts();
  for (const auto& rigid : bodies_.rigid_bodies) removeRigidBody(rigid.get());
}

void GroupedWorld::FindStepped(const Group& group) {
  stepped_.clear();
  rigids_.clear();
  for (const std::size_t place : group.members) {
    if (sleepers_.Sleeps(place)) continue;
    stepped_.push_back(place);
    rigids_.push_back(bodies_.moving[place].rigid);
  }
}

// Only where something moves farther than half its inner radius: contacts where it will hit, ahead of
// the contact routines, and the end of its way there.
void GroupedWorld::SweepFastBodies(const Group& group, double step_s) {
  releasePredictiveContacts();
  const bool fast = std::any_of(rigids_.begin(), rigids_.end(), [=](const btRigidBody* rigid) {
    return rigid->getLinearVelocity().length2() * step_s * step_s >
           rigid->getCcdSquareMotionThreshold();
  });
  if (!fast) return;
  for (btRigidBody* rigid : rigids_) {
    btVector3 low, high;
    rigid->getAabb(low, high);
    getBroadphase()->setAabb(rigid->getBroadphaseHandle(), low, high, getDispatcher());
  }
  createPredictiveContactsInternal(rigids_.data(), static_cast<int>(rigids_.size()), step_s);
  for (int i = 0; i < m_predictiveManifolds.size(); ++i) {
    const btPersistentManifold& manifold = *m_predictiveManifolds[i];
    for (const btCollisionObject* object : {manifold.getBody0(), manifold.getBody1()}) {
      const int place = object->getUserIndex();
      if (place >= 0) sleepers_.Wake(static_cast<std::size_t>(place));
    }
  }
  FindStepped(group);
}

// Whether the gap may close in this substep, with half of the speed to spare.
bool GroupedWorld::WillTouch(const ContactPair& pair, double step_s) const {
  const auto speed = [&](const btRigidBody& rigid, const btVector3& point) -> btVector3 {
    if (rigid.getUserIndex() < 0) return btVector3(0, 0, 0);
    if (sleepers_.Sleeps(static_cast<std::size_t>(rigid.getUserIndex()))) {
      return btVector3(0, 0, 0);
    }
    return rigid.getVelocityInLocalPoint(point - rigid.getCenterOfMassPosition()) +
           step_s * rigid.getGravity();
  };
  for (const btPersistentManifold* manifold : pair.manifolds) {
    const auto& first = *static_cast<const btRigidBody*>(manifold->getBody0());
    const auto& second = *static_cast<const btRigidBody*>(manifold->getBody1());
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
      const btManifoldPoint& point = manifold->getContactPoint(i);
      const double closing = point.m_normalWorldOnB.dot(speed(second, point.getPositionWorldOnB()) -
                                                        speed(first, point.getPositionWorldOnA()));
      if (point.getDistance() < kTouching / 2 + 2 * std::max(closing, 0.0) * step_s) return true;
    }
  }
  return false;
}

void GroupedWorld::FindContacts(const Group& group, double step_s) {
  const auto sleeps = [this](int place) {
    return place >= 0 && sleepers_.Sleeps(static_cast<std::size_t>(place));
  };
  const auto awake = [this](int place) {
    return place >= 0 && !sleepers_.Sleeps(static_cast<std::size_t>(place));
  };
  ++substep_;
  // Who wakes may touch the next.
  for (bool woken = true; woken;) {
    woken = false;
    for (ContactPair* pair : group.pairs) {
      const int first = pair->first_moving();
      const int second = pair->second_moving();
      if (pair->asked == substep_ || !(awake(first) || awake(second))) continue;
      pair->asked = substep_;
      pairs_.Ask(*pair);
      const int sleeper = sleeps(first) ? first : sleeps(second) ? second : -1;
      if (sleeper < 0 || !WillTouch(*pair, step_s)) continue;
      sleepers_.Wake(static_cast<std::size_t>(sleeper));
      woken = true;
    }
  }
  FindStepped(group);
  manifolds_.clear();
  for (const ContactPair* pair : group.pairs) {
    if (pair->asked != substep_ || sleeps(pair->first_moving()) || sleeps(pair->second_moving())) {
      continue;
    }
    manifolds_.insert(manifolds_.end(), pair->manifolds.begin(), pair->manifolds.end());
  }
  for (int i = 0; i < m_predictiveManifolds.size(); ++i) {
    manifolds_.push_back(m_predictiveManifolds[i]);
  }
}

// The solver starts from the last substep's impulses, which were of forces that lasted as long as it did.
// Never from more: what a blow gave is no load, and does not grow with the substep.
void GroupedWorld::ScaleImpulses(double step_s) {
  for (btPersistentManifold* manifold : manifolds_) {
    const int first = manifold->getBody0()->getUserIndex();
    const int place = first >= 0 ? first : manifold->getBody1()->getUserIndex();
    const double last_step_s = bodies_.moving[static_cast<std::size_t>(place)].last_step_s;
    if (last_step_s <= step_s) continue;
    const double scale = step_s / last_step_s;
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
      btManifoldPoint& point = manifold->getContactPoint(i);
      point.m_appliedImpulse *= scale;
      point.m_appliedImpulseLateral1 *= scale;
      point.m_appliedImpulseLateral2 *= scale;
    }
  }
}

void GroupedWorld::BlowAir(double step_s) {
  for (const std::size_t place : stepped_) {
    const MovingBody& body = bodies_.moving[place];
    if (!body.air.acts()) continue;
    BodyState state{.pose = {.orientation = body.orientation},
                    .velocity = body.velocity,
                    .angular_velocity = body.angular_velocity};
    body.air.Act(body.inertia, step_s, state);
    body.rigid->setLinearVelocity(ToBullet(state.velocity));
    body.rigid->setAngularVelocity(ToBullet(state.angular_velocity));
  }
}

void GroupedWorld::Solve(const Group& group, double step_s) {
  joints_.clear();
  for (btTypedConstraint* joint : group.joints) {
    const int place =
        std::max(joint->getRigidBodyA().getUserIndex(), joint->getRigidBodyB().getUserIndex());
    // Who is joined sleeps and wakes together.
    if (joint->isEnabled() && !sleepers_.Sleeps(static_cast<std::size_t>(place))) {
      joints_.push_back(joint);
    }
  }
  if (manifolds_.empty() && joints_.empty()) {
    for (btRigidBody* rigid : rigids_) {
      rigid->setLinearVelocity(rigid->getLinearVelocity() + step_s * rigid->getGravity());
    }
    return;
  }
  for (btRigidBody* rigid : rigids_) rigid->applyGravity();
  std::vector<btCollisionObject*> objects(rigids_.begin(), rigids_.end());
  btContactSolverInfo& info = getSolverInfo();
  info.m_timeStep = step_s;
  getConstraintSolver()->solveGroup(objects.data(), static_cast<int>(objects.size()),
                                    manifolds_.data(), static_cast<int>(manifolds_.size()),
                                    joints_.data(), static_cast<int>(joints_.size()), info, nullptr,
                                    getDispatcher());
  for (btRigidBody* rigid : rigids_) rigid->clearForces();
}

void GroupedWorld::Step(const Group& group, double step_s, int sweeps) {
  getSolverInfo().m_numIterations = sweeps;
  FindStepped(group);
  if (parts_.fast_bodies) SweepFastBodies(group, step_s);
  FindContacts(group, step_s);
  ScaleImpulses(step_s);
  BeginSubstep(bodies_.moving, stepped_);
  if (parts_.drag) BlowAir(step_s);
  jointed_->BeginSubstep(manifolds_, stepped_, step_s);
  Solve(group, step_s);
  integrateTransformsInternal(rigids_.data(), static_cast<int>(rigids_.size()), step_s);
  EndSubstep(manifolds_, bodies_.moving, stepped_, step_s, parts_.rotation);
  jointed_->EndSubstep(manifolds_, step_s);
  if (parts_.rebound && Rebound(manifolds_, bodies_, gravity_, step_s)) {
    for (const std::size_t place : stepped_) jointed_->Settle(place);
  }
  for (const std::size_t place : stepped_) {
    MovingBody& body = bodies_.moving[place];
    body.last_step_s = step_s;
    body.last_velocity = FromBullet(body.rigid->getLinearVelocity());
  }
}

}  // namespace rikiseki::world
