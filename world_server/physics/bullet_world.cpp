#include "world_server/physics/bullet_world.h"

#include <btBulletDynamicsCommon.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "common/body_step.h"
#include "world_server/physics/air.h"
#include "world_server/physics/bullet_contacts.h"
#include "world_server/physics/bullet_hooks.h"
#include "world_server/physics/bullet_joints.h"
#include "world_server/physics/bullet_math.h"
#include "world_server/physics/bullet_rebound.h"
#include "world_server/physics/bullet_shapes.h"
#include "world_server/physics/contact_sites.h"
#include "world_server/physics/jointed_solver.h"
#include "world_server/scene/shape_size.h"

namespace rikiseki::world {
namespace {

// Principal moments, and the axes they are about: x_B = orientation * x_principal.
struct PrincipalInertia {
  Vec3 moments = Vec3::Zero();
  Quat orientation = Quat::Identity();
};

PrincipalInertia Diagonalize(const Mat3& inertia) {
  const double off_diagonal =
      std::max({std::abs(inertia(0, 1)), std::abs(inertia(0, 2)), std::abs(inertia(1, 2))});
  if (off_diagonal <= 1e-14 * inertia.diagonal().maxCoeff()) return {.moments = inertia.diagonal()};
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia);
  Mat3 axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(2) *= -1;
  return {.moments = solver.eigenvalues(), .orientation = Quat(axes).normalized()};
}

}  // namespace

struct BulletWorld::Engine {
  static constexpr std::size_t kFixed = static_cast<std::size_t>(-1);

  struct Body {
    std::size_t moving = kFixed;   // its place in `moving`
    Quat q_BP = Quat::Identity();  // principal axes in the body's frame
  };
  struct Drag {
    std::size_t moving = 0;
    AirDrag air;
  };

  // Members are destroyed from the last to the first: the world before what it points to.
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  std::vector<PairContact> contacts = ReplaceContacts(dispatcher);
  btDbvtBroadphase broadphase;
  JointedSolver solver;
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> rigid_bodies;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::vector<Body> bodies;  // in the scene's order
  std::vector<HookedBody> moving;
  std::unique_ptr<BulletJoints> joints;
  std::vector<Drag> drags;           // of the bodies on which the air acts
  std::vector<double> restitutions;  // of rigid_bodies
  bool bounces = false;              // whether any of them is above 0
  double resting_depth = 0;          // m, how deep bodies rest in each other

  explicit Engine(const Scene& scene);
  ~Engine() {
    for (const auto& rigid : rigid_bodies) world.removeRigidBody(rigid.get());
  }

  void AddFixed(const SceneBody& body);
  void AddMoving(const SceneBody& body, bool jointed);
  btRigidBody* Add(double mass, const Vec3& moments, btCollisionShape* shape,
                   const Collider& surface, const Pose& pose);
  void Apply(const Kick& kick);
  void Substep(double step_s);
  BodyState State(const Body& body) const;
  void AddImpulses(std::size_t body, std::span<const BodyState> states,
                   std::span<ContactSite> sites);
};

BulletWorld::Engine::Engine(const Scene& scene) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const SceneBody& body : scene.bodies) {
    if (body.fixed) continue;
    for (const Collider& collider : body.colliders) {
      smallest = std::min(smallest, 2 * OuterBall(collider.shape).radius);
    }
  }

  world.setGravity(ToBullet(scene.gravity));
  btContactSolverInfo& info = world.getSolverInfo();
  info.m_numIterations = 50;
  info.m_leastSquaresResidualThreshold = 0;  // always all iterations: no early end, same bits
  info.m_splitImpulse = 1;                   // penetration is mended without giving velocity
  info.m_splitImpulsePenetrationThreshold = -kDeepPenetration;
  info.m_erp2 = kPenetrationRecovery;
  resting_depth = 1e-4 * smallest;
  info.m_linearSlop = resting_depth;
  if (!scene.joints.empty()) info.m_minimumSolverBatchSize = 1;  // the solver tells islands apart
  // With two directions friction is a box in velocity space, 20 % and 45 degrees wrong at any step;
  // with one, Bullet takes the direction of slip.
  info.m_solverMode &= ~SOLVER_USE_2_FRICTION_DIRECTIONS;
  world.getDispatchInfo().m_allowedCcdPenetration = 1e-5;

  for (const SceneBody& body : scene.bodies) {
    body.fixed ? AddFixed(body) : AddMoving(body, IsJointed(scene, bodies.size()));
  }
  std::vector<BulletJoints::Place> places;
  for (const Body& body : bodies) {
    places.push_back({.hooked = body.moving == kFixed ? nullptr : &moving[body.moving],
                      .q_BP = body.q_BP});
  }
  joints = std::make_unique<BulletJoints>(scene, std::move(places), world);
}

void BulletWorld::Engine::AddFixed(const SceneBody& body) {
  // One object for each shape: a half-space cannot be part of a compound, and each keeps its
  // friction.
  for (const Collider& collider : body.colliders) {
    shapes.push_back(MakeBulletShape(collider.shape));
    Add(0, Vec3::Zero(), shapes.back().get(), collider, body.pose_WB * collider.pose_BS);
  }
  bodies.emplace_back();
}

