// SPDX-License-Identifier: MIT
#include "world_server/physics/bullet_bodies.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "world_server/physics/bullet_math.h"
#include "world_server/physics/bullet_shapes.h"
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

double MovingBody::Speed() const {
  return rigid->getLinearVelocity().length() + outer_radius * rigid->getAngularVelocity().length();
}

BodyState MovingBody::State() const {
  return {.pose = FromBullet(rigid->getWorldTransform()) * Pose{.orientation = q_BP.conjugate()},
          .velocity = FromBullet(rigid->getLinearVelocity()),
          .angular_velocity = FromBullet(rigid->getAngularVelocity())};
}

void MovingBody::SetState(const BodyState& state) {
  const btTransform pose = ToBullet(state.pose * Pose{.orientation = q_BP});
  rigid->setWorldTransform(pose);
  rigid->setInterpolationWorldTransform(pose);
  rigid->setLinearVelocity(ToBullet(state.velocity));
  rigid->setAngularVelocity(ToBullet(state.angular_velocity));
  rigid->updateInertiaTensor();
}

BulletBodies::BulletBodies(const Scene& scene) {
  smallest = std::numeric_limits<double>::infinity();
  for (const SceneBody& body : scene.bodies) {
    body.fixed ? AddFixed(body)
               : AddMoving(body, scene.gravity, IsJointed(scene, moving_of.size()));
  }
  if (!std::isfinite(smallest)) smallest = 1;  // nothing that moves has a shape
}

void BulletBodies::AddFixed(const SceneBody& body) {
  // One object for each shape: a half-space cannot be part of a compound, and each keeps its
  // friction.
  for (const Collider& collider : body.colliders) {
    shapes_.push_back(MakeBulletShape(collider.shape));
    Add(0, Vec3::Zero(), shapes_.back().get(), collider, body.pose_WB * collider.pose_BS);
  }
  moving_of.push_back(kFixed);
}

void BulletBodies::AddMoving(const SceneBody& body, const Vec3& gravity, bool jointed) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument("body " + body.name + ": " + why);
  };
  const PrincipalInertia inertia = Diagonalize(body.inertia);
  if (!(body.mass_kg > 0)) refuse("a moving body needs a mass");
  if (!(inertia.moments.minCoeff() > 0)) refuse("a moving body needs a positive inertia");
  if (body.colliders.empty() && !jointed) refuse("a moving body needs a shape, or a joint");

  MovingBody made;
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
    const Ball outer = OuterBall(collider.shape);
    smallest = std::min(smallest, 2 * outer.radius);
    made.inner_radius = std::max(made.inner_radius, InnerRadius(collider.shape));
    made.outer_radius =
        std::max(made.outer_radius, (collider.pose_BS * outer.centre).norm() + outer.radius);
    shapes_.push_back(MakeBulletShape(collider.shape));
    compound->addChildShape(ToBullet(pose_PB * collider.pose_BS), shapes_.back().get());
  }
  btCollisionShape* shape = body.colliders.empty() ? nullptr : shapes_.back().get();
  if (body.colliders.size() != 1 ||
      !(compound->getChildTransform(0) == btTransform::getIdentity())) {
    shape = compound.get();
    shapes_.push_back(std::move(compound));
  }

  const Pose pose_WP = body.pose_WB * Pose{.orientation = inertia.orientation};
  const Collider surface = body.colliders.empty() ? Collider{} : body.colliders.front();
  btRigidBody* rigid = Add(body.mass_kg, inertia.moments, shape, surface, pose_WP);
  rigid->setCcdMotionThreshold(made.inner_radius / 2);
  rigid->setCcdSweptSphereRadius(made.inner_radius / 2);
  // Ours: the hook turns the body, gyroscopic torque included, and gravity is the scene's.
  rigid->setFlags(BT_DISABLE_WORLD_GRAVITY);
  rigid->setGravity(ToBullet(body.falls ? gravity : Vec3(Vec3::Zero())));
  rigid->setUserIndex(static_cast<int>(moving.size()));
  made.rigid = rigid;
  made.jointed = jointed;
  made.inertia = BodyInertia::Of(body.mass_kg, Mat3(inertia.moments.asDiagonal()));
  made.q_BP = inertia.orientation;
  made.air = AirDrag::On(body);
  made.gravity = body.falls ? gravity.norm() : 0;
  moving_of.push_back(moving.size());
  moving.push_back(made);
}

btRigidBody* BulletBodies::Add(double mass, const Vec3& moments, btCollisionShape* shape,
                               const Collider& surface, const Pose& pose) {
  btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape, ToBullet(moments));
  info.m_friction = std::sqrt(surface.friction);  // Bullet multiplies the two
  info.m_startWorldTransform = ToBullet(pose);
  rigid_bodies.push_back(std::make_unique<btRigidBody>(info));
  btRigidBody* rigid = rigid_bodies.back().get();
  rigid->setUserIndex(-1);
  rigid->setUserIndex2(static_cast<int>(moving_of.size()));
  rigid->setUserIndex3(static_cast<int>(restitutions.size()));
  restitutions.push_back(surface.restitution);
  return rigid;
}

void ApplyKick(const MovingBody& body, const Vec3& impulse, const Vec3& angular_impulse) {
  btRigidBody& rigid = *body.rigid;
  BodyState state{.pose = {.orientation = FromBullet(rigid.getWorldTransform().getRotation())},
                  .velocity = FromBullet(rigid.getLinearVelocity()),
                  .angular_velocity = FromBullet(rigid.getAngularVelocity())};
  ApplyImpulse(body.inertia, impulse, angular_impulse, state);
  rigid.setLinearVelocity(ToBullet(state.velocity));
  rigid.setAngularVelocity(ToBullet(state.angular_velocity));
}

}  // namespace rikiseki::world
