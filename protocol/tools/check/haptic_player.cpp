// SPDX-License-Identifier: MIT
#include "protocol/tools/check/haptic_player.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/clock.h"

namespace rikiseki::protocol::check {
namespace {

constexpr double kDepth = 0.0005;       // m, of the finger in the box
constexpr double kFarthest = 0.15;      // m from the target, where the approach begins
constexpr double kApproachSpeed = 0.1;  // m/s

double RawDouble(std::span<const std::uint64_t> words, std::size_t offset) {
  double value = 0;
  std::memcpy(&value, reinterpret_cast<const unsigned char*>(words.data()) + offset, sizeof value);
  return value;
}

}  // namespace

HapticPlayer::HapticPlayer(const PlayOptions& options, double patience_s)
    : options_(options),
      target_{options.target[0], options.target[1], options.target[2]},
      role_(options.instance, Role::kHaptic, options.runtime_directory),
      peer_(WaitForPeer(options.instance, Role::kWorld, patience_s)),
      frames_(peer_->Stream(StreamType::kWorldFrame)),
      words_(kWorldFrameBytes / 8 + 512),
      healths_(peer_->Reader<WorldHealth>()),
      bodies_(peer_->Stream(StreamType::kWorldBodies)) {
  position = Sum(target_, {-kFarthest, 0, 0});
}

HapticPlayer::~HapticPlayer() {
  if (open()) Close();
}

std::int64_t HapticPlayer::WorldPeriodNs() const {
  return newest_.period_ns == 0 ? 50'000'000 : static_cast<std::int64_t>(newest_.period_ns);
}

std::optional<WorldHealth> HapticPlayer::Health() {
  if (!peer_->Has(StreamType::kWorldHealth)) return std::nullopt;
  if (healths_.ReadLatest(health_) == ReadStatus::kFresh) any_health_ = true;
  if (!any_health_) return std::nullopt;
  return health_;
}

std::optional<Body> HapticPlayer::BodyOf(std::uint32_t body) {
  if (!peer_->Has(StreamType::kWorldBodies)) return std::nullopt;
  bodies_.ReadLatest();
  for (const Body& one : bodies_.bodies()) {
    if (one.body == body) return one;
  }
  return std::nullopt;
}

void HapticPlayer::Open(const std::function<void(SegmentHeader&)>& alter, SegmentState state,
                        std::uint32_t slots) {
  if (open()) Die();
  segment_.reset();
  segment_ = std::make_unique<PlayedSegment>(
      SegmentScript{.instance = options_.instance,
                    .role = Role::kHaptic,
                    .streams = {{StreamType::kHapticTick, kHapticTickBytes, slots,
                                 static_cast<std::uint64_t>(period_ns)}},
                    .epoch = role_.NextEpoch(),
                    .state = state,
                    .alter = alter});
  writer_ = RawWriter(segment_->RingOf(StreamType::kHapticTick));
  published_[segment_->epoch()] = {};
  next_tick_ = 0;
  next_ns_ = 0;
  previous_start_ns_ = 0;
  publishing = true;
  amend = nullptr;
  each_tick = {};
  named_epoch = 0;
  channels.clear();
}

void HapticPlayer::NeverTaken(const std::function<void(SegmentHeader&)>& alter, SegmentState state,
                              const std::string& what) {
  Open(alter, state);
  const std::size_t from = seen_.size();
  // Time to be found, and for a frame that would say so.
  Run(0.15 + Frames(1.5));
  Require(seen_.size() > from, "no frames while " + what);
  for (std::size_t i = from; i < seen_.size(); ++i) {
    Require(seen_[i].frame.acked_epoch != segment_->epoch(),
            "our ticks are acknowledged though " + what);
  }
}

Channel& HapticPlayer::OpenChannel(std::uint32_t body, std::uint32_t generation) {
  Channel channel;
  channel.body = body;
  channel.generation = generation;
  channel.opened_tick = next_tick_;
  channel.contact_point = position;
  channels.push_back(channel);
  return channels.back();
}

void HapticPlayer::Push(const ImpulseUnits& units) {
  channels.front().impulse = Plus(channels.front().impulse, units);
}

HapticTick HapticPlayer::NextTick() {
  const std::int64_t now = MonotonicNow();
  HapticTick tick;
  tick.tick = next_tick_++;
  tick.start_ns = static_cast<std::uint64_t>(now);
  tick.period_ns = static_cast<std::uint64_t>(period_ns);
  tick.previous_duration_ns =
      tick.tick == 0 ? 0 : static_cast<std::uint64_t>(now - previous_start_ns_);
  previous_start_ns_ = now;
  tick.world_epoch = named_epoch != 0 ? named_epoch : peer_->epoch();
  tick.world_frame = newest_.frame;
  tick.stiffness = 2000;
  tick.damping = 2;
  tick.force_cap = force_cap;
  tick.pointer_count = 1;
  tick.pointers[0].radius = radius;
  tick.pointers[0].position = position;
  if (!channels.empty()) {
    Channel& channel = channels.front();
    channel.impulse = Plus(channel.impulse, each_tick);
    const double per_tick = kImpulseUnit * 1e9 / static_cast<double>(period_ns);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      tick.pointers[0].force[axis] = -static_cast<double>(each_tick[axis]) * per_tick;
    }
    tick.pointers[0].reason =
        Largest(each_tick) > 0 ? ForceReason::kContact : ForceReason::kNoContact;
  }
  tick.channel_count =
      static_cast<std::uint32_t>(std::min<std::size_t>(channels.size(), kMaxChannels));
  std::copy_n(channels.begin(), tick.channel_count, tick.channels.begin());
  return tick;
}

