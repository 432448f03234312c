#include "world_server/physics/bullet_world.h"

#include <btBulletDynamicsCommon.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "world_server/physics/box_plane_contact.h"
#include "world_server/physics/bullet_math.h"
#include "world_server/physics/bullet_shapes.h"

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

bool Isotropic(const Vec3& moments) {
  return moments.maxCoeff() - moments.minCoeff() <= 1e-12 * moments.maxCoeff();
}

}  // namespace

struct BulletWorld::Engine {
  struct Body {
    btRigidBody* rigid = nullptr;  // null for fixed bodies
    double mass = 0;
    PrincipalInertia inertia;
  };

  // Members are destroyed from the last to the first: the world before what it points to.
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  BoxPlaneContact box_plane_contact{dispatcher};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> rigid_bodies;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::vector<Body> bodies;  // in the scene's order

  explicit Engine(const Scene& scene);
  ~Engine() {
    for (const auto& rigid : rigid_bodies) world.removeRigidBody(rigid.get());
  }

  void AddFixed(const SceneBody& body);
  void AddMoving(const SceneBody& body);
  btRigidBody* Add(double mass, const Vec3& moments, btCollisionShape* shape, double friction,
                   const Pose& pose);
  void Apply(const Kick& kick);
  void Substep(double step_s);
  Pose BodyPose(const Body& body) const;
};

BulletWorld::Engine::Engine(const Scene& scene) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const SceneBody& body : scene.bodies) {
    if (body.fixed) continue;
    for (const Collider& collider : body.colliders) {
      smallest = std::min(smallest, 2 * OuterRadius(collider.shape));
    }
  }

  world.setGravity(ToBullet(scene.gravity));
  btContactSolverInfo& info = world.getSolverInfo();
  info.m_numIterations = 50;
  info.m_leastSquaresResidualThreshold = 0;  // always all iterations: no early end, same bits
  info.m_splitImpulse = 1;                   // penetration is mended without giving velocity
  info.m_splitImpulsePenetrationThreshold = -1e-4;
  info.m_erp2 = 0.2;
  info.m_linearSlop = 1e-4 * smallest;  // bodies rest this deep
  // With two directions friction is a box in velocity space, 20 % and 45 degrees wrong at any step;
  // with one, Bullet takes the direction of slip.
  info.m_solverMode &= ~SOLVER_USE_2_FRICTION_DIRECTIONS;
  world.getDispatchInfo().m_allowedCcdPenetration = 1e-5;

  for (const SceneBody& body : scene.bodies) {
    body.fixed ? AddFixed(body) : AddMoving(body);
  }
}

void BulletWorld::Engine::AddFixed(const SceneBody& body) {
  // One object for each shape: a half-space cannot be part of a compound, and each keeps its
  // friction.
  for (const Collider& collider : body.colliders) {
    shapes.push_back(MakeBulletShape(collider.shape));
    Add(0, Vec3::Zero(), shapes.back().get(), collider.friction, body.pose_WB * collider.pose_BS);
  }
  bodies.emplace_back();
}

void BulletWorld::Engine::AddMoving(const SceneBody& body) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument("body " + body.name + ": " + why);
  };
  const PrincipalInertia inertia = Diagonalize(body.inertia);
  if (!(body.mass_kg > 0)) refuse("a moving body needs a mass");
  if (!(inertia.moments.minCoeff() > 0)) refuse("a moving body needs a positive inertia");
  if (body.colliders.empty()) refuse("a moving body needs a shape");

  double inner = 0;
  auto compound = std::make_unique<btCompoundShape>();
  const Pose pose_PB = Pose{.orientation = inertia.orientation}.Inverse();
  for (const Collider& collider : body.colliders) {
    if (std::holds_alternative<HalfSpace>(collider.shape)) refuse("a half-space cannot move");
    if (collider.friction != body.colliders.front().friction) {
      refuse("all shapes of a moving body must have the same friction");
    }
    inner = std::max(inner, InnerRadius(collider.shape));
    shapes.push_back(MakeBulletShape(collider.shape));
    compound->addChildShape(ToBullet(pose_PB * collider.pose_BS), shapes.back().get());
  }
  btCollisionShape* shape = shapes.back().get();
  const btTransform& placed = compound->getChildTransform(0);
  if (body.colliders.size() > 1 || !(placed == btTransform::getIdentity())) {
    shape = compound.get();
    shapes.push_back(std::move(compound));
  }

  const Pose pose_WP = body.pose_WB * Pose{.orientation = inertia.orientation};
  btRigidBody* rigid =
      Add(body.mass_kg, inertia.moments, shape, body.colliders.front().friction, pose_WP);
  // The defaults (0.8 m/s, 1 rad/s) would put to sleep what a finger moves slowly.
  rigid->setSleepingThresholds(1e-5, 1e-4);
  rigid->setCcdMotionThreshold(inner / 2);
  rigid->setCcdSweptSphereRadius(inner / 2);
  if (Isotropic(inertia.moments)) rigid->setFlags(0);  // no gyroscopic torque to compute
  bodies.push_back({.rigid = rigid, .mass = body.mass_kg, .inertia = inertia});
}

