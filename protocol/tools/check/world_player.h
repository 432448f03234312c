// SPDX-License-Identifier: MIT
// The kit as a world: one thread that publishes frames, reads every tick of the haptic side, keeps the
// books as SPEC.md 7.4 wants, and can do all of it wrongly when told to.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/attach.h"
#include "protocol/messages.h"
#include "protocol/tools/check/case.h"
#include "protocol/tools/check/haptic_judge.h"
#include "protocol/tools/check/pace.h"
#include "protocol/tools/check/played_segment.h"

namespace rikiseki::protocol::check {

/// Zero force, but for the rounding of tensions that add up to nothing [N].
inline constexpr double kZeroForce = 1e-6;

class WorldPlayer {
 public:
  /// Takes the role of the world. Throws SegmentError if somebody has it, or no haptic side comes
  /// within `patience_s`.
  WorldPlayer(const PlayOptions& options, double patience_s = 10);
  ~WorldPlayer();

  const std::string& instance() const { return options_.instance; }

  // ---- The peer.
  const PeerView& peer() const { return *peer_; }
  Monitor& monitor() { return monitor_; }
  HapticJudge& judge() { return judge_; }
  const std::vector<SeenTick>& seen() const { return judge_.seen(); }
  const HapticTick& newest() const { return judge_.newest(); }
  double Force() const;     // N, of the first pointer, in the newest tick
  bool DisplaysUs() const;  // it names our epoch
  /// The newest health message; none if the peer has no such stream.
  std::optional<HapticHealth> Health();
  /// From the last frame to zero force: what haptic.health states, else the table of 5.5.
  std::int64_t ZeroForceBoundNs();

  // ---- Our segment.
  /// A fresh one with a new epoch; what was there before ends as a death.
  void Open(const std::function<void(SegmentHeader&)>& alter = {},
            SegmentState state = SegmentState::kReady, std::uint32_t slots = 8);
  bool open() const { return segment_ != nullptr && !segment_->ended(); }
  PlayedSegment& segment() { return *segment_; }
  void Close() { segment_->Close(); }
  void Die() { segment_->Die(); }
  /// Without a segment for a while, so that the next case starts from nothing.
  void Leave();
  /// A segment that must be left alone; fails if it is taken.
  void NeverTaken(const std::function<void(SegmentHeader&)>& alter, SegmentState state,
                  const std::string& what);

  // ---- Time. Everything happens in here.
  /// One pass: reads ticks, publishes a frame if one is due, sleeps about a millisecond.
  void Step();
  void Run(double seconds);
  /// Steps until `done`; false after `seconds`.
  bool Until(const std::function<bool()>& done, double seconds);

  // ---- What is published.
  std::int64_t period_ns = 20'000'000;
  bool publishing = true;
  bool beating = true;
  bool acking = true;
  std::vector<Plane> planes;
  /// Changes each frame before it is published.
  std::function<void(WorldFrame&)> amend;
  /// Called before each due frame: moves the planes.
  std::function<void()> animate;
  WorldFrame NextFrame();  // the next number, our planes, our ack
  void Publish(const WorldFrame& frame);
  /// Publishes the bytes of `frame` after `spoil` changed them; the number counts as used, and the
  /// haptic side must never name it. The stamp is `stamp_offset_ns` later than now.
  void PublishSpoilt(const WorldFrame& frame,
                     const std::function<void(std::vector<std::uint64_t>&, Encoded&)>& spoil,
                     std::int64_t stamp_offset_ns = 0);
  /// The numbers of messages and frames grow by `numbers` at once.
  void Jump(std::uint64_t numbers);
  std::uint64_t frame() const { return frame_; }
  RawWriter& writer() { return writer_; }

  // ---- Our books of this epoch of ours.
  std::uint64_t acked_tick() const { return acked_tick_; }
  bool any_tick() const { return any_tick_; }
  const ImpulseUnits& applied() const { return applied_; }

  // ---- Scenes.
  /// Our surface under the finger, and a force: brought to the finger unless there is a target.
  /// Fails when no force comes.
  void Press();
  /// Surfaces away, and the force zero.
  void Release();
  /// Coupled: it names our epoch. Opens a segment if there is none. Fails after 5 s.
  void Couple();

  /// The longest pause between two steps of ours, and the longest tick of the peer, since Calm().
  std::int64_t longest_pause_ns() const { return pace_.longest_pause_ns(); }
  void Calm() { pace_.Calm(); }

  std::uint32_t body = 7;
  std::uint32_t generation = 3;

 private:
  void Drain();
  void Book(const HapticTick& tick);

  PlayOptions options_;
  RoleHolder role_;
  Monitor monitor_;
  HapticJudge judge_{monitor_};
  std::unique_ptr<PeerView> peer_;
  MessageReader<HapticTick> ticks_;
  MessageReader<HapticHealth> healths_;
  HapticHealth health_;
  bool any_health_ = false;
  HapticTick tick_;

  std::unique_ptr<PlayedSegment> segment_;
  RawWriter writer_;
  std::uint64_t frame_ = 0;
  std::int64_t next_frame_ns_ = 0;
  Pace pace_;

  bool any_tick_ = false;
  std::uint64_t baseline_tick_ = 0;
  std::uint64_t acked_tick_ = 0;
  Totals totals_;
  ImpulseUnits applied_{};
  ImpulseUnits discarded_{};
  std::optional<WorldFrame> frozen_ack_;
};

}  // namespace rikiseki::protocol::check
