// SPDX-License-Identifier: MIT
// An ordinary mouse through a pipe with a name: what it went, and what is said where there is none.
#include "haptic_server/device/mouse/event_mouse.h"

#include <catch2/catch.hpp>
#include <cstring>

#include "common/clock.h"
#include "tests/usb/written_mouse.h"

namespace rikiseki::haptic {
namespace {

using Catch::Matchers::Contains;
using test::WrittenMouse;

// By the supervisor's thread, four times a second; the patience is for a machine that others use.
bool IsThere(EventMouse& mouse) {
  for (int i = 0; i < 2000; ++i) {
    if (mouse.Read()) return true;
    SleepUntil(MonotonicNow() + 10'000'000);
  }
  return false;
}

TEST_CASE("every count arrives once, right and away from the hand, and nothing else does") {
  const WrittenMouse hand;
  EventMouse mouse(hand.path());
  REQUIRE(mouse.Read());
  CHECK(std::strlen(mouse.Trouble()) == 0);
  CHECK(mouse.Complaint().empty());
  REQUIRE(hand.Move(3, 5));
  REQUIRE(hand.Click());
  REQUIRE(hand.Move(-10, 1));
  const auto way = mouse.Read();
  REQUIRE(way);
  CHECK(way->x == -7);
  CHECK(way->y == -6);
  // More at once than one call reads.
  for (int i = 0; i < 400; ++i) REQUIRE(hand.Move(1, -2));
  MouseWay last;
  for (int i = 0; i < 4; ++i) last = mouse.Read().value_or(MouseWay{});
  CHECK(last.x == -7 + 400);
  CHECK(last.y == -6 + 800);
}

TEST_CASE("a mouse that goes is missed, and one that comes is taken") {
  WrittenMouse hand;
  EventMouse mouse(hand.path());
  REQUIRE(hand.Move(4, 0));
  REQUIRE(mouse.Read());
  hand.Unplug();
  CHECK(!mouse.Read());
  CHECK(std::string(mouse.Trouble()) == "SPIDAR-mouse: no ordinary mouse");
  hand.Plug();
  REQUIRE(IsThere(mouse));
  CHECK(std::strlen(mouse.Trouble()) == 0);
  REQUIRE(hand.Move(2, 0));
  CHECK(mouse.Read()->x == 6);
}

TEST_CASE("what is no mouse, or may not be read, is said with the cure") {
  EventMouse nothing("/dev/input/by-id/no-such-event-mouse");
  CHECK(!nothing.Read());
  CHECK(std::strlen(nothing.Trouble()) <= 31);  // what haptic_status shows
  CHECK_THAT(nothing.Complaint(), Contains("mouse.event = /dev/input/by-id/no-such-event-mouse") &&
                                      Contains("/dev/input/by-id/*-event-mouse"));
  for (const char* path : {"/dev/null", "/etc/passwd", "/tmp"}) {
    EventMouse other(path);
    CAPTURE(path);
    CHECK(!other.Read());
    CHECK(std::string(other.Trouble()) == "SPIDAR-mouse: not a mouse");
    CHECK_THAT(other.Complaint(), Contains("relative axes"));
  }
}

}  // namespace
}  // namespace rikiseki::haptic
