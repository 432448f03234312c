// SPDX-License-Identifier: MIT
#include "haptic_server/render/feature_track.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rikiseki::haptic {
namespace {

constexpr double kZeroNormal = 1e-12;
constexpr double kUnitRounding = 1e-12;
constexpr double kLargestStiffness = 1e8;  // N/m; damping alike
constexpr double kLargestFriction = 1e3;
constexpr double kLongestRecovery = 10;  // s
constexpr double kFaded = 1e-9;          // of a force: rounding of the steps to zero
constexpr std::int64_t kLongestFrameNs = 10'000'000'000;

// Denormal numbers mean nothing in metres and cost a slow path in the processor.
Vec3 WithoutDenormals(const Vec3& v) {
  return v.unaryExpr(
      [](double x) { return std::abs(x) < std::numeric_limits<double>::min() ? 0.0 : x; });
}

bool IsPlace(const Vec3& v) {
  return v.cwiseAbs().maxCoeff() <= kLargestCoordinate && v.allFinite();
}

bool IsSound(const protocol::Plane& plane) {
  const Vec3 normal = ToVec3(plane.normal);
  return IsPlace(ToVec3(plane.point)) && IsPlace(normal) && normal.norm() >= kZeroNormal &&
         plane.stiffness >= 0 && plane.stiffness <= kLargestStiffness && plane.damping >= 0 &&
         plane.damping <= kLargestStiffness && IsPlace(ToVec3(plane.velocity)) &&
         plane.static_friction >= 0 && plane.static_friction <= kLargestFriction &&
         plane.dynamic_friction >= 0 && plane.dynamic_friction <= kLargestFriction &&
         plane.recovery_s >= 0 && plane.recovery_s <= kLongestRecovery && plane.radius >= 0 &&
         plane.radius <= kLargestCoordinate;
}

// Unit normals pass bit for bit.
Vec3 Unit(const Vec3& normal) {
  const double length = normal.norm();
  return std::abs(length - 1) <= kUnitRounding ? normal : Vec3(normal / length);
}

double RecoveryTime(const protocol::Plane& plane) {
  return plane.recovery_s > 0 ? plane.recovery_s : kRecoveryTime;
}

bool SameFeature(const protocol::Plane& a, const protocol::Plane& b) {
  return a.pointer == b.pointer && a.body == b.body && a.generation == b.generation &&
         a.feature == b.feature;
}

// The plane that is tangent to a ball where a finger is; in its very centre, along `otherwise`.
HalfSpace TangentAt(const Vec3& centre, double radius, const Vec3& finger, const Vec3& otherwise) {
  const Vec3 from_centre = finger - centre;
  const double length = from_centre.stableNorm();
  const Vec3 normal = length > kZeroNormal ? Vec3(from_centre / length) : otherwise;
  return {centre + radius * normal, normal};
}

HalfSpace InWorld(const Pose& pose_WB, const HalfSpace& plane_B) {
  return {pose_WB * plane_B.point, pose_WB.orientation * plane_B.normal};
}

const protocol::LocalBody* FindLocal(const protocol::WorldFrame& frame,
                                     const protocol::Plane& plane) {
  const std::size_t count =
      std::min<std::size_t>(frame.local_body_count, protocol::kMaxLocalBodies);
  for (const protocol::LocalBody& local : std::span(frame.local_bodies).first(count)) {
    if (local.body == plane.body && local.generation == plane.generation) return &local;
  }
  return nullptr;
}

}  // namespace

FeatureTrack::FeatureTrack(DisplayRule rule, std::int64_t period_ns)
    : rule_(rule), period_ns_(period_ns) {
  fingers_.fill(Vec3::Zero());
}

void FeatureTrack::Advance(std::int64_t ticks) noexcept {
  // n is below 1e10/1e3; beyond n more ticks change nothing, so j need not run on.
  tick_ = std::min<std::int64_t>(tick_ + std::max<std::int64_t>(ticks, 0), 1'000'000'000);
  const double elapsed_s = static_cast<double>(ticks) * static_cast<double>(period_ns_) * 1e-9;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    Feature& feature = features_[i];
    const double step = elapsed_s / RecoveryTime(feature.identity);
    feature.recovery_left = std::max(0.0, feature.recovery_left - step);
    feature.strength = feature.leaving ? std::max(0.0, feature.strength - step)
                                       : std::min(1.0, feature.strength + step);
    if (feature.strength < kFaded) continue;
    if (kept != i) features_[kept] = feature;
    ++kept;
  }
  count_ = kept;
}

