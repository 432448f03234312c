// SPDX-License-Identifier: MIT
#include "haptic_server/safety/peer_watch.h"

#include <catch2/catch.hpp>

namespace rikiseki::haptic {
namespace {

using protocol::PeerState;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kWorldPeriod = 50 * kMs;

// A world of 20 Hz as the watch sees it each millisecond.
struct Bench {
  PeerWatch watch{Settings{}};
  std::int64_t now_ns = 1'000 * kMs;
  std::uint64_t epoch = 9;
  bool ready = true;
  bool beats = true;
  std::int64_t heartbeat_ns = 0;

  PeerState Step(bool frame, bool force_is_zero = true, std::int64_t period = kWorldPeriod) {
    now_ns += kMs;
    if (beats) heartbeat_ns = now_ns;
    return watch.Update(now_ns,
                        {.epoch = epoch,
                         .ready = ready,
                         .heartbeat_ns = heartbeat_ns,
                         .fresh_frame = frame,
                         .frame_period_ns = frame ? period : 0},
                        force_is_zero);
  }
  PeerState Wait(int ms, bool force_is_zero = true) {
    PeerState state = watch.state();
    for (int i = 0; i < ms; ++i) state = Step(false, force_is_zero);
    return state;
  }
  void GoLive() {
    for (int i = 0; i < 3; ++i) {
      Step(true);
      if (i < 2) Wait(49);
    }
    REQUIRE(watch.state() == PeerState::kLive);
  }
};

TEST_CASE("a world counts after three fresh frames") {
  Bench bench;
  REQUIRE(bench.Step(false) == PeerState::kWaiting);
  REQUIRE(bench.watch.Accepts(9));
  REQUIRE_FALSE(bench.watch.Accepts(8));
  REQUIRE(bench.Step(true) == PeerState::kWaiting);
  bench.Wait(49);
  REQUIRE(bench.Step(true) == PeerState::kWaiting);
  bench.Wait(49);
  REQUIRE(bench.Step(true) == PeerState::kLive);
  REQUIRE(bench.watch.world_period_ns() == kWorldPeriod);
}

TEST_CASE("frames before a long silence do not count as fresh") {
  Bench bench;
  bench.Step(true);
  bench.Wait(49);
  bench.Step(true);
  bench.Wait(2000);
  REQUIRE(bench.Step(true) == PeerState::kWaiting);
}

TEST_CASE("nothing, a peer that is not ready and one without heartbeat are absent") {
  Bench bench;
  bench.epoch = 0;
  REQUIRE(bench.Step(false) == PeerState::kAbsent);
  bench.epoch = 9;
  bench.ready = false;
  REQUIRE(bench.Step(true) == PeerState::kAbsent);
  bench.ready = true;
  bench.beats = false;
  bench.heartbeat_ns = bench.now_ns;
  // No frame told a period yet, so the longest one counts: 5 x 200 ms.
  REQUIRE(bench.Wait(1000) == PeerState::kWaiting);
  REQUIRE(bench.Step(false) == PeerState::kAbsent);
  REQUIRE(bench.watch.epoch() == 0);
}

TEST_CASE("late at 2.5 periods, live again at once, lost at 5 periods but not before 250 ms") {
  Bench bench;
  bench.GoLive();
  REQUIRE(bench.Wait(125) == PeerState::kLive);
  REQUIRE(bench.Step(false) == PeerState::kLate);
  REQUIRE(bench.Step(true) == PeerState::kLive);
  REQUIRE(bench.Wait(250) == PeerState::kLate);
  REQUIRE(bench.Step(false) == PeerState::kLost);
  REQUIRE(bench.Step(true, false) == PeerState::kLost);  // no way back but through absent
  REQUIRE_FALSE(bench.watch.Accepts(9));
  REQUIRE(bench.Step(false, true) == PeerState::kAbsent);
  REQUIRE(bench.Step(false) == PeerState::kWaiting);
}

TEST_CASE("a world that is closed, dead or replaced is lost at once") {
  Bench bench;
  bench.GoLive();
  SECTION("closed") {
    bench.ready = false;
  }
  SECTION("replaced") {
    bench.epoch = 10;
  }
  SECTION("gone") {
    bench.epoch = 0;
  }
  REQUIRE(bench.Step(true, false) == PeerState::kLost);
  REQUIRE(bench.Wait(1000, false) == PeerState::kLost);  // until its force is gone
  REQUIRE(bench.Step(false, true) == PeerState::kAbsent);
}

TEST_CASE("a world that sends frames but whose heart stopped is lost") {
  Bench bench;
  bench.GoLive();
  bench.beats = false;
  PeerState state = PeerState::kLive;
  int ms = 0;
  for (; state != PeerState::kLost && ms < 1000; ++ms) state = bench.Step(ms % 50 == 0, false);
  REQUIRE(ms == 251);
}

TEST_CASE("a world cannot talk itself out of being watched by a long period") {
  Bench bench;
  bench.GoLive();
  bench.Step(true, false, 9'000 * kMs);
  REQUIRE(bench.Wait(1000, false) == PeerState::kLate);  // 5 of the longest period of 200 ms
  REQUIRE(bench.Step(false, false) == PeerState::kLost);
}

}  // namespace
}  // namespace rikiseki::haptic
