// SPDX-License-Identifier: MIT
// Is the world alive? Counted on our own clock, from fresh frames, its heartbeat and its owner's
// word. Absent -> Waiting -> Live -> Late -> Lost -> Absent. SPEC.md section 8.
#pragma once

#include <cstdint>

#include "haptic_server/settings.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

inline constexpr int kFreshFramesForLive = 3;

/// What is seen of the peer in one tick.
struct PeerSign {
  std::uint64_t epoch = 0;  // 0 = no segment
  bool ready = false;
  std::int64_t heartbeat_ns = 0;
  bool fresh_frame = false;          // a new, sound frame came
  std::int64_t frame_period_ns = 0;  // of that frame
};

/// How long a world of this period may be silent [ns] until it counts as lost. Periods count only
/// up to loop.longest_world_period_ms: a peer cannot talk itself out of being watched.
std::int64_t LostAfter(const Settings& settings, std::int64_t world_period_ns) noexcept;

class PeerWatch {
 public:
  explicit PeerWatch(const Settings& settings);

  /// `force_is_zero`: the force of a lost world has faded out, so it may be forgotten. // RT:
  protocol::PeerState Update(std::int64_t now_ns, const PeerSign& sign,
                             bool force_is_zero) noexcept;

  protocol::PeerState state() const noexcept { return state_; }
  /// Of the world that is watched; 0 when absent.
  std::uint64_t epoch() const noexcept { return epoch_; }
  /// Since the newest frame came. // RT:
  std::int64_t frame_age_ns(std::int64_t now_ns) const noexcept { return now_ns - frame_ns_; }
  /// Of the newest frame, at most the longest; the longest while none came.
  std::int64_t world_period_ns() const noexcept { return world_period_ns_; }
  /// Whether a frame of this epoch may be shown now.
  bool Accepts(std::uint64_t epoch) const noexcept;

 private:
  bool Alive(std::int64_t now_ns, const PeerSign& sign) const noexcept;
  void NoteFrame(std::int64_t now_ns, const PeerSign& sign) noexcept;
  void SetPeriod(std::int64_t world_period_ns) noexcept;

  SafetySettings safety_;
  std::int64_t longest_period_ns_;
  protocol::PeerState state_ = protocol::PeerState::kAbsent;
  std::uint64_t epoch_ = 0;
  int fresh_frames_ = 0;
  std::int64_t frame_ns_ = 0;  // when the newest came
  std::int64_t world_period_ns_;
  std::int64_t late_after_ns_, lost_after_ns_;  // with that period
};

}  // namespace rikiseki::haptic