void HapticPlayer::Remember(const HapticTick& tick) {
  Published& epoch = published_[segment_->epoch()];
  const Totals now = TotalsOf(tick);
  if (!epoch.by_tick.empty()) {
    epoch.displayed = Plus(epoch.displayed, Growth(epoch.totals, now));
  }
  epoch.totals = now;
  epoch.by_tick[tick.tick] = epoch.displayed;
}

void HapticPlayer::Publish(const HapticTick& tick) {
  Remember(tick);
  std::vector<std::uint64_t> words(kHapticTickBytes / 8);
  const Encoded encoded = Encode(tick, words);
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  writer_.Publish(std::span<const std::uint64_t>(words).first(encoded.used_bytes / 8), encoded,
                  now);
  segment_->Heartbeat(tick.tick, now);
}

void HapticPlayer::PublishSpoilt(
    const HapticTick& tick, const std::function<void(std::vector<std::uint64_t>&, Encoded&)>& spoil,
    std::int64_t stamp_offset_ns) {
  published_[segment_->epoch()].spoilt[tick.tick] = true;
  PublishAs(tick, spoil, stamp_offset_ns);
}

void HapticPlayer::PublishAs(
    const HapticTick& tick,
    const std::function<void(std::vector<std::uint64_t>&, Encoded&)>& change,
    std::int64_t stamp_offset_ns) {
  Remember(tick);
  std::vector<std::uint64_t> words(kHapticTickBytes / 8);
  Encoded encoded = Encode(tick, words);
  change(words, encoded);
  const std::size_t stored =
      std::min<std::size_t>(encoded.used_bytes, writer_.ring().payload_bytes) / 8;
  writer_.Publish(std::span<const std::uint64_t>(words).first(stored), encoded,
                  static_cast<std::uint64_t>(MonotonicNow() + stamp_offset_ns));
}

void HapticPlayer::Jump(std::uint64_t numbers) {
  next_tick_ += numbers;
  writer_.SetPublished(writer_.published() + numbers);
}