void BulletWorld::Engine::AddMoving(const SceneBody& body, bool jointed) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument("body " + body.name + ": " + why);
  };
  const PrincipalInertia inertia = Diagonalize(body.inertia);
  if (!(body.mass_kg > 0)) refuse("a moving body needs a mass");
  if (!(inertia.moments.minCoeff() > 0)) refuse("a moving body needs a positive inertia");
  if (body.colliders.empty() && !jointed) refuse("a moving body needs a shape, or a joint");

  double inner = 0;
  auto compound = std::make_unique<btCompoundShape>();
  const Pose pose_PB = Pose{.orientation = inertia.orientation}.Inverse();
  for (const Collider& collider : body.colliders) {
    if (std::holds_alternative<HalfSpace>(collider.shape)) refuse("a half-space cannot move");
    if (std::holds_alternative<Mesh>(collider.shape)) refuse("a mesh that is no hull cannot move");
    if (collider.friction != body.colliders.front().friction) {
      refuse("all shapes of a moving body must have the same friction");
    }
    if (collider.restitution != body.colliders.front().restitution) {
      refuse("all shapes of a moving body must have the same restitution");
    }
    inner = std::max(inner, InnerRadius(collider.shape));
    shapes.push_back(MakeBulletShape(collider.shape));
    compound->addChildShape(ToBullet(pose_PB * collider.pose_BS), shapes.back().get());
  }
  btCollisionShape* shape = body.colliders.empty() ? nullptr : shapes.back().get();
  if (body.colliders.size() != 1 ||
      !(compound->getChildTransform(0) == btTransform::getIdentity())) {
    shape = compound.get();
    shapes.push_back(std::move(compound));
  }

  const Pose pose_WP = body.pose_WB * Pose{.orientation = inertia.orientation};
  const Collider surface = body.colliders.empty() ? Collider{} : body.colliders.front();
  btRigidBody* rigid = Add(body.mass_kg, inertia.moments, shape, surface, pose_WP);
  // The defaults (0.8 m/s, 1 rad/s) would put to sleep what a finger moves slowly.
  rigid->setSleepingThresholds(1e-5, 1e-4);
  rigid->setCcdMotionThreshold(inner / 2);
  rigid->setCcdSweptSphereRadius(inner / 2);
  rigid->setFlags(0);  // the hook turns the body, gyroscopic torque included
  rigid->setUserIndex(static_cast<int>(moving.size()));
  if (!body.falls) rigid->setGravity(btVector3(0, 0, 0));
  if (const AirDrag air = AirDrag::On(body); air.acts()) {
    drags.push_back({.moving = moving.size(), .air = air});
  }
  bodies.push_back({.moving = moving.size(), .q_BP = inertia.orientation});
  moving.push_back({.rigid = rigid,
                    .inertia = BodyInertia::Of(body.mass_kg, Mat3(inertia.moments.asDiagonal()))});
}

btRigidBody* BulletWorld::Engine::Add(double mass, const Vec3& moments, btCollisionShape* shape,
                                      const Collider& surface, const Pose& pose) {
  btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape, ToBullet(moments));
  info.m_friction = std::sqrt(surface.friction);  // Bullet multiplies the two
  info.m_startWorldTransform = ToBullet(pose);
  rigid_bodies.push_back(std::make_unique<btRigidBody>(info));
  btRigidBody* rigid = rigid_bodies.back().get();
  rigid->setUserIndex(-1);                                // its place among the moving ones
  rigid->setUserIndex2(static_cast<int>(bodies.size()));  // ... and in the scene
  rigid->setUserIndex3(static_cast<int>(restitutions.size()));
  restitutions.push_back(surface.restitution);
  bounces = bounces || surface.restitution > 0;
  world.addRigidBody(rigid);
  return rigid;
}

// Exactly J/m and R I^-1 R^T L, between substeps. Never as a force: Bullet's friction rows do not
// see the torque of forces.
void BulletWorld::Engine::Apply(const Kick& kick) {
  const Body& body = bodies[kick.body];
  if (body.moving == kFixed) return;
  if (kick.impulse.isZero(0) && kick.angular_impulse.isZero(0)) return;
  const HookedBody& hooked = moving[body.moving];
  btRigidBody& rigid = *hooked.rigid;
  BodyState state{.pose = {.orientation = FromBullet(rigid.getWorldTransform().getRotation())},
                  .velocity = FromBullet(rigid.getLinearVelocity()),
                  .angular_velocity = FromBullet(rigid.getAngularVelocity())};
  ApplyImpulse(hooked.inertia, kick.impulse, kick.angular_impulse, state);
  rigid.setLinearVelocity(ToBullet(state.velocity));
  rigid.setAngularVelocity(ToBullet(state.angular_velocity));
  rigid.activate(true);
}

