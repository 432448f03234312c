// SPDX-License-Identifier: MIT
#include "world_server/coupling/kick.h"

#include <algorithm>
#include <cmath>

#include "world_server/features/nearest_point.h"
#include "world_server/physics/soft_surface.h"

namespace rikiseki::world {
namespace {

// Beyond this a wall is stable on no device that this project drives.
constexpr double kLargestStiffness = 1e6;  // N/m

struct Overlap {
  double depth = 0;              // m
  Vec3 normal = Vec3::UnitZ();   // out of the body, in W
  double stiffness_n_per_m = 0;  // of the surface
};

Overlap DeepestOverlap(const SceneBody& body, const Pose& pose_WB, const Finger& finger,
                       double common_stiffness) {
  Overlap deepest;
  for (const Collider& collider : body.colliders) {
    const Pose pose_WS = pose_WB * collider.pose_BS;
    const NearestPoint nearest =
        FindNearestPoint(collider.shape, pose_WS.Inverse() * finger.position);
    const double depth = finger.radius_m - nearest.distance;
    if (!(depth > deepest.depth)) continue;
    deepest = {.depth = depth,
               .normal = pose_WS.orientation * nearest.normal,
               .stiffness_n_per_m = collider.stiffness_n_per_m.value_or(common_stiffness)};
  }
  return deepest;
}

Overlap SoftOverlap(const SoftSurface& soft, const Collider& collider, const Pose& pose_WB,
                    const Finger& finger, double common_stiffness) {
  const Vec3 finger_B = pose_WB.Inverse() * finger.position;
  const NearestPoint nearest =
      FindNearestPoint(soft.unloaded(), soft.WithoutDisplacement(finger_B));
  const double depth = finger.radius_m - nearest.normal.dot(finger_B - nearest.point);
  const double own = collider.stiffness_n_per_m.value_or(common_stiffness);
  if (!(depth > 0) || !(own > 0)) return {};
  const SoftSurface::Spring felt = SoftSurface::InSeries(
      {.stiffness_n_per_m = own}, soft.YieldAt(nearest.point, nearest.normal));
  return {.depth = depth,
          .normal = pose_WB.orientation * nearest.normal,
          .stiffness_n_per_m = felt.stiffness_n_per_m};
}

}  // namespace

std::vector<Kick> ImpulseKicks(std::span<const OwedPush> owed, std::span<const BodyState> states) {
  std::vector<Kick> kicks;
  for (const OwedPush& owes : owed) {
    kicks.push_back(KickOf(owes.push, states[owes.push.body].pose.position));
  }
  return kicks;
}

std::vector<Kick> PenaltyKicks(const Scene& scene, std::span<const BodyState> states,
                               std::span<const Finger> fingers, const PenaltyLaw& law,
                               const DynamicsWorld* dynamics) {
  std::vector<Kick> kicks;
  for (const Finger& finger : fingers) {
    for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
      if (scene.bodies[body].fixed) continue;
      const Pose& pose_WB = states[body].pose;
      const SoftSurface* soft = dynamics != nullptr ? dynamics->FindSoft(body) : nullptr;
      const Overlap overlap = soft != nullptr ? SoftOverlap(*soft, scene.bodies[body].colliders[0],
                                                            pose_WB, finger, law.stiffness_n_per_m)
                                              : DeepestOverlap(scene.bodies[body], pose_WB, finger,
                                                               law.stiffness_n_per_m);
      if (!(overlap.depth > 0) || !(overlap.stiffness_n_per_m > 0)) continue;
      const double stiffness = std::min(overlap.stiffness_n_per_m, kLargestStiffness);
      const double impulse =
          std::min(stiffness * overlap.depth * law.period_s, law.largest_impulse_ns);
      const Vec3 contact = finger.position - finger.radius_m * overlap.normal;
      const Vec3 kick = -impulse * overlap.normal;
      kicks.push_back({.body = body,
                       .impulse = kick,
                       .angular_impulse = (contact - pose_WB.position).cross(kick)});
    }
  }
  return kicks;
}

}  // namespace rikiseki::world