HalfSpace FeatureTrack::Interpolated(const Feature& feature) const noexcept {
  const double fraction = static_cast<double>(tick_) / ticks_per_frame_;
  const bool at_end = fraction >= 1;
  const double s = at_end ? 1 : fraction;
  if (rule_ == DisplayRule::kHold || (rule_ == DisplayRule::kInterpolate && at_end) ||
      (rule_ == DisplayRule::kExtrapolate && tick_ == 0)) {
    return {feature.last_point, feature.last_normal};
  }
  if (rule_ == DisplayRule::kInterpolate && tick_ == 0) {
    return {feature.previous_point, feature.previous_normal};
  }
  const bool extrapolate = rule_ == DisplayRule::kExtrapolate;
  const Vec3& base_point = extrapolate ? feature.last_point : feature.previous_point;
  const Vec3& base_normal = extrapolate ? feature.last_normal : feature.previous_normal;
  HalfSpace shown;
  shown.point = base_point + s * (feature.last_point - feature.previous_point);
  if (feature.last_normal == feature.previous_normal) {  // at rest, as without interpolation
    shown.normal = feature.last_normal;
    return shown;
  }
  shown.normal = base_normal + s * (feature.last_normal - feature.previous_normal);
  const double length = shown.normal.norm();
  // Opposite normals meet in zero half-way: the newer one is as good as any, and a unit vector.
  shown.normal = length > 1e-6 ? Vec3(shown.normal / length) : feature.last_normal;
  return shown;
}

// Of a surface's own stiffness or damping, which never goes beyond what a frame said. 0 is none of its
// own, and not a little.
double FeatureTrack::Interpolated(double previous, double last) const noexcept {
  if (rule_ != DisplayRule::kInterpolate || !(previous > 0) || !(last > 0)) return last;
  const double fraction = std::min(static_cast<double>(tick_) / ticks_per_frame_, 1.0);
  return fraction < 1 ? previous + fraction * (last - previous) : last;
}

HalfSpace FeatureTrack::Displayed(const Feature& feature) const noexcept {
  const HalfSpace shown = Interpolated(feature);
  return feature.rides ? InWorld(feature.pose_WB, shown) : shown;
}

HalfSpace FeatureTrack::DisplayedTo(const Feature& feature, const Vec3& finger) const noexcept {
  const HalfSpace shown = Displayed(feature);
  const double radius = feature.identity.radius;
  return radius > 0 ? TangentAt(shown.point, radius, finger, shown.normal) : shown;
}

bool FeatureTrack::IsPressed(const Feature& feature, const FingerState& finger) const noexcept {
  const HalfSpace plane = DisplayedTo(feature, finger.position);
  return plane.normal.dot(plane.point - finger.position) + finger.radius >
         feature.recovery * feature.recovery_left;
}

void FeatureTrack::Receive(const protocol::WorldFrame& frame, std::span<const FingerState> fingers,
                           const LocalBodies& copies) noexcept {
  FollowCopies(copies);
  std::array<bool, protocol::kMaxPlanes> paired{};
  std::size_t count = 0;
  const std::size_t planes = std::min<std::size_t>(frame.plane_count, protocol::kMaxPlanes);
  for (std::size_t i = 0; i < planes; ++i) {
    const protocol::Plane& plane = frame.planes[i];
    if (plane.pointer >= fingers.size() || !IsSound(plane)) continue;
    Feature& feature = incoming_[count++];
    feature.identity = plane;
    feature.identity.velocity = ToArray(WithoutDenormals(ToVec3(plane.velocity)));
    feature.leaving = false;
    feature.last_point = WithoutDenormals(ToVec3(plane.point));
    feature.last_normal = WithoutDenormals(Unit(ToVec3(plane.normal)));
    const FingerState& finger = fingers[plane.pointer];
    if (plane.radius > 0) feature.last_point -= plane.radius * feature.last_normal;
    const protocol::LocalBody* local = FindLocal(frame, plane);
    const BodyState* copy = copies.Find(plane.body, plane.generation);
    feature.rides = local != nullptr && copy != nullptr;
    if (feature.rides) {
      feature.pose_WB = copy->pose;
      const Pose pose_BW = Pose{ToVec3(local->position), ToQuat(local->orientation)}.Inverse();
      const HalfSpace last = InWorld(pose_BW, {feature.last_point, feature.last_normal});
      feature.last_point = last.point;
      feature.last_normal = last.normal;
    }
    // Several planes of one identity pair in their order.
    std::size_t before = 0;
    while (before < count_ && (paired[before] || !SameFeature(features_[before].identity, plane))) {
      ++before;
    }
    if (before < count_) {
      paired[before] = true;
      const Feature& known = features_[before];
      HalfSpace now = rule_ == DisplayRule::kInterpolate
                          ? Interpolated(known)
                          : HalfSpace{known.last_point, known.last_normal};
      if (known.rides) now = InWorld(known.pose_WB, now);
      // Of another roundness: goes on from what is shown to the finger now, at its foot.
      if (known.identity.radius != plane.radius) {
        if (known.identity.radius > 0) {
          now = TangentAt(now.point, known.identity.radius, finger.position, now.normal);
        }
        if (plane.radius > 0) {
          const double height = now.normal.dot(finger.position - now.point);
          now.point = finger.position - (height + plane.radius) * now.normal;
        }
      }
      if (feature.rides) now = InWorld(feature.pose_WB.Inverse(), now);
      feature.previous_point = now.point;
      feature.previous_normal = now.normal;
      feature.previous_stiffness = Interpolated(known.previous_stiffness, known.identity.stiffness);
      feature.previous_damping = Interpolated(known.previous_damping, known.identity.damping);
      feature.recovery = known.recovery;
      feature.recovery_left = known.recovery_left;
      feature.strength = known.strength;
    } else {
      feature.previous_point = feature.last_point;
      feature.previous_normal = feature.last_normal;
      feature.previous_stiffness = plane.stiffness;
      feature.previous_damping = plane.damping;
      const HalfSpace last{feature.last_point, feature.last_normal};
      HalfSpace shown = feature.rides ? InWorld(feature.pose_WB, last) : last;
      if (plane.radius > 0) {
        shown = TangentAt(shown.point, plane.radius, finger.position, shown.normal);
      }
      const double depth = shown.normal.dot(shown.point - finger.position) + finger.radius;
      feature.recovery = depth > finger.allowed_depth ? depth - finger.allowed_depth : 0;
      feature.recovery_left = 1;
      feature.strength = 1;
    }
  }
  const auto arrivals = std::span(incoming_).first(count);
  for (std::size_t before = 0; before < count_ && count < incoming_.size(); ++before) {
    const Feature& known = features_[before];
    // Where a body's number got another meaning, the new body is there instead of the old.
    const bool replaced =
        std::any_of(arrivals.begin(), arrivals.end(), [&](const Feature& arrival) {
          return arrival.identity.body == known.identity.body &&
                 arrival.identity.generation != known.identity.generation;
        });
    if (paired[before] || replaced || known.identity.pointer >= fingers.size() ||
        !IsPressed(known, fingers[known.identity.pointer])) {
      continue;
    }
    const HalfSpace now = Interpolated(known);  // where it rides, it rides on
    Feature& feature = incoming_[count++];
    feature = known;
    feature.previous_point = feature.last_point = now.point;
    feature.previous_normal = feature.last_normal = now.normal;
    feature.previous_stiffness = feature.identity.stiffness =
        Interpolated(known.previous_stiffness, known.identity.stiffness);
    feature.previous_damping = feature.identity.damping =
        Interpolated(known.previous_damping, known.identity.damping);
    feature.leaving = true;
  }
  std::copy_n(incoming_.begin(), count, features_.begin());
  count_ = count;
  tick_ = 0;
  const std::int64_t frame_ns = static_cast<std::int64_t>(
      std::min<std::uint64_t>(frame.period_ns, std::uint64_t{kLongestFrameNs}));
  ticks_per_frame_ =
      std::max(static_cast<double>(frame_ns) / static_cast<double>(period_ns_), 1e-9);
}

