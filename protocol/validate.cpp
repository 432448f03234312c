// SPDX-License-Identifier: MIT
#include "protocol/validate.h"

#include <cmath>

namespace rikiseki::protocol {
namespace {

bool Finite(double value) {
  return std::isfinite(value);
}
bool Finite(const Vector& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}
template <typename... Values>
bool AllFinite(const Values&... values) {
  return (Finite(values) && ...);
}

constexpr std::uint64_t kLongestPeriodNs = 10'000'000'000;  // SPEC.md 6: no loop is slower

constexpr double kLongestRecovery = 10;      // s, SPEC.md 6.2
constexpr double kLightestLocalBody = 1e-9;  // kg, likewise
constexpr double kHeaviestLocalBody = 1e9;

/// Symmetric and positive definite with room to spare: a reader may invert it.
bool IsInertia(const std::array<double, 6>& inertia) {
  const double trace = inertia[0] + inertia[3] + inertia[5];
  if (!(trace >= 1e-18 && trace <= 1e18)) return false;
  const auto& [xx, xy, xz, yy, yz, zz] = inertia;
  constexpr double kLeast = 1e-12;  // of the leading minors of inertia / trace
  const double a = xx / trace, b = xy / trace, c = xz / trace;
  const double d = yy / trace, e = yz / trace, f = zz / trace;
  return a > kLeast && a * d - b * b > kLeast &&
         a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d) > kLeast;
}

bool IsPeriod(std::uint64_t period_ns) {
  return period_ns >= 1 && period_ns <= kLongestPeriodNs;
}
bool IsReason(ForceReason reason) {
  return reason <= ForceReason::kClutched;
}
bool IsPeerState(PeerState state) {
  return state <= PeerState::kIncompatible;
}
bool IsCoupling(Coupling c) {
  return c >= Coupling::kPosition && c <= Coupling::kLocal;
}

// A direction that is of unit length as far as doubles can tell keeps its bits; another is
// renormalised.
constexpr double kUnitTolerance = 1e-14;

DecodeStatus Normalise(Quaternion& q) {
  const double norm = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
  if (!std::isfinite(norm)) return DecodeStatus::kNotFinite;
  if (norm < 0.99 || norm > 1.01) return DecodeStatus::kQuaternion;
  if (std::abs(norm - 1) > kUnitTolerance) {
    for (double& component : q) component /= norm;
  }
  return DecodeStatus::kOk;
}

DecodeStatus Normalise(Vector& normal) {
  const double norm = std::hypot(normal[0], normal[1], normal[2]);
  if (!std::isfinite(norm)) return DecodeStatus::kNotFinite;
  if (!(norm > 1e-12)) return DecodeStatus::kNormal;
  if (std::abs(norm - 1) > kUnitTolerance) {
    for (double& component : normal) component /= norm;
  }
  return DecodeStatus::kOk;
}

}  // namespace

const char* Describe(DecodeStatus status) noexcept {
  switch (status) {
    case DecodeStatus::kOk:
      return "the message is sound";
    case DecodeStatus::kLength:
      return "its length does not agree with its counts";
    case DecodeStatus::kCount:
      return "it counts more entries than there may be";
    case DecodeStatus::kEnumerator:
      return "an enumerator names nothing";
    case DecodeStatus::kIdentity:
      return "a pointer or local body does not exist or stands twice";
    case DecodeStatus::kNotFinite:
      return "a value is not finite";
    case DecodeStatus::kRange:
      return "a value is outside its range";
    case DecodeStatus::kQuaternion:
      return "an orientation is not a unit quaternion";
    case DecodeStatus::kNormal:
      return "a normal has no direction";
    case DecodeStatus::kStamp:
      return "its stamp lies in the future or before that of the message before";
  }
  return "unknown";
}

