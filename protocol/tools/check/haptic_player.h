// SPDX-License-Identifier: MIT
// The kit as a haptic side: one thread that publishes ticks at 1 kHz with totals that it makes up,
// reads every frame of the world, and can do all of it wrongly when told to.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/attach.h"
#include "protocol/messages.h"
#include "protocol/tools/check/case.h"
#include "protocol/tools/check/monitor.h"
#include "protocol/tools/check/pace.h"
#include "protocol/tools/check/played_segment.h"
#include "protocol/tools/check/totals.h"

namespace rikiseki::protocol::check {

// The sentences that are judged on every frame, by the ids of their cases.
inline constexpr char kFrameNumbers[] = "world/6.2-3/frame-numbers";
inline constexpr char kFrameSound[] = "world/9.2-3/sound-messages";
inline constexpr char kFrameSequence[] = "world/4.1-2/counter";
inline constexpr char kFrameStamps[] = "world/4.1-4/stamps";
inline constexpr char kSum[] = "world/7.5-1/sum";
inline constexpr char kAckForward[] = "world/7.5-2/ack-forward";
inline constexpr char kAckEpoch[] = "world/7.5-3/ack-epoch";
inline constexpr char kBaselineKept[] = "world/7.5-4/baseline-kept";
inline constexpr char kBaselineRange[] = "world/6.2-4/baseline";
inline constexpr char kUnitNormals[] = "world/6.2-5/normals";
inline constexpr char kPlanePointer[] = "world/6.2-9/plane-pointer";
inline constexpr char kRefused[] = "world/9.2-5/kept-out";

struct SeenFrame {
  WorldFrame frame;
  std::int64_t stamp_ns = 0;
  std::int64_t seen_ns = 0;
};

class HapticPlayer {
 public:
  /// Takes the role of the haptic side. Throws SegmentError if somebody has it, or no world comes
  /// within `patience_s`.
  HapticPlayer(const PlayOptions& options, double patience_s = 10);
  ~HapticPlayer();

  const std::string& instance() const { return options_.instance; }
  const Vector& target() const { return target_; }

  // ---- The peer.
  const PeerView& peer() const { return *peer_; }
  Monitor& monitor() { return monitor_; }
  const std::vector<SeenFrame>& seen() const { return seen_; }
  const WorldFrame& newest() const { return newest_; }
  std::int64_t WorldPeriodNs() const;
  /// So many frames last, s.
  double Frames(double frames) const {
    return frames * 1e-9 * static_cast<double>(WorldPeriodNs());
  }
  std::optional<WorldHealth> Health();
  /// The body of that number in the newest world.bodies.
  std::optional<Body> BodyOf(std::uint32_t body);

  // ---- Our segment.
  void Open(const std::function<void(SegmentHeader&)>& alter = {},
            SegmentState state = SegmentState::kReady, std::uint32_t slots = 1024);
  bool open() const { return segment_ != nullptr && !segment_->ended(); }
  PlayedSegment& segment() { return *segment_; }
  void Close() { segment_->Close(); }
  void Leave() {
    if (open()) Close();
  }
  /// A segment that must be left alone; fails if it is taken.
  void NeverTaken(const std::function<void(SegmentHeader&)>& alter, SegmentState state,
                  const std::string& what);
  void Die() { segment_->Die(); }

  // ---- Time.
  void Step();
  void Run(double seconds);
  bool Until(const std::function<bool()>& done, double seconds);

  // ---- What is published.
  std::int64_t period_ns = 1'000'000;
  bool publishing = true;
  Vector position{};
  double radius = 0.01;   // m
  double force_cap = 10;  // N
  std::function<void(HapticTick&)> amend;
  /// Added to the totals of the channel in every tick, in units.
  ImpulseUnits each_tick{};
  /// Adds once to the totals of the first channel.
  void Push(const ImpulseUnits& units);
  std::vector<Channel> channels;
  Channel& OpenChannel(std::uint32_t body, std::uint32_t generation);
  std::uint64_t named_epoch = 0;  // 0 = the world's
  HapticTick NextTick();
  void Publish(const HapticTick& tick);
  /// A sound message, but `change` has the last word on its bytes. The stamp is `stamp_offset_ns`
  /// later than now.
  void PublishAs(const HapticTick& tick,
                 const std::function<void(std::vector<std::uint64_t>&, Encoded&)>& change,
                 std::int64_t stamp_offset_ns = 0);
  /// The number counts as used; the world must never acknowledge it.
  void PublishSpoilt(const HapticTick& tick,
                     const std::function<void(std::vector<std::uint64_t>&, Encoded&)>& spoil,
                     std::int64_t stamp_offset_ns = 0);
  /// The numbers of messages and ticks grow by `numbers` at once.
  void Jump(std::uint64_t numbers);
  /// Ticks up to `last` count as performed, with the totals of the newest.
  void PerformedAlike(std::uint64_t last) { published_[segment_->epoch()].alike_until = last; }
  std::uint64_t tick() const { return next_tick_ - 1; }
  RawWriter& writer() { return writer_; }

  // ---- Scenes.
  /// Attached: it acknowledges our epoch. Opens a segment if there is none. Fails after 5 s.
  void Couple();
  /// Finger on the box, a channel for its body. Fails when no plane comes.
  void Touch();
  /// Everything up to now acknowledged.
  bool Settle(double seconds = 2);
  /// Whether the body that is touched can move, as far as it is known.
  bool Movable();
  const Plane& touched() const { return touched_; }

  std::int64_t longest_pause_ns() const { return pace_.longest_pause_ns(); }
  void Calm() { pace_.Calm(); }

 private:
  void Drain();
  void JudgeFrame(std::span<const std::uint64_t> words, const Received& received);
  void Remember(const HapticTick& tick);

  PlayOptions options_;
  Vector target_{};
  RoleHolder role_;
  Monitor monitor_;
  std::unique_ptr<PeerView> peer_;
  StreamReader frames_;
  std::vector<std::uint64_t> words_;
  MessageReader<WorldHealth> healths_;
  WorldHealth health_;
  bool any_health_ = false;
  BodiesReader bodies_;

  std::vector<SeenFrame> seen_;
  WorldFrame newest_;
  std::uint64_t frame_number_ = 0;
  std::uint64_t frame_stamp_ns_ = 0;

  std::unique_ptr<PlayedSegment> segment_;
  RawWriter writer_;
  std::uint64_t next_tick_ = 0;
  std::int64_t previous_start_ns_ = 0;
  std::int64_t next_ns_ = 0;
  Pace pace_;
  Plane touched_;

  /// What every epoch of ours published: the sum over channels by tick.
  struct Published {
    Totals totals;             // of the newest tick
    ImpulseUnits displayed{};  // growth since the first
    std::map<std::uint64_t, ImpulseUnits> by_tick;
    std::map<std::uint64_t, bool> spoilt;
    std::uint64_t alike_until = 0;

    std::optional<ImpulseUnits> At(std::uint64_t tick) const {
      const auto exact = by_tick.find(tick);
      if (exact != by_tick.end()) return exact->second;
      if (tick < alike_until) return displayed;
      return std::nullopt;
    }
  };
  std::map<std::uint64_t, Published> published_;  // by epoch
};

}  // namespace rikiseki::protocol::check
