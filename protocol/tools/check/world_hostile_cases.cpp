// SPDX-License-Identifier: MIT
// A world under test, with a haptic side that talks nonsense: what it must refuse, and that it goes on.
#include <atomic>
#include <cmath>
#include <limits>

#include "common/clock.h"
#include "protocol/tools/check/header_cases.h"
#include "protocol/tools/check/world_cases.h"

namespace rikiseki::protocol::check {
namespace {

constexpr std::int64_t kWholeNs = 400;  // how long a message stays whole: as long as a copy takes
constexpr std::int64_t kFarFutureNs = 10'000'000'000;
constexpr std::uint64_t kLeap = 10'000'000;  // messages: hours of ticks
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

using Words = std::vector<std::uint64_t>;
using Spoil = std::function<void(Words&, Encoded&)>;

std::size_t Head(const char* field) {
  return FieldOffset("haptic.tick", field);
}
std::size_t OfPointer(const char* field) {
  return RecordBytes("haptic.tick") + FieldOffset("haptic.tick/pointer", field);
}
std::size_t OfChannel(const char* field) {
  return RecordBytes("haptic.tick") + RecordBytes("haptic.tick/pointer") +
         FieldOffset("haptic.tick/channel", field);
}

/// Spoilt ticks among good ones: none is acknowledged, what they brought comes with the next.
void Refuses(HapticPlayer& player, const Spoil& spoil, std::int64_t stamp_offset_ns = 0) {
  player.Touch();
  const std::uint64_t sums = player.monitor().breaches(kSum);
  const std::uint64_t accepted = player.monitor().breaches(kRefused);
  const std::uint64_t rejected = player.peer().Counters().rejected;
  // As the newest of what one frame takes, so that its ack would show it.
  const std::uint64_t frame = player.newest().frame;
  for (int i = 0; i < 6; ++i) {
    player.Push({Units(i % 2 == 0 ? 0.001 : -0.001), 0, 0});
    player.publishing = false;
    player.PublishSpoilt(player.NextTick(), spoil, stamp_offset_ns);
    player.Until([&] { return player.newest().frame > frame + static_cast<std::uint64_t>(i); }, 1);
    player.publishing = true;
    player.Run(0.005);
  }
  Require(player.Settle(), "good ticks after spoilt ones are not acknowledged");
  if (player.monitor().breaches(kRefused) > accepted) player.monitor().Report(kRefused);
  if (player.monitor().breaches(kSum) > sums) player.monitor().Report(kSum);
  Require(player.Until([&] { return player.peer().Counters().rejected > rejected; }, 1),
          "the header's `rejected` does not count them");
}

void NotANumber(HapticPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) { Poke(words, OfPointer("position"), kNaN); });
}
void NotANumberMoment(HapticPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) { Poke(words, OfChannel("first_moment"), kNaN); });
}
void AbsurdCount(HapticPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) {
    Poke(words, Head("channel_count"), std::uint32_t{4'000'000'000});
  });
}
void OneTooMany(HapticPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) {
    Poke(words, Head("pointer_count"), std::uint32_t{kMaxPointers + 1});
  });
}
void UnknownEnumerator(HapticPlayer& player) {
  Refuses(player,
          [](Words& words, Encoded&) { Poke(words, OfPointer("reason"), std::uint32_t{999}); });
}
void WrongPointer(HapticPlayer& player) {
  Refuses(player,
          [](Words& words, Encoded&) { Poke(words, OfPointer("pointer"), std::uint32_t{4}); });
}
void NegativeRadius(HapticPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) { Poke(words, OfPointer("radius"), -1.0); });
}
void TooShort(HapticPlayer& player) {
  Refuses(player, [](Words&, Encoded& shape) { shape.used_bytes -= 8; });
}
void TooLong(HapticPlayer& player) {
  Refuses(player, [](Words&, Encoded& shape) { shape.used_bytes = 0xFFFFFFF8; });
}

/// A finger that is nowhere: sound numbers, and the world must live on.
void FarFinger(HapticPlayer& player) {
  player.Touch();
  player.position = {1e300, -1e300, 1e300};
  player.Run(player.Frames(4));
  player.position = player.target();
  const std::uint64_t frame = player.newest().frame;
  Require(player.Until([&] { return player.newest().frame > frame + 2; }, 2), "frames end");
  player.Touch();
}

void Detached(HapticPlayer& player, const char* what) {
  const std::uint64_t last = player.tick();
  player.Run(player.Frames(6) + 0.2);
  const bool left =
      player.newest().acked_epoch != player.segment().epoch() || player.newest().acked_tick <= last;
  player.Close();
  player.Open();
  player.Couple();
  Require(left, std::string(what) + ", and ticks after it are acknowledged");
}

