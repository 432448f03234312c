// SPDX-License-Identifier: MIT
// A world in which some bodies deform: the rigid ones as ever, on Bullet, and beside them every soft
// body by itself, held by the fixed bodies that it touches at the start. Rigid bodies that move and soft
// ones do not feel each other.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "world_server/physics/dynamics_world.h"
#include "world_server/physics/soft_surface.h"
#include "world_server/scene/scene.h"

namespace rikiseki::world {

/// The dynamics that a scene needs: BulletWorld, within a DeformableWorld if any body is soft. Throws
/// std::invalid_argument on what cannot be simulated.
std::unique_ptr<DynamicsWorld> MakeDynamics(const Scene& scene, double longest_substep_s);

class DeformableWorld final : public DynamicsWorld {
 public:
  /// Soft bodies take steps of this length: shorter ones would change nothing of what is felt, which is
  /// the body at rest, and cost more.
  static constexpr double kStepS = 1.0 / 60;

  DeformableWorld(const Scene& scene, double longest_substep_s);
  ~DeformableWorld() override;

  std::size_t body_count() const override;

  /// Of a soft body the frame that its shape was meshed in, at rest: what holds it does not move.
  BodyState State(std::size_t body) const override;

  /// A soft body is left as it is.
  void SetState(std::size_t body, const BodyState& state) override;

  /// The push of a soft body enters as a steady force over the time for which it stands, at the latest
  /// kStepS later.
  void ApplyAndStep(std::span<const Kick> kicks, double period_s) override;

  void Play(std::span<const Stretch> stretches) override;

  bool FindContacts(std::size_t body, double reach_m,
                    std::vector<ContactSite>& sites) const override;
  const SoftSurface* FindSoft(std::size_t body) const override;

 private:
  struct Soft;

  std::unique_ptr<DynamicsWorld> rigid_;  // with nothing where the soft bodies are
  std::vector<std::unique_ptr<Soft>> soft_;
  std::vector<Soft*> soft_of_body_;  // null of rigid ones
  std::vector<Kick> rigid_kicks_;
  std::vector<PlacedImpulse> rigid_pushes_;
  std::vector<Stretch> rigid_stretches_;
};

}  // namespace rikiseki::world
