#include "world_server/features/planes.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "common/body_step.h"
#include "world_server/features/nearest_point.h"

namespace rikiseki::world {
namespace {

// Farther, and faster, nothing is computed: squares stay finite.
constexpr double kFarthest = 1e9;  // m, m/s

bool Usable(const Vec3& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() <= kFarthest;
}

// 1/M_eff of the body at a point along a direction; 0 = it cannot move.
double Mobility(const SceneBody& body, const BodyState& state, const Vec3& point,
                const Vec3& direction) {
  if (body.fixed) return 0;
  return InverseEffectiveMass(BodyInertia::Of(body.mass_kg, body.inertia), state.pose, point,
                              direction);
}

struct Candidate {
  double gap = 0;  // m, from the finger sphere's surface
  protocol::Plane plane;

  auto Order() const { return std::tuple(gap, plane.pointer, plane.body, plane.feature); }
};

}  // namespace

std::vector<Finger> FingersOf(const protocol::HapticTick& tick, double friction) {
  std::vector<Finger> fingers;
  const std::size_t count = std::min(tick.pointer_count, protocol::kMaxPointers);
  for (const protocol::Pointer& pointer : std::span(tick.pointers).first(count)) {
    const Finger finger{.pointer = pointer.pointer,
                        .radius_m = pointer.radius,
                        .position = ToVec3(pointer.position),
                        .velocity = ToVec3(pointer.velocity),
                        .friction = friction};
    const bool sound = finger.pointer < protocol::kMaxPointers && finger.radius_m >= 0 &&
                       finger.radius_m <= kLargestFinger && Usable(finger.position) &&
                       Usable(finger.velocity);
    const bool known = std::any_of(fingers.begin(), fingers.end(), [&](const Finger& other) {
      return other.pointer == finger.pointer;
    });
    if (sound && !known) fingers.push_back(finger);
  }
  return fingers;
}

std::uint32_t FindPlanes(const Scene& scene, std::span<const BodyState> states,
                         std::span<const std::uint32_t> generations,
                         std::span<const Finger> fingers, const FeatureReach& reach,
                         std::span<protocol::Plane> planes) {
  std::vector<Candidate> candidates;
  for (const Finger& finger : fingers) {
    for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
      const BodyState& state = states[body];
      for (std::size_t feature = 0; feature < scene.bodies[body].colliders.size(); ++feature) {
        const Collider& collider = scene.bodies[body].colliders[feature];
        const Pose pose_WS = state.pose * collider.pose_BS;
        const NearestPoint nearest =
            FindNearestPoint(collider.shape, pose_WS.Inverse() * finger.position);
        const Vec3 point = pose_WS * nearest.point;
        const Vec3 surface_velocity =
            state.velocity + state.angular_velocity.cross(point - state.pose.position);
        const double speed = (finger.velocity - surface_velocity).norm();
        const double gap = nearest.distance - finger.radius_m;
        if (!(gap <= reach.radius_m + 2 * reach.period_s * speed) || !point.allFinite()) continue;

        Candidate& found = candidates.emplace_back();
        found.gap = gap;
        found.plane = {.pointer = finger.pointer,
                       .body = static_cast<std::uint32_t>(body),
                       .generation = generations[body],
                       .feature = static_cast<std::uint32_t>(feature),
                       .point = ToArray(point),
                       .normal = ToArray(Vec3(pose_WS.orientation * nearest.normal)),
                       .stiffness = collider.stiffness_n_per_m.value_or(0),
                       .damping = collider.damping_ns_per_m.value_or(0),
                       .velocity = ToArray(surface_velocity),
                       .recovery_s = collider.recovery_s,
                       .inverse_mass = Mobility(scene.bodies[body], state, point,
                                                pose_WS.orientation * nearest.normal)};
        if (const auto* ball = std::get_if<Sphere>(&collider.shape)) {
          found.plane.radius = ball->radius;
        }
        if (finger.friction > 0 && collider.friction > 0) {
          const double static_friction = collider.static_friction.value_or(collider.friction);
          found.plane.dynamic_friction = std::sqrt(finger.friction * collider.friction);
          found.plane.static_friction = std::sqrt(finger.friction * static_friction);
        }
      }
    }
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.Order() < b.Order(); });
  const std::size_t count = std::min(candidates.size(), planes.size());
  for (std::size_t i = 0; i < count; ++i) planes[i] = candidates[i].plane;
  return static_cast<std::uint32_t>(count);
}

}  // namespace rikiseki::world
