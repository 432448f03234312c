// SPDX-License-Identifier: MIT
#include "haptic_server/device/replay.h"

#include <catch2/catch.hpp>

namespace rikiseki::haptic {
namespace {

TEST_CASE("a recording goes by its own time, from the first reading on, and ends with a fault") {
  Replay replay({{.time_ns = 1000, .position = Vec3(1, 0, 0), .velocity = Vec3(0, 1, 0)},
                 {.time_ns = 1010, .position = Vec3(2, 0, 0), .velocity = Vec3::Zero()},
                 {.time_ns = 1020, .position = Vec3(3, 0, 0), .velocity = Vec3::Zero()}});
  DeviceSample sample;
  REQUIRE(replay.Read(500, sample) == DeviceStatus::kOk);
  CHECK(sample.position.x() == 1);
  CHECK(sample.velocity.y() == 1);
  CHECK(sample.enabled);
  REQUIRE(replay.Read(509, sample) == DeviceStatus::kOk);
  CHECK(sample.position.x() == 1);
  CHECK(replay.Write(Vec3(1, 2, 3)) == Vec3(1, 2, 3));
  // Late by more than a sample: what is passed is passed.
  REQUIRE(replay.Read(520, sample) == DeviceStatus::kOk);
  CHECK(sample.position.x() == 3);
  CHECK(replay.Read(521, sample) == DeviceStatus::kFault);
  CHECK(replay.Read(1'000'000, sample) == DeviceStatus::kFault);
  CHECK(replay.Complaint() == "the recording is over");
}

TEST_CASE("an empty recording is no device") {
  CHECK_THROWS_AS(Replay({}), std::invalid_argument);
}

}  // namespace
}  // namespace rikiseki::haptic