void FeatureTrack::Clear() noexcept {
  count_ = 0;
  tick_ = 0;
}

void FeatureTrack::FollowCopies(const LocalBodies& copies) noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    Feature& feature = features_[i];
    if (!feature.rides) continue;
    const BodyState* copy = copies.Find(feature.identity.body, feature.identity.generation);
    if (copy != nullptr) feature.pose_WB = copy->pose;
  }
}

std::span<const Surface> FeatureTrack::Surfaces(const LocalBodies& copies) noexcept {
  FollowCopies(copies);
  for (std::size_t i = 0; i < count_; ++i) {
    const Feature& feature = features_[i];
    Surface& surface = surfaces_[i];
    surface.pointer = feature.identity.pointer;
    surface.body = feature.identity.body;
    surface.generation = feature.identity.generation;
    surface.feature = feature.identity.feature;
    surface.velocity = ToVec3(feature.identity.velocity);
    const bool is_rough =
        feature.identity.static_friction > 0 || feature.identity.dynamic_friction > 0;
    const BodyState* copy =
        feature.rides && is_rough ? copies.Find(surface.body, surface.generation) : nullptr;
    surface.stiffness = Interpolated(feature.previous_stiffness, feature.identity.stiffness);
    surface.damping = Interpolated(feature.previous_damping, feature.identity.damping);
    surface.static_friction = feature.identity.static_friction;
    surface.dynamic_friction = feature.identity.dynamic_friction;
    surface.strength = feature.strength;
    surface.fixed = feature.identity.inverse_mass == 0;
    surface.copied = feature.rides;
    surface.radius = feature.identity.radius;
    surface.plane = DisplayedTo(feature, fingers_[surface.pointer]);
    const double below = feature.recovery * feature.recovery_left;
    if (below > 0) surface.plane.point -= below * surface.plane.normal;
    if (copy != nullptr) surface.velocity = copy->VelocityAt(surface.plane.point);
  }
  return std::span(surfaces_).first(count_);
}

bool FeatureTrack::Has(std::uint32_t body, std::uint32_t generation,
                       std::uint32_t pointer) const noexcept {
  return std::any_of(features_.begin(), features_.begin() + static_cast<std::ptrdiff_t>(count_),
                     [=](const Feature& feature) {
                       return !feature.leaving && feature.identity.body == body &&
                              feature.identity.generation == generation &&
                              feature.identity.pointer == pointer;
                     });
}

}  // namespace rikiseki::haptic