DecodeStatus Validate(HapticTick& m) noexcept {
  if (!AllFinite(m.stiffness, m.damping, m.force_cap)) return DecodeStatus::kNotFinite;
  if (m.stiffness < 0 || m.damping < 0 || m.force_cap < 0 || !IsPeriod(m.period_ns)) {
    return DecodeStatus::kRange;
  }
  std::uint32_t seen = 0;
  for (std::uint32_t i = 0; i < m.pointer_count; ++i) {
    Pointer& p = m.pointers[i];
    if (p.pointer >= kMaxPointers || (seen & 1u << p.pointer) != 0) return DecodeStatus::kIdentity;
    seen |= 1u << p.pointer;
    if (!IsReason(p.reason)) return DecodeStatus::kEnumerator;
    if (!AllFinite(p.radius, p.position, p.velocity, p.angular_velocity, p.force, p.torque)) {
      return DecodeStatus::kNotFinite;
    }
    if (p.radius < 0) return DecodeStatus::kRange;
    if (const auto status = Normalise(p.orientation); status != DecodeStatus::kOk) return status;
  }
  for (std::uint32_t i = 0; i < m.channel_count; ++i) {
    const Channel& c = m.channels[i];
    if (c.pointer >= kMaxPointers) return DecodeStatus::kIdentity;
    if (c.state != ChannelState::kOpen && c.state != ChannelState::kClosed) {
      return DecodeStatus::kEnumerator;
    }
    if (c.opened_tick > m.tick) return DecodeStatus::kRange;
    if (!AllFinite(c.first_moment, c.angular_first_moment, c.contact_point)) {
      return DecodeStatus::kNotFinite;
    }
  }
  return DecodeStatus::kOk;
}

namespace {

DecodeStatus Validate(ContactPlane& c) {
  if (!AllFinite(c.point, c.gap, c.friction, c.other_velocity, c.other_inverse_mass, c.impulse,
                 c.radius)) {
    return DecodeStatus::kNotFinite;
  }
  if (c.friction < 0 || c.other_inverse_mass < 0 || c.radius < 0) return DecodeStatus::kRange;
  return Normalise(c.normal);
}

DecodeStatus Validate(LocalBody& b) {
  if (!AllFinite(b.mass, b.position, b.velocity, b.angular_velocity, b.acceleration,
                 b.angular_acceleration)) {
    return DecodeStatus::kNotFinite;
  }
  for (const double component : b.inertia) {
    if (!Finite(component)) return DecodeStatus::kNotFinite;
  }
  if (b.mass < kLightestLocalBody || b.mass > kHeaviestLocalBody || !IsInertia(b.inertia)) {
    return DecodeStatus::kRange;
  }
  return Normalise(b.orientation);
}

DecodeStatus ValidateLocalBodies(WorldFrame& m) {
  if (m.local_body_count > 0 && !IsPeriod(m.local_substep_ns)) return DecodeStatus::kRange;
  for (std::uint32_t i = 0; i < m.local_body_count; ++i) {
    LocalBody& b = m.local_bodies[i];
    for (std::uint32_t j = 0; j < i; ++j) {
      if (m.local_bodies[j].body == b.body) return DecodeStatus::kIdentity;
    }
    if (const auto status = Validate(b); status != DecodeStatus::kOk) return status;
    for (std::uint32_t j = 0; j < b.contact_count; ++j) {
      if (const auto status = Validate(b.contacts[j]); status != DecodeStatus::kOk) return status;
    }
  }
  return DecodeStatus::kOk;
}

}  // namespace

DecodeStatus Validate(WorldFrame& m) noexcept {
  if (!IsCoupling(m.coupling)) return DecodeStatus::kEnumerator;
  if (m.frame == 0 || !IsPeriod(m.period_ns)) return DecodeStatus::kRange;
  if (m.acked_epoch != 0 && m.baseline_tick > m.acked_tick) return DecodeStatus::kRange;
  for (std::uint32_t i = 0; i < m.plane_count; ++i) {
    Plane& p = m.planes[i];
    if (p.pointer >= kMaxPointers) return DecodeStatus::kIdentity;
    if (!AllFinite(p.point, p.stiffness, p.damping, p.velocity, p.static_friction,
                   p.dynamic_friction, p.recovery_s, p.inverse_mass, p.radius)) {
      return DecodeStatus::kNotFinite;
    }
    if (p.stiffness < 0 || p.damping < 0 || p.static_friction < 0 || p.dynamic_friction < 0 ||
        p.recovery_s < 0 || p.recovery_s > kLongestRecovery || p.radius < 0 ||
        (p.inverse_mass < 0 && p.inverse_mass != kMobilityNotSaid)) {
      return DecodeStatus::kRange;
    }
    if (const auto status = Normalise(p.normal); status != DecodeStatus::kOk) return status;
  }
  return ValidateLocalBodies(m);
}

