// SPDX-License-Identifier: MIT
// The emergency stop of a real haptic_server: by signal and by key, in contact and before there is
// any; latched, and back through the soft start.
#include <signal.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "tests/process/child.h"
#include "tests/process/observer.h"
#include "tests/process/terminal.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using protocol::ForceReason;
using protocol::Role;

constexpr double kSlewLimit = 5000;  // N/s, set below
constexpr double kSoftStartS = 0.2;  // likewise
constexpr double kForceCap = 10;     // N, likewise

// A hand that reaches into the block and stays there, so that a contact is not over too soon.
std::vector<std::string> HapticCommand(const std::string& instance) {
  std::vector<std::string> command = {Program("haptic_server"), "--config",
                                      SourceFile("config/haptic_server.ini"), "--instance",
                                      instance};
  for (const char* setting :
       {"safety.slew_limit_n_per_s=5000", "safety.soft_start_ms=200", "safety.force_cap_n=10",
        "hand.hold_ms=100000", "hand.stroke_mm=60 0 0"}) {
    command.insert(command.end(), {"--set", setting});
  }
  return command;
}

// A wall that does not yield.
std::vector<std::string> WorldCommand(const std::string& instance) {
  return {Program("world_server"),
          "--config",
          SourceFile("config/world_server.ini"),
          "--scene",
          SourceFile("tests/process/wall.sdf"),
          "--instance",
          instance};
}

void Sleep(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

bool Is(const TickWatch& watch, ForceReason reason) {
  return Eventually([&] { return watch.Latest().reason == reason; }, 5);
}

// From the first stopped tick on: no force in any tick, however long; and the tick before had one.
void CheckStoppedAtOnce(const std::vector<WatchedTick>& ticks) {
  bool stopped = false;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    if (ticks[i].reason != ForceReason::kEmergencyStop) {
      CHECK_FALSE(stopped);  // latched
      continue;
    }
    if (!stopped) CHECK(ticks[i - 1].force > 1);
    stopped = true;
    if (ticks[i].force != 0) FAIL_CHECK("force in stopped tick " << ticks[i].tick);
  }
  CHECK(stopped);
}

}  // namespace

TEST_CASE("SIGUSR1 in contact: no force at once and for good, and SIGUSR2 brings it back softly") {
  const Instance instance;
  Child world(WorldCommand(instance));
  Child haptic(HapticCommand(instance));
  TickWatch watch(instance, kSlewLimit);
  const auto view = Observe(instance, Role::kHaptic);
  REQUIRE(Eventually([&] { return watch.Latest().force > 3; }, 15));
  haptic.Signal(SIGUSR1);
  REQUIRE(Is(watch, ForceReason::kEmergencyStop));
  Sleep(700);
  CheckStoppedAtOnce(watch.All());
  CHECK(ReadHapticHealth(*view).reason == ForceReason::kEmergencyStop);

  const std::size_t stopped_ticks = watch.All().size();
  haptic.Signal(SIGUSR2);
  REQUIRE(Eventually([&] { return watch.Latest().force > 3; }, 5));
  const std::vector<WatchedTick> ticks = watch.All();
  double before = 0;
  bool soft = false;
  for (std::size_t i = stopped_ticks; i < ticks.size(); ++i) {
    if (ticks[i].reason != ForceReason::kSoftStart) continue;
    soft = true;
    // The gain grows by T / soft start a tick, and the hand, no longer held back, moves on as well.
    CHECK(ticks[i].force - before <= kForceCap / (kSoftStartS * 1000) + 0.5);
    before = ticks[i].force;
  }
  CHECK(soft);
  CheckSafe(watch);
  haptic.Signal(SIGUSR1);
  REQUIRE(Is(watch, ForceReason::kEmergencyStop));
  CHECK(Norm(ReadHapticHealth(*view).books.ground) > 0);  // a wall that cannot move is the ground
  haptic.Signal(SIGTERM);                                 // stopped, there is nothing to fade
  CHECK(haptic.Wait() == 0);
}

TEST_CASE("a stop that comes before the world keeps the force away when the world comes") {
  const Instance instance;
  Child haptic(HapticCommand(instance));
  TickWatch watch(instance, kSlewLimit);
  haptic.Signal(SIGUSR1);
  REQUIRE(Is(watch, ForceReason::kEmergencyStop));
  Child world(WorldCommand(instance));
  REQUIRE(Eventually([&] { return watch.Latest().finger_x > -0.005; }, 15));  // deep in the wall
  for (const WatchedTick& tick : watch.All()) REQUIRE(tick.force == 0);
  haptic.Signal(SIGUSR2);
  CHECK(Eventually([&] { return watch.Latest().force > 1; }, 5));
  CheckSafe(watch);
}

TEST_CASE("keys of the terminal stop, enable and clutch, and it gets its settings back") {
  const Instance instance;
  Child world(WorldCommand(instance));
  OnTerminal haptic(HapticCommand(instance));
  TickWatch watch(instance, kSlewLimit);
  REQUIRE(Eventually([&] { return watch.Latest().force > 3; }, 15));
  CHECK_FALSE(haptic.Echoes());
  for (const char stop : {' ', '\r'}) {
    haptic.Press(stop);
    REQUIRE(Is(watch, ForceReason::kEmergencyStop));
    haptic.Press('x');
    Sleep(100);
    CHECK(watch.Latest().reason == ForceReason::kEmergencyStop);
    haptic.Press('e');
    REQUIRE(Eventually([&] { return watch.Latest().force > 3; }, 5));
  }
  haptic.Press('c');
  REQUIRE(Is(watch, ForceReason::kClutched));
  const double there = watch.Latest().finger_x;
  Sleep(100);
  CHECK(watch.Latest().finger_x == there);
  CHECK(watch.Latest().force < 1e-12);
  haptic.Press('c');
  CHECK(Eventually([&] { return watch.Latest().reason != ForceReason::kClutched; }, 5));
  CheckSafe(watch);
  haptic.Signal(SIGTERM);
  CHECK(haptic.Wait() == 0);
  CHECK(haptic.Echoes());
}
