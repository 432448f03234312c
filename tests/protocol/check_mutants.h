// SPDX-License-Identifier: MIT
// Two tiny sides that keep SPEC.md, each a thread with a segment, and for every way to break it a switch:
// what the conformance kit must let pass, and what it must catch.
#pragma once

#include <atomic>
#include <string>
#include <thread>

namespace rikiseki::protocol::test {

enum class HapticFault {
  kNone,
  kPublishBeforeWrite,
  kCounterBackwards,
  kMomentAboutFinger,  // L in another frame
  kIncrements,         // the impulse of a tick instead of the total
  kWrongSign,          // J on the user
  kNominalTime,        // no correction by the true duration
  kPulls,              // the normal inverted
  kNoHeartbeat,
  kOldEpoch,  // the one of an earlier life
  kNeverReady,
  kForceForever,  // not zero when the world is silent
  kNoFirstLook,
  kNoSecondLook,
  kFreesEarly,     // a closed channel without waiting for the ack
  kKeepsChannels,  // over a restart of the world
  kTakesNonsense,
  kIgnoresHash,
  kRefusesMinor,
  kEverySecondTick,
  kBooksAnyAck,
  kNoThreeFrames,
  kOverCap,
  kNoClock,          // holds neither stamps nor counters against one
  kChannelForFixed,  // of what is the ground's
  kLosesLocal,       // the surface of a body that it may move by itself
};

enum class WorldFault {
  kNone,
  kAppliesTwice,
  kAcksAhead,  // without publishing what was applied
  kNoBaseline,
  kNormalInverted,
  kNormalNotUnit,
  kNoHeartbeat,
  kNoGapRule,
  kTakesForeign,
  kTakesUnknownBodies,
  kForgetsOldSegment,  // turns to the new epoch before the old one was read
  kFrameNumbers,
  kWrongDirection,
  kTakesNonsense,
  kNeverDetaches,
  kWaitsForHaptic,  // no frames alone
  kNoSecondLook,
  kIgnoresHash,
  kRefusesMinor,
  kPublishBeforeWrite,
  kNoClock,       // holds neither stamps nor counters against one
  kSaysFixed,     // of a body that can move
  kLocalInstead,  // a local body that is elsewhere
  kRestsDeep,     // a gap that counts from where bodies begin to touch
  kContactTwice,  // with either of its two bodies
};

class MiniHaptic {
 public:
  MiniHaptic(const std::string& instance, HapticFault fault);
  ~MiniHaptic();

 private:
  void Run();
  const std::string instance_;
  const HapticFault fault_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class MiniWorld {
 public:
  MiniWorld(const std::string& instance, WorldFault fault);
  ~MiniWorld();

 private:
  void Run();
  const std::string instance_;
  const WorldFault fault_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace rikiseki::protocol::test
