// SPDX-License-Identifier: MIT
// A haptic side under test: its segment, and what it does with a world that is right.
#include "protocol/tools/check/haptic_cases.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/clock.h"
#include "protocol/tools/check/lint.h"

namespace rikiseki::protocol::check {
namespace {

RawView Raw(WorldPlayer& player) {
  return RawView(player.instance(), Role::kHaptic);
}

void Header(WorldPlayer& player) {
  const SegmentHeader& header = player.peer().header();
  Require(player.peer().Has(StreamType::kHapticTick), "no stream haptic.tick");
  Require(header.stream_count <= kMaxStreams, "too many streams");
  if (!player.peer().Has(StreamType::kHapticHealth)) NotStrict("no stream haptic.health");
}

void Reserved(WorldPlayer& player) {
  CheckReserved(Raw(player));
}

void Epoch(WorldPlayer& player) {
  CheckEpoch(Raw(player));
}

void Mode(WorldPlayer& player) {
  CheckPermissions(player.instance(), Role::kHaptic);
}

void Heartbeat(WorldPlayer& player) {
  CheckHeartbeat(Raw(player), StreamType::kHapticTick, 0.3);
}

void Publication(WorldPlayer& player) {
  CheckPublication(Raw(player), StreamType::kHapticTick, 0.3);
}

void RateAndAbsence(WorldPlayer& player) {
  player.Leave();
  const std::size_t from = player.seen().size();
  player.Run(0.3);
  const auto& seen = player.seen();
  Require(seen.size() > from + 3, "no ticks without a world");
  Require(player.Force() < kZeroForce, Num(player.Force()) + " N without a world");
  std::vector<std::int64_t> durations;
  for (std::size_t i = from; i < seen.size(); ++i) durations.push_back(seen[i].duration_ns);
  std::nth_element(durations.begin(),
                   durations.begin() + static_cast<std::ptrdiff_t>(durations.size() / 2),
                   durations.end());
  const std::int64_t median = durations[durations.size() / 2];
  const std::int64_t nominal = seen.back().period_ns;
  if (median > nominal + nominal / 2 || median < nominal / 2) {
    Inform("half of the ticks last longer than " + Ms(median) + ", period_ns is " + Ms(nominal));
  }
}

void Attaches(WorldPlayer& player) {
  player.Leave();
  player.Open();
  const std::int64_t start = MonotonicNow();
  player.Couple();
  const std::int64_t took = MonotonicNow() - start;
  Require(took <= 1'500'000'000, "found our segment only after " + Ms(took));
}

// Force of two frames alone would be displayed before anything is known of the world.
void ThreeFrames(WorldPlayer& player) {
  player.Press();
  const std::vector<Plane> planes = player.planes;
  player.Leave();
  player.Open();
  player.planes = planes;
  player.publishing = false;
  player.Publish(player.NextFrame());
  player.Run(0.15);
  player.Publish(player.NextFrame());
  const std::size_t from = player.seen().size();
  player.Run(0.15);
  for (std::size_t i = from; i < player.seen().size(); ++i) {
    const double force = Norm(player.seen()[i].force);
    Require(force < kZeroForce, Num(force) + " N displayed after two frames");
  }
}

void NoContact(WorldPlayer& player) {
  player.Couple();
  player.Release();
  const std::size_t from = player.seen().size();
  player.Run(0.2);
  for (std::size_t i = from; i < player.seen().size(); ++i) {
    const double force = Norm(player.seen()[i].force);
    Require(force < kZeroForce, Num(force) + " N displayed where there is no surface");
  }
}

void Contact(WorldPlayer& player) {
  player.Press();
  const Vector normal = player.planes[0].normal;
  const Vector force = player.newest().pointers[0].force;
  Require(Dot(force, normal) > 0.9 * Norm(force),
          "the force does not push the finger out of the surface: " + Num(Dot(force, normal)) +
              " of " + Num(Norm(force)) + " N along the normal");
  const HapticTick& tick = player.newest();
  const auto fits = [&](const Channel& channel) {
    return channel.body == player.body && channel.generation == player.generation &&
           channel.pointer == tick.pointers[0].pointer && channel.state == ChannelState::kOpen;
  };
  Require(std::any_of(tick.channels.begin(), tick.channels.begin() + tick.channel_count, fits),
          "no open channel for our body and generation");
}

// As far in as the force goes, but no farther than a finger yields.
void PressedHard(WorldPlayer& player) {
  player.Press();
  const Vector start = player.planes[0].point;
  const Vector normal = player.planes[0].normal;
  const std::uint64_t breaches = player.monitor().breaches(kCap);
  double depth = 0;
  player.animate = [&] {
    depth = std::min(depth + 0.001, 0.03);
    player.planes[0].point = Sum(start, Scaled(normal, depth));
  };
  const auto hard = [&] { return player.Force() >= 0.95 * player.newest().force_cap; };
  const bool reached = player.Until([&] { return hard() || depth >= 0.03; }, 3) && hard();
  player.Run(0.1);
  player.animate = nullptr;
  player.Leave();
  if (player.monitor().breaches(kCap) > breaches) player.monitor().Report(kCap);
  if (!reached) Inform("the finger yields before force_cap is reached");
}

// Long enough that every term of 7.3 was seen with a force that changes.
void Accounts(WorldPlayer& player) {
  player.Press();
  const std::uint64_t before = player.monitor().looks(kMoment);
  player.Run(0.3);
  Require(player.monitor().looks(kImpulse) > 0, "no two ticks in a row were seen");
  if (player.monitor().looks(kMoment) == before) {
    Inform("the force never went to one channel alone: L was not judged");
  }
}

void FarPointer(WorldPlayer& player) {
  player.Press();
  const Plane kept = player.planes[0];
  player.planes[0].pointer = (kept.pointer + 3) % kMaxPointers;
  const bool gone = player.Until([&] { return player.Force() < kZeroForce; }, 2);
  player.planes.clear();
  Require(gone, "a plane for pointer " + std::to_string((kept.pointer + 3) % kMaxPointers) +
                    ", which it does not have, holds pointer " + std::to_string(kept.pointer));
}

void Generations(WorldPlayer& player) {
  player.Press();
  ++player.generation;
  player.planes[0].generation = player.generation;
  const auto opened = [&] {
    const HapticTick& tick = player.newest();
    return std::any_of(tick.channels.begin(), tick.channels.begin() + tick.channel_count,
                       [&](const Channel& channel) {
                         return channel.body == player.body &&
                                channel.generation == player.generation;
                       });
  };
  Require(player.Until(opened, 2), "no channel of its own for a new generation of the body");
}

void FreedAfterAck(WorldPlayer& player) {
  player.Press();
  player.acking = false;
  player.Run(0.06);
  player.Release();
  const auto closed = [&] {
    const HapticTick& tick = player.newest();
    return std::any_of(
        tick.channels.begin(), tick.channels.begin() + tick.channel_count,
        [](const Channel& channel) { return channel.state == ChannelState::kClosed; });
  };
  const bool closes = player.Until(closed, 0.5);
  player.Run(0.2);  // the judge looks: it must not vanish before the ack
  const bool kept = !closes || closed();
  player.acking = true;
  Require(kept, "a closed channel was freed before the message that closed it was acknowledged");
  if (!closes) Inform("channels without contact are kept open");
  if (!player.Until([&] { return !closed(); }, 1)) {
    Inform("a closed channel is kept for later after its ack");
  }
}

// Every generation takes a channel, and no ack frees one.
void NoChannel(WorldPlayer& player) {
  player.Leave();
  player.Couple();
  player.Press();
  player.acking = false;
  bool refused = false;
  for (std::uint32_t i = 0; i < kMaxChannels + 2 && !refused; ++i) {
    player.planes[0].generation = ++player.generation;
    const std::uint64_t changed = player.frame() + 1;
    player.Until([&] { return player.newest().world_frame >= changed + 2; }, 1);
    player.Run(0.005);
    refused = player.Until([&] { return player.Force() < kZeroForce; },
                           i + 1 >= kMaxChannels ? 1.0 : 0.0);
  }
  const ForceReason reason = player.newest().pointers[0].reason;
  player.acking = true;
  player.Leave();
  Require(refused, "more contacts displayed than there are channels");
  if (reason != ForceReason::kNoChannel && reason != ForceReason::kNoContact) {
    Inform("the reason is " + std::to_string(static_cast<std::uint32_t>(reason)) +
           ", 11 (no channel) would say it");
  }
}

void Books(WorldPlayer& player) {
  if (!player.peer().Has(StreamType::kHapticHealth)) Unimplemented("no stream haptic.health");
  player.Leave();
  player.Couple();
  const auto settled = [&] {
    const auto health = player.Health();
    return health &&
           health->books.displayed == Plus(health->books.covered, health->books.peer_lost);
  };
  Require(player.Until(settled, 3), "the books never settle: displayed - covered - peer_lost");
  const protocol::Books before = player.Health()->books;
  const ImpulseUnits applied_before = player.applied();
  player.Press();
  player.Run(0.2);
  player.Release();
  player.Run(0.1);
  Require(player.Until(settled, 3), "displayed is never covered by our acks");
  const protocol::Books after = player.Health()->books;
  const ImpulseUnits ours = Minus(player.applied(), applied_before);
  const ImpulseUnits theirs = Minus(after.applied, before.applied);
  Require(Largest(ours) > 0, "nothing was displayed");
  Require(after.covered == Plus(after.applied, after.discarded),
          "covered " + Text(after.covered) + " is not applied + discarded");
  Require(ours == theirs, "books.applied grew by " + Text(theirs) + ", we applied " + Text(ours));
}

void FalseAcks(WorldPlayer& player) {
  player.Press();
  const auto lie = [&](const std::function<void(WorldFrame&)>& amend) {
    player.amend = amend;
    player.Run(0.1);
    player.amend = nullptr;
    player.Run(0.05);
  };
  lie([](WorldFrame& frame) {
    frame.acked_tick += 1'000'000;
    frame.applied[0] += 123456789;
  });
  lie([](WorldFrame& frame) {
    frame.acked_epoch -= 12345;
    frame.applied[1] += 123456789;
  });
  lie([](WorldFrame& frame) {
    frame.acked_tick = std::max<std::uint64_t>(frame.acked_tick, 50) - 50;
    frame.baseline_tick = std::min(frame.baseline_tick, frame.acked_tick);
    frame.applied[2] += 123456789;
  });
  Require(player.DisplaysUs(), "false acks made it leave: planes are none the worse for them");
  player.Release();
  player.Run(0.1);
  if (!player.peer().Has(StreamType::kHapticHealth)) Inform("no haptic.health: books not seen");
  const auto settled = [&] {
    const auto health = player.Health();
    return health &&
           health->books.displayed == Plus(health->books.covered, health->books.peer_lost);
  };
  Require(player.Until(settled, 2), "after false acks the books never settle");
  const protocol::Books books = player.Health()->books;
  Require(books.covered == Plus(books.applied, books.discarded),
          "false acks were booked: covered " + Text(books.covered) + ", applied + discarded " +
              Text(Plus(books.applied, books.discarded)));
}

void Health(WorldPlayer& player) {
  if (!player.peer().Has(StreamType::kHapticHealth)) Unimplemented("no stream haptic.health");
  player.Couple();
  Require(player.Until([&] { return player.Health().has_value(); }, 2), "never published");
  const std::uint64_t ticks = player.Health()->ticks;
  Require(player.Until([&] { return player.Health()->ticks > ticks; }, 2), "does not go on");
  player.Run(0.3);
  const HapticHealth health = *player.Health();
  if (health.peer_epoch != player.segment().epoch()) {
    NotStrict("peer_epoch is not ours while it displays us");
  }
  if (health.peer_state != PeerState::kLive && health.peer_state != PeerState::kLate) {
    NotStrict("peer_state is " + std::to_string(static_cast<std::uint32_t>(health.peer_state)) +
              " while it displays us");
  }
  if (health.zero_force_after_ns == 0) NotStrict("zero_force_after_ns is not stated");
}

constexpr HapticCase kSegmentCases[] = {
    {"haptic/3.2-5/streams", Header},
    {"haptic/3.1-8/reserved", Reserved},
    {"haptic/5.2-10/epoch", Epoch},
    {"haptic/5.1-1/mode", Mode},
    {"haptic/3.1-4/heartbeat", Heartbeat},
    {"haptic/4.1-2/published", Publication},
    {"haptic/6.1-1/every-tick", RateAndAbsence},
};

constexpr HapticCase kContactCases[] = {
    {"haptic/5.3-3/attaches", Attaches},
    {"haptic/6.1-6/no-contact", NoContact},
    {"haptic/7.2-2/contact", Contact},
    {"haptic/5.5-7/pressed-hard", PressedHard},
    {"haptic/7.2-5/accounts", Accounts},
    {"haptic/5.5-3/three-frames", ThreeFrames},
    {"haptic/6.1-4/other-pointer", FarPointer},
    {"haptic/6.2-7/generation", Generations},
    {"haptic/7.6-2/closing", FreedAfterAck},
    {"haptic/7.2-6/no-channel", NoChannel},
    {"haptic/7.6-1/books", Books},
    {"haptic/7.6-4/false-acks", FalseAcks},
    {"haptic/6.3-1/health", Health},
};

template <const char* kId>
void Monitored(WorldPlayer& player) {
  if (player.seen().empty() || player.monitor().looks(kId) == 0) {
    player.Press();
    player.Run(0.3);
    player.Release();
    player.Run(0.1);
    player.Leave();
  }
  player.monitor().Report(kId);
}

void MonitoredSlew(WorldPlayer& player) {
  AsShould([&] { Monitored<kSlew>(player); });
}

constexpr HapticCase kMonitorCases[] = {
    {kSequence, Monitored<kSequence>},
    {kStamps, Monitored<kStamps>},
    {kSound, Monitored<kSound>},
    {kTickNumbers, Monitored<kTickNumbers>},
    {kDuration, Monitored<kDuration>},
    {kNames, Monitored<kNames>},
    {kNoWorld, Monitored<kNoWorld>},
    {kCap, Monitored<kCap>},
    {kSlew, MonitoredSlew},
    {kNeverShown, Monitored<kNeverShown>},
    {kImpulse, Monitored<kImpulse>},
    {kDrift, Monitored<kDrift>},
    {kMoment, Monitored<kMoment>},
    {kContactPoint, Monitored<kContactPoint>},
    {kFirstMoments, Monitored<kFirstMoments>},
    {kOpens, Monitored<kOpens>},
    {kHasChannel, Monitored<kHasChannel>},
    {kFreed, Monitored<kFreed>},
};

}  // namespace

std::span<const HapticCase> HapticSegmentCases() {
  return kSegmentCases;
}
std::span<const HapticCase> HapticContactCases() {
  return kContactCases;
}
std::span<const HapticCase> HapticMonitorCases() {
  return kMonitorCases;
}

}  // namespace rikiseki::protocol::check
