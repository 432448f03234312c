// SPDX-License-Identifier: MIT
// The SPIDAR-mouse over a port with its emulated firmware behind it, moved by an ordinary mouse that the test
// writes: what it shows is what the board was told, where it is is where the mouse went.
#include "haptic_server/device/mouse/spidar_mouse.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/usb/emulated_mouse.h"
#include "tests/usb/emulated_port.h"
#include "tests/usb/written_mouse.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;

MouseSettings SettingsFor(const std::string& event) {
  MouseSettings settings;
  settings.event = event;
  settings.count_length_m = 1e-4;
  settings.reach_m = {0.05, 0.03};
  settings.force_directions = {1, -1};
  return settings;
}

struct Rig {
  Rig() : Rig(std::make_unique<test::EmulatedPort>(board)) {}
  explicit Rig(std::unique_ptr<test::EmulatedPort> made)
      : port(made.get()), device(SettingsFor(hand.path()), 1000, std::move(made)) {}

  DeviceStatus Read() {
    port->now_ns += kTickNs;
    return device.Read(port->now_ns, sample);
  }

  test::EmulatedMouse board;
  test::WrittenMouse hand;
  test::EmulatedPort* port;
  SpidarMouse device;
  DeviceSample sample;
};

TEST_CASE("what is realised is what the board was told: in the plane, within its range") {
  Rig rig;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> component(-1.5, 1.5);
  int shown = 0;
  int cut = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wanted(component(random), component(random), component(random));
    const double plane_n = std::hypot(wanted.x(), wanted.y());
    REQUIRE(rig.Read() == DeviceStatus::kOk);
    const Vec3 realised = rig.device.Write(wanted);
    CAPTURE(wanted.transpose(), realised.transpose());
    // The board's y points the other way.
    CHECK(realised == Vec3(rig.board.force()[0], -rig.board.force()[1], 0));
    // Singles: 24 bits, rounded three times, and downwards by four of the last.
    CHECK(realised.norm() <= std::min(plane_n, 1.5));
    if (plane_n < 0.3) {
      CHECK(realised.isZero(0));
    } else if (plane_n > 0.3 * (1 + 1e-6)) {
      CHECK(realised.norm() > std::min(plane_n, 1.5) * (1 - 1e-6));
      CHECK((realised / realised.norm() - Vec3(wanted.x(), wanted.y(), 0) / plane_n).norm() < 1e-6);
      ++shown;
    }
    if (plane_n > 1.5) ++cut;
  }
  CHECK(shown > 1000);
  CHECK(cut > 100);
  CHECK(rig.board.starts() == 1);
  CHECK(rig.board.forces() == 2000);
  CHECK(rig.board.nonsense() == 0);
  CHECK(rig.board.range() == std::array<float, 4>{0.3F, 1.5F, 47.9867F, 13.1215F});
}

TEST_CASE("no force that is none is shown") {
  Rig rig;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  const double nan = std::nan("");
  for (const Vec3& bad : {Vec3(nan, 0, 0), Vec3(1, nan, 0), Vec3(INFINITY, 1, 0),
                          Vec3(-INFINITY, INFINITY, 0), Vec3(1e300, 1e300, nan)}) {
    const Vec3 realised = rig.device.Write(bad);
    CHECK(realised.allFinite());
    CHECK(realised.norm() <= 1.5);
    CHECK(rig.board.magnitude() <= 1.5);
  }
  CHECK(rig.board.nonsense() == 0);
}

TEST_CASE("the position follows the mouse, stays within the space, and is flat") {
  Rig rig;
  REQUIRE(rig.hand.Move(1000, 0));  // before it was read first: nowhere yet
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK(rig.sample.position.isZero(0));
  CHECK(rig.sample.velocity.isZero(0));
  REQUIRE(rig.hand.Move(100, 50));
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK((rig.sample.position - Vec3(0.01, -0.005, 0)).norm() < 1e-15);
  // One tick at 10 m/s and 5 m/s behind a low-pass of 1 kHz.
  const double weight = 1 - std::exp(-2 * M_PI);
  CHECK((rig.sample.velocity - weight * Vec3(10, -5, 0)).norm() < 1e-9);
  CHECK(rig.sample.target == rig.sample.position);
  REQUIRE(rig.hand.Move(10'000, -10'000));
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK(rig.sample.position == Vec3(0.05, 0.03, 0));
  // What was pushed beyond the edge is not to be pushed back.
  REQUIRE(rig.hand.Move(-100, 100));
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK((rig.sample.position - Vec3(0.04, 0.02, 0)).norm() < 1e-15);
}

TEST_CASE("let go, the board is stopped, and the next force starts it again") {
  Rig rig;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK(rig.device.Write(Vec3(1, 0, 0)).x() > 0.99);
  rig.device.Release();
  CHECK(!rig.board.is_started());
  CHECK(rig.board.stops() == 1);
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK(rig.device.Write(Vec3(0.5, 0, 0)).x() > 0.499);
  CHECK(rig.board.is_started());
  CHECK(rig.board.starts() == 2);
  CHECK(rig.board.nonsense() == 0);
}

TEST_CASE(
    "while the board is busy its last force goes on, and one that takes nothing is given up") {
  Rig rig;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  const Vec3 before = rig.device.Write(Vec3(1, 0, 0));
  rig.port->busy = true;
  for (int i = 0; i < kHopelessReports; ++i) {
    REQUIRE(rig.Read() == DeviceStatus::kOk);
    CHECK(rig.device.Write(Vec3(0, 1, 0)) == before);
  }
  CHECK(rig.Read() == DeviceStatus::kFault);
  CHECK(rig.port->given_up == UsbTrouble::kSilent);
  CHECK(rig.device.Write(Vec3(0, 1, 0)).isZero(0));
  CHECK(std::string(rig.device.Trouble()) == "SPIDAR: board does not answer");
  rig.port->busy = false;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK(rig.device.Write(Vec3(0, 1, 0)).y() > 0.99);
  CHECK(rig.board.starts() == 2);
}

TEST_CASE("a board or a mouse that is gone is a fault, and the position stays") {
  Rig rig;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  REQUIRE(rig.hand.Move(100, 0));
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  const Vec3 before = rig.sample.position;
  rig.port->plugged = false;
  CHECK(rig.Read() == DeviceStatus::kFault);
  CHECK(std::string(rig.device.Trouble()) == "SPIDAR: unplugged");
  rig.port->plugged = true;
  REQUIRE(rig.Read() == DeviceStatus::kOk);
  CHECK(rig.sample.position == before);
  CHECK(rig.sample.velocity.isZero(0));
  rig.hand.Unplug();
  CHECK(rig.Read() == DeviceStatus::kFault);
  CHECK(std::string(rig.device.Trouble()) == "SPIDAR-mouse: no ordinary mouse");
}

}  // namespace
}  // namespace rikiseki::haptic
