// SPDX-License-Identifier: MIT
// A haptic side under test, with a world that talks nonsense: what it must refuse, and that it goes on.
#include <atomic>
#include <cmath>
#include <limits>
#include <set>

#include "common/clock.h"
#include "protocol/tools/check/haptic_cases.h"
#include "protocol/tools/check/haptic_refusal.h"
#include "protocol/tools/check/header_cases.h"

namespace rikiseki::protocol::check {
namespace {

constexpr std::uint32_t kGhost = 666;   // a body that stands only in frames to be left alone
constexpr std::int64_t kWholeNs = 400;  // how long a message stays whole: as long as a copy takes
constexpr std::int64_t kFarFutureNs = 10'000'000'000;
constexpr std::uint64_t kLeap = 1'000'000;  // messages: hours of frames
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::size_t Head(const char* field) {
  return FieldOffset("world.frame", field);
}
/// Of the first plane.
std::size_t OfPlane(const char* field) {
  return RecordBytes("world.frame") + FieldOffset("world.frame/plane", field);
}

void NotANumber(WorldPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) { Poke(words, OfPlane("point"), kNaN); });
}
void Infinite(WorldPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) { Poke(words, OfPlane("normal"), kInfinity); });
}
void ZeroNormal(WorldPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) {
    for (std::size_t axis = 0; axis < 3; ++axis) Poke(words, OfPlane("normal") + 8 * axis, 0.0);
  });
}
void AbsurdCount(WorldPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) {
    Poke(words, Head("plane_count"), std::uint32_t{4'000'000'000});
  });
}
void OneTooMany(WorldPlayer& player) {
  Refuses(player, [](Words& words, Encoded& shape) {
    Poke(words, Head("plane_count"), std::uint32_t{kMaxPlanes + 1});
    shape.used_bytes += 8;
  });
}
void UnknownEnumerator(WorldPlayer& player) {
  Refuses(player, [](Words& words, Encoded&) { Poke(words, Head("coupling"), std::uint32_t{77}); });
}
void WrongPointer(WorldPlayer& player) {
  Refuses(player,
          [](Words& words, Encoded&) { Poke(words, OfPlane("pointer"), std::uint32_t{4}); });
}
void WrongPeriod(WorldPlayer& player) {
  Refuses(player,
          [](Words& words, Encoded&) { Poke(words, Head("period_ns"), std::uint64_t{1} << 62); });
}
void TooShort(WorldPlayer& player) {
  Refuses(player, [](Words&, Encoded& shape) { shape.used_bytes -= 8; });
}
void TooLong(WorldPlayer& player) {
  Refuses(player, [](Words&, Encoded& shape) { shape.used_bytes = 0xFFFFFFF8; });
}
void OddLength(WorldPlayer& player) {
  Refuses(player, [](Words&, Encoded& shape) { shape.used_bytes += 3; });
}

/// Good frames, after which it must have been left for good; a new segment is taken again.
void Detached(WorldPlayer& player, std::uint64_t last_good, const char* what) {
  player.Run(0.4);
  const HapticTick& tick = player.newest();
  Require(!player.DisplaysUs() || tick.world_frame <= last_good,
          std::string(what) + ", and frame " + std::to_string(tick.world_frame) +
              " is displayed all the same");
  Require(player.Until([&] { return player.Force() < kZeroForce; }, 1),
          std::string(what) + ", and the force stays");
  player.Leave();
  player.Couple();
}

void TenInARow(WorldPlayer& player) {
  player.Press();
  player.publishing = false;
  const std::uint64_t last_good = player.frame();
  for (int i = 0; i < 14; ++i) {
    player.PublishSpoilt(player.NextFrame(),
                         [](Words& words, Encoded&) { Poke(words, OfPlane("point"), kNaN); });
    player.Run(0.012);
  }
  player.publishing = true;
  Detached(player, last_good, "ten messages in a row were nonsense");
}

void Backwards(WorldPlayer& player) {
  player.Press();
  player.publishing = false;
  const std::uint64_t last_good = player.frame();
  const std::uint64_t number = player.writer().published();
  player.writer().SetPublished(number - 5);
  player.Run(0.1);
  player.writer().SetPublished(number);
  player.publishing = true;
  Detached(player, last_good, "the counter ran backwards");
}

// What the counter says could not have been published since the last look.
void Jumps(WorldPlayer& player) {
  player.Press();
  const std::uint64_t last_good = player.frame();
  player.Jump(kLeap);
  AsShould([&] { Detached(player, last_good, "published grew by a million messages at once"); });
}

void FromTheFuture(WorldPlayer& player) {
  Refuses(
      player, [](Words&, Encoded&) {}, kFarFutureNs);
}

