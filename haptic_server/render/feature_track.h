// SPDX-License-Identifier: MIT
// What the world sent becomes what is shown: features keep their identity from frame to frame and
// move between frames by the display rule. Those of a body with a local copy ride on it: the rule
// then acts in the body's frame. A ball is shown by the plane that is tangent to it where the finger
// is now, and the rule moves its centre. Paper 3.1 and 3.2; numerics 1; design decision 5.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/geometry.h"
#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/local_bodies.h"
#include "haptic_server/render/surface.h"
#include "haptic_server/settings.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// A feature that appears with the finger already inside it starts below the finger and rises to
/// its place within this time [s], so that the force does not step (Mark 1996: recovery time). One
/// that vanishes while it is pressed stays where it is, and its force fades within the same time,
/// unless its body was replaced by another generation.
/// A plane may bring a time of its own.
inline constexpr double kRecoveryTime = 0.1;

/// Coordinates beyond this [m] are taken for damage, not for places.
inline constexpr double kLargestCoordinate = 1e12;

/// Where a finger is when a frame arrives: decides which new features need recovery.
struct FingerState {
  Vec3 position = Vec3::Zero();  // m, centre
  double radius = 0;             // m
  double allowed_depth = 0;      // m, a new feature this deep is no surprise
};

class FeatureTrack {
 public:
  FeatureTrack(DisplayRule rule, std::int64_t period_ns);

  /// Time passes: j grows by `ticks`. Once per tick, before Receive. // RT:
  void Advance(std::int64_t ticks) noexcept;

  /// A frame arrived, to be shown from this tick on (j = 0). `fingers` by pointer index; planes of
  /// other pointers and damaged planes are ignored. `copies` have received it already. // RT:
  void Receive(const protocol::WorldFrame& frame, std::span<const FingerState> fingers,
               const LocalBodies& copies) noexcept;

  /// Forgets everything: the world is gone. // RT:
  void Clear() noexcept;

  /// What is displayed in this tick; valid until the next call of a member. Balls are shown to the
  /// fingers of the last MoveFinger. // RT:
  std::span<const Surface> Surfaces(const LocalBodies& copies) noexcept;

  /// Where a finger [m, W] is from now on. // RT:
  void MoveFinger(std::uint32_t pointer, const Vec3& position) noexcept {
    if (pointer < fingers_.size()) fingers_[pointer] = position;
  }

  /// Whether the newest frame has a feature of this body near this pointer. // RT:
  bool Has(std::uint32_t body, std::uint32_t generation, std::uint32_t pointer) const noexcept;

 private:
  struct Feature {
    protocol::Plane identity;  // and own stiffness and damping: the last ones
    double previous_stiffness = 0, previous_damping = 0;
    bool rides = false;               // points and normals below are in the body's frame, else in W
    Pose pose_WB;                     // where its copy was last
    Vec3 previous_point, last_point;  // of a ball: its centre
    Vec3 previous_normal, last_normal;
    double recovery = 0;       // m, how far below its place it started
    double recovery_left = 0;  // 1..0
    bool leaving = false;      // no longer in the frame
    double strength = 1;
  };

  void FollowCopies(const LocalBodies& copies) noexcept;
  HalfSpace Interpolated(const Feature& feature) const noexcept;
  double Interpolated(double previous, double last) const noexcept;
  HalfSpace Displayed(const Feature& feature) const noexcept;
  HalfSpace DisplayedTo(const Feature& feature, const Vec3& finger) const noexcept;
  bool IsPressed(const Feature& feature, const FingerState& finger) const noexcept;

  std::array<Vec3, protocol::kMaxPointers> fingers_;
  DisplayRule rule_;
  std::int64_t period_ns_;
  double ticks_per_frame_ = 1;  // n
  std::int64_t tick_ = 0;       // j
  std::size_t count_ = 0;
  std::array<Feature, protocol::kMaxPlanes> features_;
  std::array<Feature, protocol::kMaxPlanes> incoming_;
  std::array<Surface, protocol::kMaxPlanes> surfaces_;
};

}  // namespace rikiseki::haptic
