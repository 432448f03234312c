// SPDX-License-Identifier: MIT
// The whole daemon on an emulated SPIDAR-mouse, real libusb between: the force of a wall reaches the board,
// a board that comes back goes on, and every way out ends with a stop.
#include <signal.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

#include "protocol/words.h"
#include "tests/process/observer.h"
#include "tests/usb/emulated_bus.h"
#include "tests/usb/written_mouse.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::Role;

constexpr double kPatienceS = 20;
constexpr double kSlewLimit = 5000;    // N/s, as set
constexpr double kStiffness = 300;     // N/m, of the wall
constexpr double kCountLength = 1e-4;  // m
constexpr int kCountsToTouch = 400;    // the wall is 40 mm to the right of where the finger begins

struct MouseStatus {
  int started = 0;
  double x_n = 0;
  double y_n = 0;
  int forces = 0;
  int stops = 0;
  int nonsense = 0;
};

MouseStatus StatusOf(EmulatedBus& bus) {
  std::istringstream words(bus.Tell("mouse_status"));
  MouseStatus status;
  words >> status.started >> status.x_n >> status.y_n >> status.forces >> status.stops >>
      status.nonsense;
  return status;
}

std::vector<std::string> Command(EmulatedBus& bus, const std::string& instance,
                                 const std::string& event) {
  std::vector<std::string> command = {Program("haptic_server"),
                                      "--config",
                                      SourceFile("config/haptic_server.ini"),
                                      "--device",
                                      "mouse",
                                      "--instance",
                                      instance};
  for (const std::string& setting :
       {"device.file=" + SourceFile("config/devices/spidar_mouse.ini"), "mouse.event=" + event,
        "mouse.count_length_m=" + std::to_string(kCountLength),
        "loop.rate_hz=" + std::to_string(kUsbRateHz),
        "render.stiffness_n_per_m=" + std::to_string(kStiffness),
        std::string("mapping.origin_mm=-50 0 0")}) {
    command.insert(command.end(), {"--set", setting});
  }
  return bus.OnBus(command);
}

}  // namespace

TEST_CASE("a SPIDAR-mouse at a wall: what is published is what the board was told") {
  const Instance instance;
  const WrittenMouse hand;
  EmulatedBus bus("spidar4_simple.ini");
  bus.Tell("plug_mouse");
  const Child world({Program("world_server"), "--config", SourceFile("config/world_server.ini"),
                     "--scene", SourceFile("tests/process/wall.sdf"), "--instance", instance});
  Child haptic(Command(bus, instance, hand.path()));
  const auto view = Observe(instance, Role::kHaptic);
  TickWatch watch(instance, kSlewLimit);
  const auto device = [&] {
    const auto name = ReadHapticHealth(*view).device;
    return protocol::Printable(name.data(), name.size());
  };
  REQUIRE(
      Eventually([&] { return ReadHapticHealth(*view).peer_state == protocol::PeerState::kLive; },
                 kPatienceS));
  REQUIRE(Eventually([&] { return device() == "SPIDAR-mouse on USB"; }, kPatienceS));

  // Published by the haptic side, and pulled with by the board: `depth` counts into the wall, N.
  const auto shows = [&](double force_n) {
    return Eventually(
        [&] {
          return std::abs(watch.Latest().force_x - force_n) < 1e-5 &&
                 std::abs(StatusOf(bus).x_n - force_n) < 1e-5 && StatusOf(bus).y_n == 0;
        },
        kPatienceS);
  };
  REQUIRE(hand.Move(kCountsToTouch + 20, 0));
  CHECK(shows(-20 * kCountLength * kStiffness));
  CHECK(StatusOf(bus).started == 1);
  REQUIRE(hand.Move(-12, 0));  // 0.24 N, which the board cannot show
  CHECK(shows(0));
  REQUIRE(hand.Move(100, 0));  // more than it can
  CHECK(shows(-1.5));

  bus.Tell("unplug_mouse");
  CHECK(Eventually([&] { return device() == "SPIDAR: unplugged"; }, kPatienceS));
  CHECK(Eventually([&] { return watch.Latest().force == 0; }, kPatienceS));
  bus.Tell("plug_mouse");
  CHECK(Eventually([&] { return device() == "SPIDAR-mouse on USB"; }, kPatienceS));
  CHECK(shows(-1.5));

  haptic.Signal(SIGTERM);
  CHECK(haptic.Wait() == 0);
  CheckSafe(watch);
  const MouseStatus end = StatusOf(bus);
  CHECK(end.started == 0);
  CHECK(end.stops > 0);
  CHECK(end.nonsense == 0);
}

TEST_CASE("a check says which SPIDAR-mouse and which mouse would be used, or why none") {
  EmulatedBus bus("spidar4_simple.ini");
  const auto check = [&](const std::string& event) {
    std::string command;
    for (const std::string& word : Command(bus, "check", event)) command += "'" + word + "' ";
    // Its stdout, by the way of a shell that sends it to where the test reads.
    Child child({"/bin/sh", "-c", command + "--check 1>&2"});
    CHECK(child.Wait() == 0);
    return child.Stderr();
  };
  CHECK_THAT(check("/dev/null"), Contains("no board SPIDAR-mouse (04D8:003F) is plugged in"));
  bus.Tell("plug_mouse");
  CHECK_THAT(check("/dev/null"), Contains("board SPIDAR-mouse (04D8:003F) at bus 1 device 5") &&
                                     Contains("mouse.event = /dev/null is no event device"));
  const WrittenMouse hand;
  CHECK_THAT(check(hand.path()), Contains("the mouse at " + hand.path() + " tells where it is"));
  CHECK(StatusOf(bus).started == 0);
}