btRigidBody* BulletWorld::Engine::Add(double mass, const Vec3& moments, btCollisionShape* shape,
                                      double friction, const Pose& pose) {
  btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape, ToBullet(moments));
  info.m_friction = std::sqrt(friction);  // Bullet multiplies the two
  info.m_startWorldTransform = ToBullet(pose);
  rigid_bodies.push_back(std::make_unique<btRigidBody>(info));
  world.addRigidBody(rigid_bodies.back().get());
  return rigid_bodies.back().get();
}

// Exactly J/m and R I^-1 R^T L, between substeps. Never as a force: Bullet's friction rows do not
// see the torque of forces.
void BulletWorld::Engine::Apply(const Kick& kick) {
  const Body& body = bodies[kick.body];
  if (body.rigid == nullptr) return;
  if (kick.impulse.isZero(0) && kick.angular_impulse.isZero(0)) return;
  const Quat q_WP = FromBullet(body.rigid->getWorldTransform().getRotation());
  const Vec3 dv = kick.impulse / body.mass;
  const Vec3 dw =
      q_WP * (q_WP.conjugate() * kick.angular_impulse).cwiseQuotient(body.inertia.moments);
  body.rigid->setLinearVelocity(body.rigid->getLinearVelocity() + ToBullet(dv));
  body.rigid->setAngularVelocity(body.rigid->getAngularVelocity() + ToBullet(dw));
  body.rigid->activate(true);
}

// The one place where the engine advances: corrections to Bullet's step belong before and after the
// call.
void BulletWorld::Engine::Substep(double step_s) {
  world.stepSimulation(step_s, 0);
}

Pose BulletWorld::Engine::BodyPose(const Body& body) const {
  const btTransform& pose = body.rigid->getWorldTransform();
  const Pose pose_WP{FromBullet(pose.getOrigin()), FromBullet(pose.getRotation()).normalized()};
  return pose_WP * Pose{.orientation = body.inertia.orientation.conjugate()};
}

BulletWorld::BulletWorld(const Scene& scene, double longest_substep_s)
    : longest_substep_s_(longest_substep_s) {
  if (!(longest_substep_s > 0)) throw std::invalid_argument("a substep must be longer than 0 s");
  bool moves = false;
  for (const SceneBody& body : scene.bodies) {
    fixed_.push_back({.pose = body.pose_WB});
    moves = moves || !body.fixed;
  }
  if (moves) engine_ = std::make_unique<Engine>(scene);
}

BulletWorld::~BulletWorld() = default;

std::size_t BulletWorld::body_count() const {
  return fixed_.size();
}

bool BulletWorld::simulates() const {
  return engine_ != nullptr;
}

BodyState BulletWorld::State(std::size_t body) const {
  if (!engine_ || engine_->bodies[body].rigid == nullptr) return fixed_[body];
  const Engine::Body& moving = engine_->bodies[body];
  return {.pose = engine_->BodyPose(moving),
          .velocity = FromBullet(moving.rigid->getLinearVelocity()),
          .angular_velocity = FromBullet(moving.rigid->getAngularVelocity())};
}

void BulletWorld::ApplyAndStep(std::span<const Kick> kicks, double period_s) {
  if (!engine_) return;
  for (const Kick& kick : kicks) engine_->Apply(kick);
  if (!(period_s > 0)) return;
  // 50 ms of 1 ms is 50 substeps, whatever the last bit of the quotient says.
  const double count = std::max(1.0, std::ceil(period_s / longest_substep_s_ - 1e-9));
  for (double done = 0; done < count; ++done) engine_->Substep(period_s / count);
}

}  // namespace rikiseki::world
