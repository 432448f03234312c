// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <span>

#include "haptic_server/device/hand.h"
#include "haptic_server/device/make_device.h"
#include "haptic_server/device/simulated_board.h"
#include "tests/haptic_server/device/scripted_board.h"

namespace rikiseki::haptic {
namespace {

SpidarSettings Cube() {
  SpidarSettings spidar;
  spidar.motors_m = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                     Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};
  return spidar;
}

EncoderCounts CountsAt(const Vec3& position) {
  const SpidarKinematics kinematics(Cube().motors_m);
  const PerString home = kinematics.Lengths(Vec3::Zero());
  const PerString lengths = kinematics.Lengths(position);
  EncoderCounts counts{};
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    counts[i] = std::llround((lengths[i] - home[i]) / Cube().count_length_m);
  }
  return counts;
}

TEST_CASE("the SPIDAR measures where the grip is, and how fast") {
  auto owned = std::make_unique<ScriptedBoard>();
  ScriptedBoard& board = *owned;
  Spidar spidar(Cube(), std::move(owned));
  DeviceSample sample;
  for (int k = 0; k <= 100; ++k) {
    const Vec3 position(0.0004 * k, -0.0002 * k, 0);  // 0.4, -0.2 m/s
    board.counts = CountsAt(position);
    REQUIRE(spidar.Read(k * 1'000'000, sample) == DeviceStatus::kOk);
    REQUIRE((sample.position - position).norm() < 27e-6);
    REQUIRE(sample.target == sample.position);
  }
  // One count is 29 mm/s by backward difference; the filter takes most of it away.
  REQUIRE((sample.velocity - Vec3(0.4, -0.2, 0)).norm() < 0.02);
}

TEST_CASE("an open enable input is told, even by a device whose strings slipped") {
  auto owned = std::make_unique<ScriptedBoard>();
  ScriptedBoard& board = *owned;
  Spidar spidar(Cube(), std::move(owned));
  DeviceSample sample;
  spidar.Read(0, sample);
  REQUIRE(sample.enabled);
  board.enabled = false;
  spidar.Read(1'000'000, sample);
  REQUIRE_FALSE(sample.enabled);
  sample = {};
  board.counts[1] += 400;
  REQUIRE(spidar.Read(2'000'000, sample) == DeviceStatus::kFault);
  REQUIRE_FALSE(sample.enabled);
}

TEST_CASE("a slipped string and a silent board are faults, and pass") {
  auto owned = std::make_unique<ScriptedBoard>();
  ScriptedBoard& board = *owned;
  Spidar spidar(Cube(), std::move(owned));
  DeviceSample sample;
  REQUIRE(spidar.Read(0, sample) == DeviceStatus::kOk);
  board.counts[1] += 400;  // 12 mm
  REQUIRE(spidar.Read(1'000'000, sample) == DeviceStatus::kFault);
  board.counts[1] = std::numeric_limits<std::int64_t>::max();
  REQUIRE(spidar.Read(2'000'000, sample) == DeviceStatus::kFault);
  board.counts[1] = 0;
  REQUIRE(spidar.Read(3'000'000, sample) == DeviceStatus::kOk);
  REQUIRE(sample.velocity.isZero(0));
  board.answers = false;
  REQUIRE(spidar.Read(4'000'000, sample) == DeviceStatus::kFault);
}

TEST_CASE("the SPIDAR names the string that slipped, until the strings agree again") {
  auto owned = std::make_unique<ScriptedBoard>();
  ScriptedBoard& board = *owned;
  Spidar spidar(Cube(), std::move(owned));
  DeviceSample sample;
  std::int64_t now_ns = 0;
  const auto read = [&](const Vec3& position, std::size_t wrong, std::int64_t excess_counts) {
    board.counts = CountsAt(position);
    board.counts[wrong] += excess_counts;
    return spidar.Read(now_ns += 1'000'000, sample);
  };
  for (std::size_t wrong = 0; wrong < kTensionStrings; ++wrong) {
    CAPTURE(wrong);
    const std::string name = "string " + std::to_string(wrong + 1) + " seems ";
    // All at once, in a hand that moves at 0.5 m/s.
    for (int k = 0; k <= 100; ++k) {
      REQUIRE(read(Vec3(0.0005 * k, 0, -0.01), wrong, 0) == DeviceStatus::kOk);
    }
    REQUIRE(spidar.Complaint().empty());
    REQUIRE(read(Vec3(0.0505, 0, -0.01), wrong, 200) == DeviceStatus::kFault);  // 5.8 mm
    // Of 5.85 mm; the others are right to a count.
    const std::string complaint = spidar.Complaint();
    REQUIRE(complaint.starts_with(name + "5."));
    REQUIRE(complaint.ends_with(" mm too long: it hangs slack or has slipped off"));
    // The name stays, whatever the hand does meanwhile.
    REQUIRE(read(Vec3(-0.05, 0.07, 0), wrong, 300) == DeviceStatus::kFault);
    REQUIRE(spidar.Complaint() == complaint);
    // Slowly, a count in a millisecond, in a hand at rest.
    const Vec3 rest(-0.03, 0.02, 0.04);
    REQUIRE(read(rest, wrong, 0) == DeviceStatus::kOk);
    REQUIRE(spidar.Complaint().empty());
    std::int64_t slipped = 0;
    while (read(rest, wrong, slipped) == DeviceStatus::kOk) --slipped;
    // 1 mm of residual is some 3 or 4 mm of one string.
    REQUIRE(slipped < -70);
    REQUIRE(slipped > -200);
    REQUIRE(spidar.Complaint().starts_with(name));
    REQUIRE(spidar.Complaint().find("too short") != std::string::npos);
    REQUIRE(read(rest, wrong, 0) == DeviceStatus::kOk);
  }
}

