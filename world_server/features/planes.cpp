// SPDX-License-Identifier: MIT
#include "world_server/features/planes.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "common/body_step.h"
#include "world_server/features/curvature.h"
#include "world_server/physics/soft_surface.h"

namespace rikiseki::world {
namespace {

// Farther, and faster, nothing is computed: squares stay finite.
constexpr double kFarthest = 1e9;  // m, m/s

bool Usable(const Vec3& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() <= kFarthest;
}

// Slower along its surface [m/s] a finger stays.
constexpr double kStays = 1e-3;

// The finger's spring and damper, or those that the surface brings, before a body that yields.
void Soften(const SoftSurface& soft, const NearestPoint& nearest, const Finger& finger,
            protocol::Plane& plane) {
  const SoftSurface::Yield yield = soft.YieldAt(nearest.point, nearest.normal);
  const bool brings = plane.stiffness > 0;
  const SoftSurface::Spring felt = SoftSurface::InSeries(
      {.stiffness_n_per_m = brings ? plane.stiffness : finger.stiffness_n_per_m,
       .damping_ns_per_m = brings ? plane.damping : finger.damping_ns_per_m},
      yield);
  plane.stiffness = felt.stiffness_n_per_m;
  plane.damping = felt.damping_ns_per_m;
  plane.inverse_mass = yield.inverse_mass;
}

struct Candidate {
  double gap = 0;  // m, from the finger sphere's surface
  protocol::Plane plane;