void HapticPlayer::Drain() {
  for (;;) {
    Received received;
    const ReadStatus status = frames_.ReadNext(words_, received);
    monitor_.Judge(kFrameSequence, status != ReadStatus::kBackwards,
                   [] { return std::string("published of world.frame ran backwards"); });
    if (status == ReadStatus::kBackwards) frames_ = peer_->Stream(StreamType::kWorldFrame);
    if (status == ReadStatus::kRejected) {
      monitor_.Judge(kFrameSound, false,
                     [] { return std::string("used_bytes is more than payload_bytes"); });
      continue;
    }
    if (status != ReadStatus::kFresh) return;
    JudgeFrame(words_, received);
  }
}

void HapticPlayer::JudgeFrame(std::span<const std::uint64_t> words, const Received& received) {
  WorldFrame frame;
  const DecodeStatus decoded = Decode(words, {received.used_bytes, received.blocks}, frame);
  const std::string at = " in frame message " + std::to_string(received.number);
  monitor_.Judge(kFrameSound, decoded == DecodeStatus::kOk,
                 [&] { return std::string(Describe(decoded)) + at; });
  if (decoded != DecodeStatus::kOk) return;
  const std::int64_t now = MonotonicNow();
  const bool consecutive = received.number == frame_number_ + 1;
  monitor_.Judge(kFrameNumbers, frame.frame == received.number, [&] {
    return "message " + std::to_string(received.number) + " is frame " +
           std::to_string(frame.frame);
  });
  monitor_.Judge(
      kFrameStamps,
      received.stamp_ns >= frame_stamp_ns_ && received.stamp_ns <= static_cast<std::uint64_t>(now),
      [&] { return "stamp_ns goes back or lies in the future" + at; });
  if (consecutive && !seen_.empty()) {
    const WorldFrame& before = seen_.back().frame;
    if (frame.acked_epoch == before.acked_epoch && frame.acked_epoch != 0) {
      monitor_.Judge(kAckForward, frame.acked_tick >= before.acked_tick, [&] {
        return "acked_tick went from " + std::to_string(before.acked_tick) + " to " +
               std::to_string(frame.acked_tick) + at;
      });
      monitor_.Judge(kBaselineKept, frame.baseline_tick == before.baseline_tick, [&] {
        return "baseline_tick went from " + std::to_string(before.baseline_tick) + " to " +
               std::to_string(frame.baseline_tick) + at;
      });
    }
  }
  for (std::uint32_t i = 0; i < frame.plane_count; ++i) {
    const std::size_t normal = RecordBytes("world.frame") + i * RecordBytes("world.frame/plane") +
                               FieldOffset("world.frame/plane", "normal");
    const double norm = std::hypot(RawDouble(words, normal), RawDouble(words, normal + 8),
                                   RawDouble(words, normal + 16));
    monitor_.Judge(kUnitNormals, std::abs(norm - 1) <= 1e-6,
                   [&] { return "a normal of length " + Num(norm) + at; });
  }
  if (frame.acked_epoch != 0) {
    const auto epoch = published_.find(frame.acked_epoch);
    // Before we came there may have been another haptic side.
    const bool ours = epoch != published_.end();
    if (ours || !published_.empty()) {
      const bool before_us = seen_.empty() || frame.acked_epoch == seen_.back().frame.acked_epoch;
      monitor_.Judge(kAckEpoch, ours || before_us, [&] {
        return "acked_epoch " + std::to_string(frame.acked_epoch) + " was never attachable" + at;
      });
    }
    monitor_.Judge(kBaselineRange, frame.baseline_tick <= frame.acked_tick,
                   [&] { return "baseline_tick is greater than acked_tick" + at; });
    if (ours) {
      const auto acked = epoch->second.At(frame.acked_tick);
      const auto baseline = epoch->second.At(frame.baseline_tick);
      monitor_.Judge(kAckForward, acked.has_value(), [&] {
        return "acknowledges tick " + std::to_string(frame.acked_tick) +
               ", which was not performed" + at;
      });
      monitor_.Judge(kRefused,
                     epoch->second.spoilt.count(frame.acked_tick) == 0 &&
                         epoch->second.spoilt.count(frame.baseline_tick) == 0,
                     [&] { return "acknowledges a tick that had to be rejected" + at; });
      if (acked && baseline) {
        const ImpulseUnits said = Plus(frame.applied, frame.discarded);
        const ImpulseUnits is = Minus(*acked, *baseline);
        monitor_.Judge(kSum, said == is, [&] {
          return "applied + discarded = " + Text(said) + ", the channels grew by " + Text(is) +
                 " from tick " + std::to_string(frame.baseline_tick) + " to " +
                 std::to_string(frame.acked_tick) + at;
        });
      }
    }
  }
  newest_ = frame;
  frame_number_ = received.number;
  frame_stamp_ns_ = received.stamp_ns;
  seen_.push_back({frame, static_cast<std::int64_t>(received.stamp_ns), now});
}