void TenInARow(HapticPlayer& player) {
  player.Touch();
  Require(player.Settle(), "ticks are not acknowledged");
  player.publishing = false;
  for (int i = 0; i < 14; ++i) {
    player.PublishSpoilt(player.NextTick(),
                         [](Words& words, Encoded&) { Poke(words, OfPointer("position"), kNaN); });
  }
  player.Run(player.Frames(3));
  player.publishing = true;
  Detached(player, "ten messages in a row were nonsense");
}

void Backwards(HapticPlayer& player) {
  player.Touch();
  Require(player.Settle(), "ticks are not acknowledged");
  player.publishing = false;
  player.Run(player.Frames(2));
  const std::uint64_t number = player.writer().published();
  player.writer().SetPublished(number - 5);
  player.Run(player.Frames(3));
  player.writer().SetPublished(number);
  player.publishing = true;
  Detached(player, "the counter ran backwards");
}

// Of eight slots, so that the leap fills them all at once, and a lapped reader finds the message that it
// goes on with.
void Jumps(HapticPlayer& player) {
  constexpr std::uint32_t kSlots = 8;
  player.Touch();
  const Plane box = player.touched();
  player.Close();
  player.Open({}, SegmentState::kReady, kSlots);
  player.OpenChannel(box.body, box.generation);
  player.Couple();
  player.Run(player.Frames(2));
  player.Jump(kLeap);
  for (std::uint32_t i = 0; i < kSlots; ++i) player.Publish(player.NextTick());
  AsShould([&] { Detached(player, "published grew by ten million messages at once"); });
}

void FromTheFuture(HapticPlayer& player) {
  Refuses(
      player, [](Words&, Encoded&) {}, kFarFutureNs);
}

