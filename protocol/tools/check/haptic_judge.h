// SPDX-License-Identifier: MIT
// Judges every message that a haptic side publishes, whatever the kit, as its world, does meanwhile.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "protocol/messages.h"
#include "protocol/ring.h"
#include "protocol/tools/check/monitor.h"
#include "protocol/tools/check/totals.h"

namespace rikiseki::protocol::check {

// The sentences, by the ids of their cases.
inline constexpr char kTickNumbers[] = "haptic/6.1-3/tick-numbers";
inline constexpr char kDuration[] = "haptic/6.1-7/true-duration";
inline constexpr char kCap[] = "haptic/5.5-7/force-cap";
inline constexpr char kNames[] = "haptic/6.1-6/names-frame";
inline constexpr char kNeverShown[] = "haptic/9.2-5/kept-out";
inline constexpr char kImpulse[] = "haptic/7.3-1/impulse";
inline constexpr char kDrift[] = "haptic/7.1-1/no-drift";
inline constexpr char kMoment[] = "haptic/7.2-3/angular-impulse";
inline constexpr char kContactPoint[] = "haptic/7.2-7/contact-point";
inline constexpr char kFirstMoments[] = "haptic/7.3-2/first-moments";
inline constexpr char kOpens[] = "haptic/7.2-8/opens-at-zero";
inline constexpr char kHasChannel[] = "haptic/7.2-6/has-channel";
inline constexpr char kStamps[] = "haptic/4.1-4/stamps";
inline constexpr char kSound[] = "haptic/9.2-3/sound-messages";
inline constexpr char kSequence[] = "haptic/4.1-2/counter";
inline constexpr char kNoWorld[] = "haptic/6.1-8/no-world-no-force";
inline constexpr char kSlew[] = "haptic/5.5-8/slew";
inline constexpr char kFreed[] = "haptic/7.6-2/freed-after-ack";

/// What is kept of one tick.
struct SeenTick {
  std::uint64_t tick = 0;
  std::int64_t start_ns = 0;
  std::int64_t period_ns = 0;
  std::int64_t duration_ns = 0;  // previous_duration_ns
  std::uint64_t world_epoch = 0;
  std::uint64_t world_frame = 0;
  ForceReason reason = ForceReason::kNoContact;
  Vector position{};
  Vector force{};  // of the first pointer
  double radius = 0;
};

class HapticJudge {
 public:
  explicit HapticJudge(Monitor& monitor) : monitor_(monitor) {}

  void Tick(const HapticTick& tick, const Received& received);

  /// The kit published frame `number` of world `epoch`; `planes` are all that it shows.
  void FramePublished(std::uint64_t epoch, std::uint64_t number, std::uint64_t acked_tick,
                      std::span<const Plane> planes);
  /// A frame of that number must not be displayed.
  void Poison(std::uint64_t epoch, std::uint64_t number) { poison_.insert({epoch, number}); }
  /// A body that stands in frames that must not be displayed.
  void PoisonBody(std::uint32_t body) { poisoned_bodies_.insert(body); }

  /// haptic.health states it [N/s]; 0 = not known.
  void SetSlewLimit(double newtons_per_s) { slew_limit_ = newtons_per_s; }

  const std::vector<SeenTick>& seen() const { return seen_; }
  const HapticTick& newest() const { return newest_; }

 private:
  void Sequence(const HapticTick& tick, const Received& received);
  void Frames(const HapticTick& tick);
  void Forces(const HapticTick& tick, bool consecutive);
  void Channels(const HapticTick& tick, bool consecutive);

  struct Shown {
    std::vector<Plane> planes;
    std::uint64_t unchanged = 0;  // frames in a row before it with the same bodies
  };

  Monitor& monitor_;
  std::vector<SeenTick> seen_;
  HapticTick newest_;
  std::uint64_t number_ = 0;
  std::uint64_t stamp_ns_ = 0;
  double slew_limit_ = 0;
  bool any_ = false;

  std::map<std::uint64_t, std::uint64_t> newest_frame_;  // published, by world epoch
  std::map<std::uint64_t, Shown> shown_;                 // by frame number of the newest epoch
  std::set<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>> was_shown_;  // of that epoch
  std::uint64_t shown_epoch_ = 0;
  std::uint64_t acked_tick_ = 0;  // the largest honest ack that was published
  bool any_ack_ = false;
  std::set<std::pair<std::uint64_t, std::uint64_t>> poison_;
  std::set<std::uint32_t> poisoned_bodies_;

  Totals totals_;
  std::map<ChannelKey, std::uint64_t> closed_at_;
  // Since a start where message and books agreed: what force times true time amounts to, in units.
  std::optional<std::array<long double, 3>> exact_;
  ImpulseUnits booked_{};
};

}  // namespace rikiseki::protocol::check