  auto Order() const { return std::tuple(gap, plane.pointer, plane.body, plane.feature); }
};

}  // namespace

PlaneFinder::PlaneFinder(const Scene& scene, const DynamicsWorld* dynamics)
    : scene_(scene), dynamics_(dynamics), near_(scene), linkages_(Linkage::Of(scene)) {
  for (const SceneBody& body : scene.bodies) {
    inertias_.push_back(body.fixed ? BodyInertia() : BodyInertia::Of(body.mass_kg, body.inertia));
  }
  for (std::size_t i = 0; i < linkages_.size(); ++i) {
    const std::vector<std::size_t>& bodies = linkages_[i].bodies();
    for (std::size_t place = 0; place < bodies.size(); ++place) linked_[bodies[place]] = {i, place};
  }
}

// 1/M_eff of the body at a point against its normal, as its joints leave it; 0 = it cannot move.
double PlaneFinder::Mobility(std::span<const BodyState> states, std::size_t body, const Vec3& point,
                             const Vec3& normal) const {
  if (scene_.bodies[body].fixed) return 0;
  const auto linked = linked_.find(body);
  if (linked == linked_.end()) {
    return InverseEffectiveMass(inertias_[body], states[body].pose, point, normal);
  }
  const auto [linkage, place] = linked->second;
  std::vector<BodyState> members;
  for (const std::size_t member : linkages_[linkage].bodies()) members.push_back(states[member]);
  return linkages_[linkage].InverseEffectiveMass(members, place, point, normal);
}

std::vector<Finger> FingersOf(const protocol::HapticTick& tick, double friction) {
  std::vector<Finger> fingers;
  const std::size_t count = std::min(tick.pointer_count, protocol::kMaxPointers);
  for (const protocol::Pointer& pointer : std::span(tick.pointers).first(count)) {
    const Finger finger{.pointer = pointer.pointer,
                        .radius_m = pointer.radius,
                        .position = ToVec3(pointer.position),
                        .velocity = ToVec3(pointer.velocity),
                        .friction = friction,
                        .stiffness_n_per_m = tick.stiffness,
                        .damping_ns_per_m = tick.damping};
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

void PlaneFinder::Continue(const PlaneFinder& before, std::span<const BodyChange> changes) {
  std::map<std::size_t, std::size_t> now;  // by the place before
  for (std::size_t body = 0; body < changes.size(); ++body) {
    if (changes[body].same) now.emplace(*changes[body].before, body);
  }
  for (const auto& [key, track] : before.tracks_) {
    const auto [pointer, body, place] = key;
    const auto same = now.find(body);
    if (same != now.end()) tracks_.emplace(TrackKey{pointer, same->second, place}, track);
  }
}

std::uint32_t PlaneFinder::Find(std::span<const BodyState> states,
                                std::span<const std::uint32_t> generations,
                                std::span<const Finger> fingers, const FeatureReach& reach,
                                std::span<protocol::Plane> planes) {
  std::vector<Candidate> candidates;
  std::vector<std::size_t> bodies;
  std::vector<NearestPoint> features;
  std::map<TrackKey, FeatureTrack> tracks;
  const double time_s = 2 * reach.period_s;
  for (const Finger& finger : fingers) {
    // No farther than this from the sphere's centre, whatever turns out to move there.
    const double finger_reach = finger.radius_m + reach.radius_m + time_s * finger.velocity.norm();
    near_.Find(states, finger.position, finger_reach, time_s, bodies);
    for (const std::size_t body : bodies) {
      const SceneBody& scene_body = scene_.bodies[body];
      const BodyState& state = states[body];
      const SoftSurface* soft = dynamics_ != nullptr ? dynamics_->FindSoft(body) : nullptr;
      const double body_way = scene_body.fixed ? 0 : near_.WayOf(body, state, time_s);
      for (std::size_t place = 0; place < scene_body.colliders.size(); ++place) {
        const Collider& collider = scene_body.colliders[place];
        const Pose pose_WS = soft != nullptr ? state.pose : state.pose * collider.pose_BS;
        const Shape& shape = soft != nullptr ? soft->unloaded() : collider.shape;
        Vec3 finger_S = pose_WS.Inverse() * finger.position;
        if (soft != nullptr) finger_S = soft->WithoutDisplacement(finger_S);
        const TrackKey key = {finger.pointer, body, place};
        const auto known = tracks_.find(key);
        FeatureTrack track = known == tracks_.end() ? FeatureTrack() : std::move(known->second);
        track.Find(shape, finger_S, finger_reach + body_way, features);
        if (features.empty()) continue;
        const auto slots = track.Number(features, finger_reach + body_way);
        for (std::size_t i = 0; i < features.size(); ++i) {
          const Vec3 point = pose_WS * features[i].point;
          const Vec3 surface_velocity = state.VelocityAt(point);
          const Vec3 relative = finger.velocity - surface_velocity;
          const double speed = relative.norm();
          const double gap = features[i].distance - finger.radius_m;
          if (!(gap <= reach.radius_m + time_s * speed) || !point.allFinite()) continue;

          const Vec3 normal = pose_WS.orientation * features[i].normal;
          Candidate& found = candidates.emplace_back();
          found.gap = gap;
          found.plane = {.pointer = finger.pointer,
                         .body = static_cast<std::uint32_t>(body),
                         .generation = generations[body],
                         .feature = FeatureNumber(place, slots[i]),
                         .point = ToArray(point),
                         .normal = ToArray(normal),
                         .stiffness = collider.stiffness_n_per_m.value_or(0),
                         .damping = collider.damping_ns_per_m.value_or(0),
                         .velocity = ToArray(surface_velocity),
                         .recovery_s = collider.recovery_s,
                         .inverse_mass = Mobility(states, body, point, normal)};
          const Vec3 along = relative - relative.dot(normal) * normal;
          if (soft != nullptr) {
            Soften(*soft, features[i], finger, found.plane);
          } else {
            found.plane.radius =
                RadiusAlong(collider.shape, features[i],
                            along.norm() > kStays ? Vec3(pose_WS.orientation.conjugate() * along)
                                                  : Vec3(Vec3::Zero()));
          }
          if (finger.friction > 0 && collider.friction > 0) {
            const double static_friction = collider.static_friction.value_or(collider.friction);
            found.plane.dynamic_friction = std::sqrt(finger.friction * collider.friction);
            found.plane.static_friction = std::sqrt(finger.friction * static_friction);
          }
        }
        tracks.emplace(key, std::move(track));
      }
    }
  }
  tracks_ = std::move(tracks);
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.Order() < b.Order(); });
  const std::size_t count = std::min(candidates.size(), planes.size());
  for (std::size_t i = 0; i < count; ++i) planes[i] = candidates[i].plane;
  return static_cast<std::uint32_t>(count);
}

}  // namespace rikiseki::world