DecodeStatus Validate(HapticHealth& m) noexcept {
  if (!IsReason(m.reason) || !IsPeerState(m.peer_state)) return DecodeStatus::kEnumerator;
  if (!AllFinite(m.largest_force, m.largest_force_step, m.slew_limit, m.target)) {
    return DecodeStatus::kNotFinite;
  }
  const Reconciliation& r = m.reconciliation;
  if (!AllFinite(r.newest_jump, r.largest_jump)) return DecodeStatus::kNotFinite;
  if (r.newest_jump < 0 || r.largest_jump < 0) return DecodeStatus::kRange;
  const Energy& e = m.energy;
  if (!AllFinite(e.injected, e.dissipated)) return DecodeStatus::kNotFinite;
  if (e.dissipated < 0) return DecodeStatus::kRange;
  if (e.unstable > 1 || e.controller > 1) return DecodeStatus::kEnumerator;
  return IsPeriod(m.period_ns) ? DecodeStatus::kOk : DecodeStatus::kRange;
}

DecodeStatus Validate(WorldHealth& m) noexcept {
  if (!IsCoupling(m.coupling) || !IsPeerState(m.peer_state)) return DecodeStatus::kEnumerator;
  if (!Finite(m.penalty_impulse)) return DecodeStatus::kNotFinite;
  return IsPeriod(m.period_ns) ? DecodeStatus::kOk : DecodeStatus::kRange;
}

DecodeStatus Validate(Body& b) noexcept {
  if (!AllFinite(b.mass, b.position, b.velocity, b.angular_velocity))
    return DecodeStatus::kNotFinite;
  if (b.mass < 0) return DecodeStatus::kRange;
  return Normalise(b.orientation);
}

namespace {

/// How many of a shape's dimensions count; the others mean nothing.
std::size_t DimensionsOf(ShapeType shape) {
  switch (shape) {
    case ShapeType::kSphere:
      return 1;
    case ShapeType::kCylinder:
    case ShapeType::kCapsule:
      return 2;
    default:
      return 3;
  }
}

DecodeStatus Validate(SceneCollider& c) {
  if (c.shape < ShapeType::kBox || c.shape > ShapeType::kMesh) return DecodeStatus::kEnumerator;
  if (!AllFinite(c.dimensions, c.position)) return DecodeStatus::kNotFinite;
  for (const double component : c.colour) {
    if (!Finite(component)) return DecodeStatus::kNotFinite;
    if (component < 0 || component > 1) return DecodeStatus::kRange;
  }
  if (c.shape == ShapeType::kHalfSpace) {
    if (const auto status = Normalise(c.dimensions); status != DecodeStatus::kOk) return status;
  } else {
    for (std::size_t i = 0; i < DimensionsOf(c.shape); ++i) {
      // A capsule without length is a sphere.
      const bool may_vanish = c.shape == ShapeType::kCapsule && i == 1;
      const double dimension = c.dimensions[i];
      if (!(dimension > 0) && !(may_vanish && dimension == 0)) return DecodeStatus::kRange;
    }
  }
  return Normalise(c.orientation);
}

}  // namespace

DecodeStatus Validate(WorldScene& m) noexcept {
  if (!Finite(m.gravity)) return DecodeStatus::kNotFinite;
  if (m.revision == 0 || (m.needs & m.left_out) != 0) return DecodeStatus::kRange;
  for (const SceneBody& body : m.bodies) {
    if (body.fixed > 1) return DecodeStatus::kEnumerator;
  }
  for (SceneCollider& collider : m.colliders) {
    if (const auto status = Validate(collider); status != DecodeStatus::kOk) return status;
  }
  return DecodeStatus::kOk;
}

}  // namespace rikiseki::protocol
