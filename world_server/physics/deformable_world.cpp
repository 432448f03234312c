// SPDX-License-Identifier: MIT
#include "world_server/physics/deformable_world.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "world_server/physics/bullet_world.h"
#include "world_server/scene/soft_mesh.h"

namespace rikiseki::world {
namespace {

constexpr double kSameTime = 1e-9;  // relative

SoftBody MakeBody(const Scene& scene, const SceneBody& body) {
  SoftMesh meshed = MeshSoftBody(scene, body);
  const Softness& softness = *body.softness;
  const Vec3 gravity = body.falls ? scene.gravity : Vec3(Vec3::Zero());
  try {
    return {std::move(meshed.mesh),
            {.youngs_modulus_pa = softness.youngs_modulus_pa,
             .poisson_ratio = softness.poisson_ratio,
             .relaxation_s = softness.relaxation_s},
            body.mass_kg,
            std::move(meshed.held),
            body.pose_WB.orientation.conjugate() * gravity};
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument("body " + body.name + ": " + error.what());
  }
}

}  // namespace

struct DeformableWorld::Soft {
  Soft(const Scene& scene, const SceneBody& scene_body)
      : pose_WB(scene_body.pose_WB),
        body(MakeBody(scene, scene_body)),
        surface(body),
        pending(SoftBody::NodeVectors::Zero(3, body.positions().cols())) {}

  void Push(const Kick& kick);
  void Advance(double period_s);

  Pose pose_WB;
  SoftBody body;
  SoftSurface surface;
  SoftBody::NodeVectors pending;  // N s, of the nodes, over
  double pending_s = 0;           // the time that is not stepped yet
  bool asleep = true;
};

void DeformableWorld::Soft::Push(const Kick& kick) {
  if (kick.impulse.isZero(0) && kick.angular_impulse.isZero(0)) return;
  if (!kick.impulse.allFinite() || !kick.angular_impulse.allFinite()) return;
  const Quat to_body = pose_WB.orientation.conjugate();
  surface.Spread(to_body * kick.impulse, to_body * kick.angular_impulse, pending);
  asleep = false;
}

void DeformableWorld::Soft::Advance(double period_s) {
  if (asleep) return;
  pending_s += period_s;
  const double steps = std::floor(pending_s / kStepS + kSameTime);
  if (!(steps >= 1)) return;
  const double share = std::min(1.0, kStepS / pending_s);
  const SoftBody::NodeVectors each = share * pending;
  for (double done = 0; done < steps && !asleep; ++done) {
    const bool pushed = !each.isZero(0);
    if (pushed) body.Push(each);
    body.Step(kStepS);
    asleep = !pushed && body.AtRest();
  }
  pending -= steps * each;
  pending_s = std::max(0.0, pending_s - steps * kStepS);
  if (share == 1.0) pending.setZero();
  if (asleep) pending_s = 0;
}

std::unique_ptr<DynamicsWorld> MakeDynamics(const Scene& scene, double longest_substep_s) {
  if (Deforms(scene)) return std::make_unique<DeformableWorld>(scene, longest_substep_s);
  return std::make_unique<BulletWorld>(scene, longest_substep_s);
}

DeformableWorld::DeformableWorld(const Scene& scene, double longest_substep_s) {
  Scene rigid = scene;
  for (const SceneBody& body : scene.bodies) {
    soft_of_body_.push_back(nullptr);
    if (!body.softness) continue;
    soft_.push_back(std::make_unique<Soft>(scene, body));
    soft_of_body_.back() = soft_.back().get();
    SceneBody& left = rigid.bodies[soft_of_body_.size() - 1];
    left.fixed = true;
    left.colliders.clear();
    left.softness.reset();
  }
  rigid_ = std::make_unique<BulletWorld>(rigid, longest_substep_s);
}

DeformableWorld::~DeformableWorld() = default;

std::size_t DeformableWorld::body_count() const {
  return soft_of_body_.size();
}

BodyState DeformableWorld::State(std::size_t body) const {
  return rigid_->State(body);
}

void DeformableWorld::SetState(std::size_t body, const BodyState& state) {
  if (soft_of_body_[body] == nullptr) rigid_->SetState(body, state);
}

void DeformableWorld::ApplyAndStep(std::span<const Kick> kicks, double period_s) {
  rigid_kicks_.clear();
  for (const Kick& kick : kicks) {
    Soft* soft = soft_of_body_[kick.body];
    soft != nullptr ? soft->Push(kick) : rigid_kicks_.push_back(kick);
  }
  rigid_->ApplyAndStep(rigid_kicks_, period_s);
  for (const auto& soft : soft_) soft->Advance(period_s);
}

void DeformableWorld::Play(std::span<const Stretch> stretches) {
  std::size_t room = 0;
  for (const Stretch& stretch : stretches) room += stretch.pushes.size();
  rigid_pushes_.clear();
  rigid_pushes_.reserve(room);  // the stretches point into it
  rigid_stretches_.clear();
  for (const Stretch& stretch : stretches) {
    const std::size_t first = rigid_pushes_.size();
    for (const PlacedImpulse& push : stretch.pushes) {
      Soft* soft = soft_of_body_[push.body];
      if (soft == nullptr) {
        rigid_pushes_.push_back(push);
      } else {
        soft->Push(KickOf(push, soft->pose_WB.position));
      }
    }
    for (const auto& soft : soft_) soft->Advance(stretch.length_s);
    rigid_stretches_.push_back(
        {.length_s = stretch.length_s, .pushes = std::span(rigid_pushes_).subspan(first)});
  }
  rigid_->Play(rigid_stretches_);
}

bool DeformableWorld::FindContacts(std::size_t body, double reach_m,
                                   std::vector<ContactSite>& sites) const {
  return soft_of_body_[body] == nullptr && rigid_->FindContacts(body, reach_m, sites);
}

const SoftSurface* DeformableWorld::FindSoft(std::size_t body) const {
  return soft_of_body_[body] != nullptr ? &soft_of_body_[body]->surface : nullptr;
}

}  // namespace rikiseki::world
