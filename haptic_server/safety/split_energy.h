// SPDX-License-Identifier: MIT
// What the split between the two processes adds to a contact. A body without a local copy gets the
// finger's impulse at the next tick of its world, in one kick, while its displayed surface has been
// moving all along: what the body took with the kick is not what the surface took from the finger.
// The difference, over all frames, is the energy that makes a slow world unstable. numerics 2, 3.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry.h"
#include "haptic_server/render/local_bodies.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// So many bodies without a copy can be watched at once.
inline constexpr std::size_t kMaxSplitBodies = 4;

/// How the finger is rendered, which `position` is judged by: the world makes its impulse itself.
struct PenaltyRule {
  double stiffness_n_per_m = 0;  // of surfaces that bring none of their own
  double finger_radius_m = 0;
};

class SplitEnergy {
 public:
  /// Remembers `history_ticks` ticks: frames that acknowledge older ones are not judged.
  /// `own_epoch`: acks of another haptic epoch mean nothing; 0 = all count.
  SplitEnergy(const PenaltyRule& rule, std::uint64_t history_ticks, std::uint64_t own_epoch);

  /// Another stiffness [N/m] of surfaces that bring none of their own. // RT:
  void Tune(double stiffness_n_per_m) noexcept { rule_.stiffness_n_per_m = stiffness_n_per_m; }

  /// The work [J, on the user] of the surfaces of bodies without a copy, since the tick before. Once
  /// per tick, before Receive. // RT:
  void Moved(double surface_work) noexcept {
    if (std::isfinite(surface_work)) moved_ += surface_work;
  }

  /// A frame of world `world_epoch` that is displayed from tick `tick` on. Returns what the bodies
  /// took with the kicks that it acknowledges, less what their displayed surfaces took from the
  /// finger in those ticks [J]: what the split has added, < 0 = swallowed. 0 where the frame does
  /// not tell velocity and mobility of a body that was pushed. // RT:
  double Receive(std::uint64_t world_epoch, const protocol::WorldFrame& frame,
                 const LocalBodies& copies, std::uint64_t tick) noexcept;

  /// Tick `tick` is over: where the finger was [m, W] and what the ledger booked. // RT:
  void Book(std::uint64_t tick, const Vec3& finger, std::span<const BodyImpulse> booked) noexcept;

 private:
  // A surface of a body that can move and has no copy, as a frame said.
  struct Face {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;
    Vec3 point = Vec3::Zero();
    Vec3 normal = Vec3::Zero();
    Vec3 velocity = Vec3::Zero();  // m/s, of the body at the point
    double inverse_mass = 0;
    double stiffness = 0;  // 0 = none of its own
  };
  struct Pushed {
    std::uint32_t body = 0;
    std::uint32_t generation = 0;
    std::uint64_t first_tick = 0;  // of its pushes, and the newest
    std::uint64_t newest_tick = 0;
    Vec3 total = Vec3::Zero();  // N s, on the body
  };
  struct Record {
    double moved = 0;                          // J, total up to this tick
    Vec3 finger = Vec3::Zero();                // m
    std::array<Vec3, kMaxSplitBodies> totals;  // N s, with this tick's
  };
  // What one frame acknowledges beyond the frame before.
  struct Acked {
    const Record& before;
    const Record& now;
    const protocol::WorldFrame& frame;
  };

  void Remember(const protocol::WorldFrame& frame, const LocalBodies& copies) noexcept;
  double Judge(const Acked& acked, double moved) const noexcept;
  bool Taken(std::size_t slot, const Acked& acked, double& energy) const noexcept;
  const Face* LowestFace(const Pushed& pushed, const Vec3& v, double point_share) const noexcept;
  Record& At(std::uint64_t tick) noexcept { return history_[tick & (history_.size() - 1)]; }

  PenaltyRule rule_;
  std::uint64_t own_epoch_;
  std::vector<Record> history_;  // of tick k at k modulo its size
  std::size_t pushed_count_ = 0;
  std::array<Pushed, kMaxSplitBodies> pushed_;
  std::uint64_t overflow_tick_ = 0;  // the newest that pushed more bodies than can be watched
  double moved_ = 0;                 // J

  std::uint64_t world_epoch_ = 0;  // of the faces; 0 = none known
  std::uint64_t acked_tick_ = 0;   // by their frame
  double moved_acked_ = 0;         // J, up to it
  std::size_t face_count_ = 0;
  std::array<Face, protocol::kMaxPlanes> faces_;
};

}  // namespace rikiseki::haptic