TEST_CASE("a SPIDAR that starts with strings that disagree names none") {
  auto owned = std::make_unique<ScriptedBoard>();
  ScriptedBoard& board = *owned;
  Spidar spidar(Cube(), std::move(owned));
  DeviceSample sample;
  board.counts[1] = 400;
  REQUIRE(spidar.Read(0, sample) == DeviceStatus::kFault);
  REQUIRE(spidar.Complaint().empty());
}

TEST_CASE("Write tells what the strings really display, Release lets go") {
  auto owned = std::make_unique<ScriptedBoard>();
  ScriptedBoard& board = *owned;
  Spidar spidar(Cube(), std::move(owned));
  DeviceSample sample;
  spidar.Read(0, sample);
  REQUIRE((spidar.Write(Vec3(3, 1, -2)) - Vec3(3, 1, -2)).norm() < 1e-11);
  REQUIRE(spidar.Write(Vec3(500, 0, 0)).norm() < 60);  // at most what the strings hold
  const std::span<const double> pulled(board.tension.data(), kTensionStrings);
  for (const double t : pulled) REQUIRE((t >= 0.5 && t <= 20));
  spidar.Release();
  for (const double t : pulled) REQUIRE(t == 0.5);
}

TEST_CASE("the simulated grip moves as hand and device under the string force") {
  Settings settings;
  settings.spidar = Cube();
  settings.hand.script = HandScript::kRest;
  settings.hand.home_mm = Vec3(20, -10, 30);
  const Vec3 home = settings.hand.home_mm * 1e-3;
  auto device = MakeDevice(settings);
  DeviceSample sample;
  const Vec3 force(4, -3, 1);
  for (std::int64_t k = 0; k < 3000; ++k) {
    REQUIRE(device->Read(k * 1'000'000, sample) == DeviceStatus::kOk);
    REQUIRE((device->Write(force) - force).norm() < 1e-11);
  }
  REQUIRE((sample.target - home).norm() < 1e-15);
  // The force is constant while it is allocated anew each millisecond at the measured position:
  // F/k.
  REQUIRE((sample.position - home - force / settings.hand.stiffness_n_per_m).norm() < 3e-5);
}

TEST_CASE("the simulated board keeps to the clock it is given") {
  Settings settings;
  settings.spidar = Cube();
  SimulatedBoard steady(settings.spidar, MakeHand(settings));
  SimulatedBoard jittery(settings.spidar, MakeHand(settings));
  EncoderCounts counts{};
  std::int64_t now = 5'000'000'000;
  jittery.ReadCounts(now, counts);
  for (int k = 0; k <= 400; ++k) steady.ReadCounts(7'000'000 + k * 1'000'000, counts);
  while (now < 5'400'000'000) {
    now = std::min<std::int64_t>(now + 1'700'000, 5'400'000'000);
    jittery.ReadCounts(now, counts);
  }
  REQUIRE(steady.hand()->now_ns() == 400'000'000);
  REQUIRE(jittery.hand()->now_ns() == 400'000'000);
  REQUIRE((steady.hand()->position() - jittery.hand()->position()).norm() < 1e-6);
}

TEST_CASE("tensions beyond the motors are clamped by the board itself") {
  Settings settings;
  settings.spidar = Cube();
  settings.hand.script = HandScript::kRest;
  settings.hand.home_mm.setZero();
  SimulatedBoard asked_too_much(settings.spidar, MakeHand(settings));
  SimulatedBoard at_limit(settings.spidar, MakeHand(settings));
  EncoderCounts counts{};
  asked_too_much.ReadCounts(0, counts);
  at_limit.ReadCounts(0, counts);
  asked_too_much.WriteTensions({1000, 0, 0.5, 5});
  at_limit.WriteTensions({20, 0.5, 0.5, 5});
  asked_too_much.ReadCounts(50'000'000, counts);
  at_limit.ReadCounts(50'000'000, counts);
  REQUIRE(asked_too_much.hand()->position() == at_limit.hand()->position());
  REQUIRE(at_limit.hand()->position().norm() > 1e-3);
}

TEST_CASE("a device that cannot be is refused at start") {
  Settings settings;
  REQUIRE_THROWS_AS(MakeDevice(settings), StartError);  // no motors
}

}  // namespace
}  // namespace rikiseki::haptic