// Older than the message before, each as the newest of what one frame takes; no MUST.
void FromThePast(HapticPlayer& player) {
  player.Touch();
  Require(player.Settle(), "ticks are not acknowledged");
  bool taken = false;
  for (int i = 0; i < 4; ++i) {
    player.publishing = false;
    const HapticTick tick = player.NextTick();
    player.PublishAs(
        tick, [](Words&, Encoded&) {}, -1'000'000'000);
    const std::uint64_t frame = player.newest().frame;
    player.Until([&] { return player.newest().frame > frame + 1; }, 1);
    taken = taken || player.newest().acked_tick == tick.tick;
    player.publishing = true;
    player.Run(0.005);
  }
  Require(player.Settle(), "good ticks after four with stamps of the past are not acknowledged");
  if (taken) NotStrict("a tick is taken whose stamp is a second before that of the tick before");
}

void FirstLook(HapticPlayer& player) {
  player.Touch();
  const std::uint64_t sums = player.monitor().breaches(kSum);
  const std::uint64_t accepted = player.monitor().breaches(kRefused);
  for (int i = 0; i < 4; ++i) {
    player.publishing = false;
    HapticTick tick = player.NextTick();
    HapticTick lie = tick;
    lie.tick += 1'000'000;
    Words words(kHapticTickBytes / 8);
    const Encoded shape = Encode(lie, words);
    words.resize(shape.used_bytes / 8);
    const std::uint64_t number = player.writer().published();
    player.writer().PublishPartly(words, shape, 2);
    player.writer().SetPublished(number + 1);
    player.Run(player.Frames(2));
    // Whole at last, and true.
    player.writer().SetPublished(number);
    player.Publish(tick);
    player.publishing = true;
    player.Run(0.01);
  }
  Require(player.monitor().breaches(kRefused) == accepted &&
              player.monitor().breaches(kSum) == sums &&
              player.newest().acked_tick <= player.tick(),
          "a message was used whose sequence said that it was being written");
}

// Of four slots, the one that a lapped reader goes on with is written again at once, and stays half
// written, with a tick that was never performed.
void SecondLook(HapticPlayer& player) {
  player.Touch();
  const Plane box = player.touched();
  const std::int64_t period = player.period_ns;
  const std::uint64_t acks = player.monitor().breaches(kAckForward);
  player.Close();
  player.period_ns = 1'000;
  player.Open({}, SegmentState::kReady, kMinSlots);
  player.OpenChannel(box.body, box.generation);
  player.publishing = false;
  Words words(kHapticTickBytes / 8);
  const HapticTick first = player.NextTick();
  const Encoded shape = Encode(first, words);
  words.resize(shape.used_bytes / 8);
  const std::size_t tick_word = Head("tick") / 8;
  const Ring& ring = player.writer().ring();
  const auto store = [](std::uint64_t& word, std::uint64_t value) {
    std::atomic_ref<std::uint64_t>(word).store(value, std::memory_order_release);
  };
  player.PerformedAlike(100'000'000);
  const std::int64_t end = MonotonicNow() + 1'000'000'000;
  while (MonotonicNow() < end) {
    const std::int64_t burst = MonotonicNow() + 15'000'000;
    for (std::int64_t now = MonotonicNow(); now < burst; now = MonotonicNow()) {
      const std::uint64_t number = player.writer().published() + 1;
      words[tick_word] = number - 1;
      player.writer().Publish(words, shape, static_cast<std::uint64_t>(now));
      player.segment().Heartbeat(number, static_cast<std::uint64_t>(now));
      const std::int64_t whole = MonotonicNow() + kWholeNs;
      while (MonotonicNow() < whole) {
      }
      if (number < 2) continue;
      std::uint64_t* const slot = ring.Slot(number - 1);
      store(slot[kSequenceWord], 2 * (number - 1 + ring.slot_count) - 1);
      store(slot[kPayloadWord + tick_word], number + 1'000'000'000);
    }
    player.Step();
  }
  player.Close();
  player.period_ns = period;
  player.Open();
  player.Couple();
  Require(player.monitor().breaches(kAckForward) == acks,
          "a copy was used that the second look at the sequence would have thrown away");
}

void UnknownBlocks(HapticPlayer& player) {
  player.Touch();
  player.publishing = false;
  for (int i = 0; i < 5; ++i) {
    player.PublishAs(player.NextTick(), [](Words& words, Encoded& shape) {
      Poke(words, shape.used_bytes, std::uint64_t{0xFFFF'FFFF'FFFF'FFFF});
      shape.used_bytes += 8;
      shape.blocks |= 1U << 31;
    });
  }
  const bool taken = player.Settle(1);
  player.publishing = true;
  Require(taken, "a tick with a block of a later version is not acknowledged");
}

void Flood(HapticPlayer& player) {
  player.Touch();
  const Plane box = player.touched();
  player.Close();
  const std::int64_t period = player.period_ns;
  player.period_ns = 50'000;
  player.Open();
  player.OpenChannel(box.body, box.generation);
  player.Couple();
  player.publishing = false;
  const std::uint64_t sums = player.monitor().breaches(kSum);
  const std::uint64_t frame = player.newest().frame;
  const std::int64_t start = MonotonicNow();
  std::int64_t due = start;
  std::int64_t sign = 1;
  while (MonotonicNow() < start + 500'000'000) {
    for (; due < MonotonicNow(); due += player.period_ns) {
      player.each_tick = {sign * Units(1e-5), 0, 0};
      sign = -sign;
      player.Publish(player.NextTick());
    }
    player.Until([&] { return MonotonicNow() >= due + 1'000'000; }, 0.01);
  }
  player.each_tick = {};
  const double frames = static_cast<double>(player.newest().frame - frame);
  const double nominal = 0.5e9 / static_cast<double>(player.WorldPeriodNs());
  const bool settled = player.Settle(1);
  player.Close();
  player.period_ns = period;
  Require(frames > 0.4 * nominal,
          Num(frames) + " frames in half a second of 20 000 ticks a second");
  if (player.monitor().breaches(kSum) > sums) player.monitor().Report(kSum);
  if (!settled) Inform("a haptic side of 20 kHz is not acknowledged to its end");
}

constexpr WorldCase kCases[] = {
    {"world/9.2-3/not-a-number", NotANumber},
    {"world/9.2-3/not-a-number-moment", NotANumberMoment},
    {"world/9.2-2/absurd-count", AbsurdCount},
    {"world/9.2-2/one-pointer-too-many", OneTooMany},
    {"world/9.2-3/enumerator", UnknownEnumerator},
    {"world/9.2-3/pointer-number", WrongPointer},
    {"world/9.2-3/radius", NegativeRadius},
    {"world/9.2-2/too-short", TooShort},
    {"world/4.3-3/too-long", TooLong},
    {"world/9.2-7/far-finger", FarFinger},
    {"world/9.2-6/ten-in-a-row", TenInARow},
    {"world/9.2-6/backwards", Backwards},
    {"world/9.2-8/future-stamp", FromTheFuture},
    {"world/9.2-9/jump", Jumps},
    {"world/9.2-10/past-stamp", FromThePast},
    {"world/4.3-1/first-look", FirstLook},
    {"world/4.3-1/second-look", SecondLook},
    {"world/8.2-7/unknown-blocks", UnknownBlocks},
    {"world/6.2-1/flood", Flood},
    {"world/8.2-1/major", RefusesMajor},
    {"world/8.2-3/hash", RefusesHash},
    {"world/8.2-4/minor", TakesMinor},
    {"world/5.2-9/initialising", WaitsForReady},
    {"world/9.1-1/wrong-headers", RefusesWrongHeaders},
};

}  // namespace

std::span<const WorldCase> WorldNonsenseCases() {
  return kCases;
}

}  // namespace rikiseki::protocol::check
