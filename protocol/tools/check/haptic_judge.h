// Judges every message that a haptic side publishes, whatever the kit, as its world, does meanwhile.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "protocol/messages.h"
#include "protocol/ring.h"
#include "protocol/tools/check/monitor.h"
#include "protocol/tools/check/totals.h"

namespace rikiseki::protocol::check {

// The sentences, by the ids of their cases.
inline constexpr char kTickNumbers[] = "haptic/6.1/tick-numbers";
inline constexpr char kDuration[] = "haptic/6.1/true-duration";
inline constexpr char kCap[] = "haptic/6.1/force-cap";
inline constexpr char kNames[] = "haptic/6.1/names-frame";
inline constexpr char kNeverShown[] = "haptic/9.2/kept-out";
inline constexpr char kImpulse[] = "haptic/7.3/impulse";
inline constexpr char kDrift[] = "haptic/7.1/no-drift";
inline constexpr char kMoment[] = "haptic/7.2/angular-impulse";
inline constexpr char kContactPoint[] = "haptic/7.2/contact-point";
inline constexpr char kFirstMoments[] = "haptic/7.3/first-moments";
inline constexpr char kOpens[] = "haptic/7.2/opens-at-zero";
inline constexpr char kHasChannel[] = "haptic/7.2/has-channel";
inline constexpr char kFreed[] = "haptic/7.6/freed-after-ack";

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
  bool any_ = false;

  std::map<std::uint64_t, std::uint64_t> newest_frame_;  // published, by world epoch
  std::map<std::uint64_t, Shown> shown_;                 // by frame number of the newest epoch
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
