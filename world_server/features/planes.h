// SPDX-License-Identifier: MIT
// The planes that the haptic side renders: for every finger and every shape near it the tangent
// plane at the shape's nearest point - of a mesh at each near point - normal towards the finger.
// Paper 3.1. Of a soft body the plane that the finger does not move (soft_surface.h).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "protocol/messages.h"
#include "world_server/features/feature_track.h"
#include "world_server/features/near_bodies.h"
#include "world_server/physics/dynamics_world.h"
#include "world_server/physics/linkage.h"
#include "world_server/scene/scene.h"
#include "world_server/scene/scene_change.h"

namespace rikiseki::world {

/// How far shapes are sought: r_0 + 2 Tw |v_rel| from the finger sphere's surface, so that nothing
/// can be reached before the frame after next. numerics.md section 4.
struct FeatureReach {
  double radius_m = 0;  // r_0
  double period_s = 0;  // Tw
};

/// A finger that can be computed with: everything finite, the radius within 0..kLargestFinger.
struct Finger {
  std::uint32_t pointer = 0;
  double radius_m = 0;
  Vec3 position = Vec3::Zero();  // of the sphere's centre, in W
  Vec3 velocity = Vec3::Zero();  // m/s
  double friction = 0;           // Coulomb, dynamic; 0 = none
  double stiffness_n_per_m = 0;  // that it renders surfaces with which bring none of their own,
  double damping_ns_per_m = 0;   // and the damping
};

inline constexpr double kLargestFinger = 1.0;  // m

/// The usable fingers of a message, each pointer once, all with `friction`; what is not finite is
/// left out.
std::vector<Finger> FingersOf(const protocol::HapticTick& tick, double friction = 0);

/// What a plane's feature says: the place of its collider within the body, and which of that
/// collider's surfaces it is, from frame to frame.
inline std::uint32_t FeatureNumber(std::size_t collider, std::uint32_t slot) {
  return static_cast<std::uint32_t>(collider) | slot << 16;
}
static_assert(protocol::kMaxColliders <= 1 << 16 && FeatureTrack::kMaxSlots <= 1 << 16);

/// Finds the planes of one scene, frame after frame.
class PlaneFinder {
 public:
  /// `scene` outlives this, and so do the dynamics, which know the surfaces of its soft bodies.
  explicit PlaneFinder(const Scene& scene, const DynamicsWorld* dynamics = nullptr);

  /// Goes on with what `before` knows of the features of bodies that are the same.
  void Continue(const PlaneFinder& before, std::span<const BodyChange> changes);

  /// Fills `planes` nearest first, at most its length, and returns how many. Friction of finger and
  /// surface combines as sqrt(mu1 mu2), the static one with the finger's dynamic one likewise.
  /// `states` and `generations` go with the scene's bodies; what cannot move is where the scene says.
  std::uint32_t Find(std::span<const BodyState> states, std::span<const std::uint32_t> generations,
                     std::span<const Finger> fingers, const FeatureReach& reach,
                     std::span<protocol::Plane> planes);

 private:
  using TrackKey = std::array<std::size_t, 3>;  // pointer, body, collider

  double Mobility(std::span<const BodyState> states, std::size_t body, const Vec3& point,
                  const Vec3& normal) const;

  const Scene& scene_;
  const DynamicsWorld* dynamics_;
  NearBodies near_;
  std::vector<BodyInertia> inertias_;  // of the bodies that can move
  std::vector<Linkage> linkages_;
  std::map<std::size_t, std::array<std::size_t, 2>> linked_;  // bodies: linkage, place in it
  std::map<TrackKey, FeatureTrack> tracks_;                   // of the last frame
};

}  // namespace rikiseki::world
