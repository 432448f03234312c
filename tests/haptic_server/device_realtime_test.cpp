// SPDX-License-Identifier: MIT
// The devices on the 1 kHz path, and what happens rarely there: nothing is allocated, nothing locked.
#include <catch2/catch.hpp>

#include "haptic_server/device/make_device.h"
#include "haptic_server/device/mouse/spidar_mouse.h"
#include "haptic_server/device/spidar_kinematics.h"
#include "haptic_server/device/tension.h"
#include "haptic_server/device/usb/usb_board.h"
#include "tests/haptic_server/device/g6x3.h"
#include "tests/haptic_server/guard.h"
#include "tests/usb/canned_port.h"
#include "tests/usb/written_mouse.h"

namespace rikiseki::haptic {
namespace {

TEST_CASE("eight strings: pose, suspect and tensions allocate nothing and lock nothing") {
  const SpidarPose kinematics(G6X3Motors(), G6X3Attachments());
  std::mt19937_64 random(1);
  const long allocations = test::Allocations();
  const long locks = test::Locks();
  double sum = 0;
  for (int i = 0; i < 500; ++i) {
    EightStrings lengths = kinematics.Lengths(RandomPose(random, 0.03, 0.5));
    const Pose pose = kinematics.Solve(lengths, Pose()).pose;
    lengths[static_cast<std::size_t>(i) % kGripStrings] += 5e-3;
    sum += kinematics.Suspect(lengths, pose).excess_m;
    const Wrench wrench{RandomInBall(random, i), RandomInBall(random, 0.01 * i)};
    sum += AllocateWrench(kinematics.StringsAt(pose), wrench, kG6X3Bounds, 1).tension[0];
  }
  REQUIRE(test::Allocations() == allocations);
  REQUIRE(test::Locks() == locks);
  REQUIRE(sum > 0);
}

TEST_CASE("four strings: a suspect and forces out of reach allocate nothing and lock nothing") {
  const double h = 0.265;
  const SpidarKinematics kinematics(
      {Vec3(-h, h, h), Vec3(h, h, -h), Vec3(-h, -h, -h), Vec3(h, -h, h)});
  std::mt19937_64 random(2);
  const long allocations = test::Allocations();
  const long locks = test::Locks();
  double sum = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec3 position = RandomInBall(random, 0.15);
    PerString lengths = kinematics.Lengths(position);
    lengths[static_cast<std::size_t>(i) % kTensionStrings] += 5e-3;
    sum += kinematics.Suspect(lengths, position).excess_m;
    std::array<Vec3, kTensionStrings> directions;
    for (std::size_t s = 0; s < kTensionStrings; ++s) {
      directions[s] = (kinematics.motor(s) - position).normalized();
    }
    sum += AllocateTensions(directions, RandomInBall(random, i), {0.5, 20}).tension[0];
  }
  REQUIRE(test::Allocations() == allocations);
  REQUIRE(test::Locks() == locks);
  REQUIRE(sum > 0);
}

TEST_CASE(
    "a grip, simulated and on the USB: reading, writing, a fault and letting go allocate nothing") {
  Settings settings;
  settings.spidar = G6X3Settings();
  settings.hand.home_mm = Vec3(-10, 0, 0);
  settings.hand.stroke_mm = Vec3(20, 5, 0);
  settings.usb.channels = {0, 1, 2, 3, 4, 5, 6, 7};
  settings.usb.count_directions = {1, 1, -1, -1, -1, -1, 1, 1};
  settings.usb.board = UsbBoardModel::kSh4;
  auto made = std::make_unique<test::CannedPort>(settings.usb.board);
  test::CannedPort& port = *made;
  const auto simulated = MakeDevice(settings);
  const auto usb = MakeSpidar(
      settings.spidar,
      std::make_unique<UsbBoard>(settings.usb, settings.spidar.tension_min_n, std::move(made)));
  std::mt19937_64 random(3);
  const long allocations = test::Allocations();
  const long locks = test::Locks();
  int read = 0;
  double sum = 0;
  for (std::int64_t tick = 0; tick < 1000; ++tick) {
    port.is_silent = tick % 100 > 60;
    for (Device* const device : {simulated.get(), usb.get()}) {
      DeviceSample sample;
      read += device->Read(tick * 1'000'000, sample) == DeviceStatus::kOk ? 1 : 0;
      sum += device->Write(RandomInBall(random, 0.1 * static_cast<double>(tick))).norm();
      if (tick % 10 == 0) device->Release();
    }
  }
  CHECK(test::Allocations() == allocations);
  CHECK(test::Locks() == locks);
  CHECK(read >= 1000 + 10 * 61);
  CHECK(read < 2000);
  CHECK(sum > 0);
}

TEST_CASE("boards on the USB: answered or not, the driver allocates nothing and locks nothing") {
  for (const UsbBoardModel model : {UsbBoardModel::kSimple, UsbBoardModel::kSh4}) {
    UsbSettings usb;
    usb.board = model;
    auto made = std::make_unique<test::CannedPort>(model);
    test::CannedPort& port = *made;
    UsbBoard board(usb, 0.5, std::move(made));
    EncoderCounts counts{};
    const long allocations = test::Allocations();
    const long locks = test::Locks();
    int read = 0;
    for (std::int64_t tick = 0; tick < 500; ++tick) {
      port.is_silent = tick % 100 > 60;  // long enough to be given up, and taken again
      read += board.ReadCounts(tick * 1'000'000, counts) ? 1 : 0;
      board.WriteTensions({1, 2, 3, 0.01 * static_cast<double>(tick)});
      read += *board.Trouble() == '\0' ? 0 : 1'000;
    }
    CHECK(test::Allocations() == allocations);
    CHECK(test::Locks() == locks);
    CHECK(read % 1'000 >= 5 * 61);
    CHECK(read > 1'000);
  }
}

TEST_CASE(
    "a SPIDAR-mouse: moved, stopped, answered or not, the driver allocates and locks nothing") {
  const test::WrittenMouse hand;
  MouseSettings settings;
  settings.event = hand.path();
  auto made = std::make_unique<test::CannedPort>(UsbBoardModel::kMouse);
  test::CannedPort& port = *made;
  SpidarMouse device(settings, 100, std::move(made));
  DeviceSample sample;
  const long allocations = test::Allocations();
  const long locks = test::Locks();
  int read = 0;
  for (std::int64_t tick = 0; tick < 500; ++tick) {
    port.is_silent = tick % 100 > 60;  // long enough to be given up, and taken again
    hand.Move(1, 2);
    read += device.Read(tick * 1'000'000, sample) == DeviceStatus::kOk ? 1 : 0;
    device.Write(Vec3(1, 0.01 * static_cast<double>(tick), 0));
    if (tick % 50 == 0) device.Release();
    read += *device.Trouble() == '\0' ? 0 : 1'000;
  }
  CHECK(test::Allocations() == allocations);
  CHECK(test::Locks() == locks);
  CHECK(read % 1'000 >= 5 * 61);
}

}  // namespace
}  // namespace rikiseki::haptic