void HapticPlayer::Step() {
  const std::int64_t now = pace_.Step(*peer_, Role::kWorld);
  Drain();
  if (open() && publishing && now >= next_ns_) {
    next_ns_ = std::max(next_ns_ + period_ns, now + period_ns / 2);
    HapticTick tick = NextTick();
    if (amend) amend(tick);
    Publish(tick);
  }
  SleepUntil(std::min(now + 1'000'000, std::max(next_ns_, now + 200'000)));
}

void HapticPlayer::Run(double seconds) {
  Until([] { return false; }, seconds);
}

bool HapticPlayer::Until(const std::function<bool()>& done, double seconds) {
  return pace_.Until([this] { Step(); }, done, seconds);
}

void HapticPlayer::Couple() {
  if (!open()) Open();
  publishing = true;
  amend = nullptr;
  named_epoch = 0;
  Require(Until([&] { return newest_.acked_epoch == segment_->epoch(); }, 5),
          "5 s after our segment is ready it is not acknowledged");
}

void HapticPlayer::Touch() {
  Couple();
  const auto box = [&]() -> const Plane* {
    // The nearest plane with the target behind it.
    const Plane* nearest = nullptr;
    double least = 0;
    for (std::uint32_t i = 0; i < newest_.plane_count; ++i) {
      const Plane& plane = newest_.planes[i];
      if (plane.pointer != 0) continue;
      const double behind = Dot(Difference(target_, plane.point), plane.normal);
      const double gap = Dot(Difference(position, plane.point), plane.normal);
      if (behind > -1e-4 || Norm(Difference(target_, plane.point)) > 0.12) continue;
      // The face in front of the finger, not one across it: floors have the target behind them too.
      if (std::abs(plane.normal[0]) < 0.7) continue;
      if (nearest == nullptr || gap < least) {
        nearest = &plane;
        least = gap;
      }
    }
    return nearest;
  };
  position = Sum(target_, {-kFarthest, 0, 0});
  std::int64_t before = MonotonicNow();
  const bool found = Until(
      [&] {
        if (box() != nullptr) return true;
        const std::int64_t now = MonotonicNow();
        position[0] =
            std::min(position[0] + kApproachSpeed * static_cast<double>(now - before) * 1e-9,
                     target_[0] - 0.03);
        before = now;
        return false;
      },
      5);
  Require(found, "no plane of a box around the target, when the finger comes from -x");
  touched_ = *box();
  position = Sum(touched_.point, Scaled(touched_.normal, radius - kDepth));
  if (channels.empty() || channels.front().body != touched_.body ||
      channels.front().generation != touched_.generation) {
    channels.clear();
    OpenChannel(touched_.body, touched_.generation);
  }
  Run(0.05);
}

bool HapticPlayer::Settle(double seconds) {
  const std::uint64_t upto = tick();
  return Until(
      [&] { return newest_.acked_epoch == segment_->epoch() && newest_.acked_tick >= upto; },
      seconds);
}

bool HapticPlayer::Movable() {
  const auto body = BodyOf(touched_.body);
  return body && body->mass > 0;
}

}  // namespace rikiseki::protocol::check