// The one place where the engine advances.
void BulletWorld::Engine::Substep(double step_s) {
  DropStaleContacts(world, step_s);
  BeginSubstep(moving);
  for (const Drag& drag : drags) {
    const HookedBody& body = moving[drag.moving];
    if (!body.rigid->isActive() && drag.air.wind.isZero()) continue;
    BodyState state{.pose = {.orientation = body.orientation},
                    .velocity = body.velocity,
                    .angular_velocity = body.angular_velocity};
    drag.air.Act(body.inertia, step_s, state);
    body.rigid->setLinearVelocity(ToBullet(state.velocity));
    body.rigid->setAngularVelocity(ToBullet(state.angular_velocity));
    if (!drag.air.wind.isZero()) body.rigid->activate();
  }
  joints->BeginSubstep(step_s);
  world.stepSimulation(step_s, 0);
  EndSubstep(world, moving, step_s);
  joints->EndSubstep(step_s);
  if (bounces) {
    Rebound(world, moving, restitutions, step_s);
    joints->ProjectVelocities();
  }
}

BodyState BulletWorld::Engine::State(const Body& body) const {
  const btRigidBody& rigid = *moving[body.moving].rigid;
  const Pose pose_WP = FromBullet(rigid.getWorldTransform());
  return {.pose = pose_WP * Pose{.orientation = body.q_BP.conjugate()},
          .velocity = FromBullet(rigid.getLinearVelocity()),
          .angular_velocity = FromBullet(rigid.getAngularVelocity())};
}

// Adds what the solver gave in the last substep, each impulse to the nearest site of the same pair
// and direction.
void BulletWorld::Engine::AddImpulses(std::size_t body, std::span<const BodyState> states,
                                      std::span<ContactSite> sites) {
  const btRigidBody* rigid = moving[bodies[body].moving].rigid;
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(i);
    const bool is_first = manifold.getBody0() == rigid;
    if (!is_first && manifold.getBody1() != rigid) continue;
    const btCollisionObject* other = is_first ? manifold.getBody1() : manifold.getBody0();
    const auto other_body = static_cast<std::size_t>(other->getUserIndex2());
    for (int j = 0; j < manifold.getNumContacts(); ++j) {
      const btManifoldPoint& point = manifold.getContactPoint(j);
      if (!(point.m_appliedImpulse > 0)) continue;
      const double side = is_first ? 1 : -1;
      const Vec3 normal = side * FromBullet(point.m_normalWorldOnB);
      const Vec3 where =
          FromBullet(is_first ? point.getPositionWorldOnA() : point.getPositionWorldOnB());
      ContactSite* nearest = nullptr;
      double nearest_distance = std::numeric_limits<double>::infinity();
      for (ContactSite& site : sites) {
        if (site.other != other_body || site.normal.dot(normal) < 0.9) continue;
        const Vec3 place = states[body].pose * site.p_B - site.radius * site.normal;
        const double distance = (place - where).norm();
        if (distance >= nearest_distance) continue;
        nearest = &site;
        nearest_distance = distance;
      }
      if (nearest == nullptr) continue;
      nearest->impulse +=
          point.m_appliedImpulse * normal +
          side * point.m_appliedImpulseLateral1 * FromBullet(point.m_lateralFrictionDir1);
    }
  }
}

BulletWorld::BulletWorld(const Scene& scene, double longest_substep_s)
    : scene_(scene), longest_substep_s_(longest_substep_s) {
  if (!(longest_substep_s > 0)) throw std::invalid_argument("a substep must be longer than 0 s");
  bool moves = false;
  for (const SceneBody& body : scene.bodies) {
    states_.push_back({.pose = body.pose_WB});
    moves = moves || !body.fixed;
  }
  if (moves) engine_ = std::make_unique<Engine>(scene);
}

BulletWorld::~BulletWorld() = default;

std::size_t BulletWorld::body_count() const {
  return states_.size();
}

bool BulletWorld::simulates() const {
  return engine_ != nullptr;
}

BodyState BulletWorld::State(std::size_t body) const {
  return states_[body];
}

void BulletWorld::ApplyAndStep(std::span<const Kick> kicks, double period_s) {
  if (!engine_) return;
  for (const Kick& kick : kicks) engine_->Apply(kick);
  if (!kicks.empty()) engine_->joints->ProjectVelocities();
  if (period_s > 0) {
    const int count = SubstepCount(period_s, longest_substep_s_);
    for (int done = 0; done < count; ++done) engine_->Substep(period_s / count);
  }
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (engine_->bodies[i].moving != Engine::kFixed)
      states_[i] = engine_->State(engine_->bodies[i]);
  }
}

bool BulletWorld::FindContacts(std::size_t body, double reach_m,
                               std::vector<ContactSite>& sites) const {
  if (!engine_ || scene_.bodies[body].fixed || IsJointed(scene_, body)) return false;
  const std::size_t first = sites.size();
  if (!FindContactSites(scene_, states_, body, reach_m, sites)) return false;
  const std::span<ContactSite> found = std::span(sites).subspan(first);
  for (ContactSite& site : found) site.gap += engine_->resting_depth;
  engine_->AddImpulses(body, states_, found);
  return true;
}

}  // namespace rikiseki::world