// Older than the message before: nobody may be fooled into displaying the past, but it is no MUST.
void FromThePast(WorldPlayer& player) {
  player.Press();
  player.Run(0.1);
  std::set<std::uint64_t> past;
  const std::size_t from = player.seen().size();
  for (int i = 0; i < 3; ++i) {
    const WorldFrame frame = player.NextFrame();
    past.insert(frame.frame);
    player.judge().FramePublished(player.segment().epoch(), frame.frame, 0,
                                  std::span(frame.planes).first(frame.plane_count));
    Words words(kWorldFrameBytes / 8);
    const Encoded shape = Encode(frame, words);
    player.writer().Publish(std::span<const std::uint64_t>(words).first(shape.used_bytes / 8),
                            shape, static_cast<std::uint64_t>(MonotonicNow() - 1'000'000'000));
    player.Run(0.01);
  }
  const std::uint64_t good = player.frame();
  Require(player.Until([&] { return player.newest().world_frame > good; }, 1),
          "good frames after three with stamps of the past are not displayed");
  for (std::size_t i = from; i < player.seen().size(); ++i) {
    if (past.count(player.seen()[i].world_frame) != 0) {
      NotStrict("frame " + std::to_string(player.seen()[i].world_frame) +
                " is displayed, whose stamp is a second before that of the frame before");
    }
  }
}

// A world of the past: the numbers of the frames, not of the messages, go back.
void Stale(WorldPlayer& player) {
  player.Press();
  player.Run(0.2);
  player.judge().PoisonBody(kGhost);
  player.publishing = false;
  const std::uint64_t breaches = player.monitor().breaches(kNeverShown);
  for (int i = 0; i < 5; ++i) {
    WorldFrame frame = player.NextFrame();
    frame.frame -= 5;
    for (std::uint32_t p = 0; p < frame.plane_count; ++p) frame.planes[p].body = kGhost;
    player.Publish(frame);
    player.Run(0.02);
  }
  player.publishing = true;
  player.Run(0.05);
  Require(player.monitor().breaches(kNeverShown) == breaches,
          "planes of a frame whose number is smaller than the one before are displayed");
  Require(player.DisplaysUs(), "it left a world whose frames go on");
}

// [4.3-1], first look: published names a message that is still being written.
void FirstLook(WorldPlayer& player) {
  player.Press();
  player.judge().PoisonBody(kGhost);
  const std::uint64_t breaches = player.monitor().breaches(kNeverShown);
  player.publishing = false;
  for (int i = 0; i < 8; ++i) {
    WorldFrame frame = player.NextFrame();
    for (std::uint32_t p = 0; p < frame.plane_count; ++p) frame.planes[p].body = kGhost;
    Words words(kWorldFrameBytes / 8);
    const Encoded shape = Encode(frame, words);
    words.resize(shape.used_bytes / 8);
    const std::uint64_t number = player.writer().published();
    player.writer().PublishPartly(words, shape, 2);
    player.writer().SetPublished(number + 1);
    player.Run(0.01);
    player.Publish(player.NextFrame());
    player.Run(0.01);
  }
  player.publishing = true;
  Require(player.monitor().breaches(kNeverShown) == breaches,
          "a message was used whose sequence said that it was being written");
  Require(player.Until([&] { return player.newest().world_frame + 5 > player.frame(); }, 1),
          "it does not go on");
}

// [4.3-1], second look: of four slots, the newest message's is written again at once, and stays half
// written, with words that are not true. No reader that looks twice can use any of it, as sequences
// only grow.
void SecondLook(WorldPlayer& player) {
  player.Press();
  const std::vector<Plane> planes = player.planes;
  const std::int64_t period = player.period_ns;
  const std::uint64_t breaches = player.monitor().breaches(kNeverShown);
  player.Leave();
  player.judge().PoisonBody(kGhost);
  player.period_ns = 1'000;
  player.Open({}, SegmentState::kReady, kMinSlots);
  player.planes = planes;
  player.publishing = false;
  Words words(kWorldFrameBytes / 8);
  const WorldFrame first = player.NextFrame();
  const Encoded shape = Encode(first, words);
  words.resize(shape.used_bytes / 8);
  player.judge().FramePublished(player.segment().epoch(), 1'000'000'000, 0, {});
  const std::size_t frame_word = Head("frame") / 8;
  const std::size_t body_word = OfPlane("body") / 8;
  std::uint64_t lie = words[body_word];
  Poke(std::span(&lie, 1), OfPlane("body") % 8, kGhost);
  const Ring& ring = player.writer().ring();
  const auto store = [](std::uint64_t& word, std::uint64_t value) {
    std::atomic_ref<std::uint64_t>(word).store(value, std::memory_order_release);
  };
  const std::int64_t end = MonotonicNow() + 800'000'000;
  while (MonotonicNow() < end) {
    const std::int64_t burst = MonotonicNow() + 3'000'000;
    for (std::int64_t now = MonotonicNow(); now < burst; now = MonotonicNow()) {
      words[frame_word] = player.writer().published() + 1;
      player.writer().Publish(words, shape, static_cast<std::uint64_t>(now));
      const std::int64_t whole = MonotonicNow() + kWholeNs;
      while (MonotonicNow() < whole) {
      }
      const std::uint64_t number = player.writer().published();
      std::uint64_t* const slot = ring.Slot(number);
      store(slot[kSequenceWord], 2 * (number + ring.slot_count) - 1);
      store(slot[kPayloadWord + body_word], lie);
    }
    player.Step();
  }
  player.Leave();
  player.period_ns = period;
  player.Couple();
  Require(player.monitor().breaches(kNeverShown) == breaches,
          "a copy was used that the second look at the sequence would have thrown away");
}

void UnknownBlocks(WorldPlayer& player) {
  player.Press();
  player.publishing = false;
  for (int i = 0; i < 5; ++i) {
    const WorldFrame frame = player.NextFrame();
    Words words(kWorldFrameBytes / 8);
    Encoded shape = Encode(frame, words);
    Poke(words, shape.used_bytes, std::uint64_t{0xFFFF'FFFF'FFFF'FFFF});
    shape.used_bytes += 8;
    shape.blocks |= 1U << 31;
    player.judge().FramePublished(player.segment().epoch(), frame.frame, 0,
                                  std::span(frame.planes).first(frame.plane_count));
    player.writer().Publish(std::span<const std::uint64_t>(words).first(shape.used_bytes / 8),
                            shape, static_cast<std::uint64_t>(MonotonicNow()));
    player.Run(0.02);
  }
  const std::uint64_t newest = player.frame();
  const bool shown = player.Until([&] { return player.newest().world_frame == newest; }, 0.5);
  player.publishing = true;
  Require(shown, "a frame with a block of a later version is not displayed");
}

void Flood(WorldPlayer& player) {
  player.Press();
  const std::vector<Plane> planes = player.planes;
  const std::int64_t period = player.period_ns;
  player.Leave();
  player.period_ns = 50'000;
  player.Open();
  player.planes = planes;
  player.publishing = false;
  const std::size_t from = player.seen().size();
  const std::int64_t start = MonotonicNow();
  std::int64_t due = start;
  while (MonotonicNow() < start + 500'000'000) {
    for (; due < MonotonicNow(); due += player.period_ns) player.Publish(player.NextFrame());
    player.Until([&] { return MonotonicNow() >= due + 1'000'000; }, 0.01);
  }
  const std::size_t ticks = player.seen().size() - from;
  const bool displayed = player.DisplaysUs();
  player.Leave();
  player.period_ns = period;
  player.Couple();
  const auto nominal =
      static_cast<double>(500'000'000) /
      static_cast<double>(std::max<std::int64_t>(player.seen().back().period_ns, 1));
  Require(static_cast<double>(ticks) > 0.4 * nominal,
          "only " + std::to_string(ticks) + " ticks in half a second of 20 000 frames a second");
  if (!displayed) Inform("a world of 20 kHz is not displayed");
}

constexpr HapticCase kCases[] = {
    {"haptic/9.2-3/not-a-number", NotANumber},
    {"haptic/9.2-3/infinite", Infinite},
    {"haptic/9.2-4/zero-normal", ZeroNormal},
    {"haptic/9.2-2/absurd-count", AbsurdCount},
    {"haptic/9.2-2/one-plane-too-many", OneTooMany},
    {"haptic/9.2-3/enumerator", UnknownEnumerator},
    {"haptic/9.2-3/pointer-number", WrongPointer},
    {"haptic/9.2-3/period", WrongPeriod},
    {"haptic/9.2-2/too-short", TooShort},
    {"haptic/4.3-3/too-long", TooLong},
    {"haptic/9.2-2/odd-length", OddLength},
    {"haptic/9.2-6/ten-in-a-row", TenInARow},
    {"haptic/9.2-6/backwards", Backwards},
    {"haptic/9.2-8/future-stamp", FromTheFuture},
    {"haptic/9.2-9/jump", Jumps},
    {"haptic/9.2-10/past-stamp", FromThePast},
    {"haptic/6.2-3/stale", Stale},
    {"haptic/4.3-1/first-look", FirstLook},
    {"haptic/4.3-1/second-look", SecondLook},
    {"haptic/8.2-7/unknown-blocks", UnknownBlocks},
    {"haptic/6.1-1/flood", Flood},
    {"haptic/8.2-1/major", RefusesMajor},
    {"haptic/8.2-3/hash", RefusesHash},
    {"haptic/8.2-4/minor", TakesMinor},
    {"haptic/5.2-9/initialising", WaitsForReady},
    {"haptic/9.1-1/wrong-headers", RefusesWrongHeaders},
};

}  // namespace

std::span<const HapticCase> HapticNonsenseCases() {
  return kCases;
}

}  // namespace rikiseki::protocol::check
