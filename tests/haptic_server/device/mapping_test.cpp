// SPDX-License-Identifier: MIT
#include "haptic_server/device/mapping.h"

#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

namespace rikiseki::haptic {
namespace {

bool SameBits(const Vec3& a, const Vec3& b) {
  for (int i = 0; i < 3; ++i) {
    if (std::bit_cast<std::uint64_t>(a[i]) != std::bit_cast<std::uint64_t>(b[i])) return false;
  }
  return true;
}

MappingSettings Skew() {
  return {.origin_mm = Vec3(100, -20, 30),
          .rotation_deg = Vec3(20, -35, 110),
          .motion_scale = 5,
          .force_scale = 0.2};
}

TEST_CASE("what is put into the world comes back to the device") {
  MappingSettings settings;
  settings.origin_mm = Vec3(100, -20, 5);
  settings.rotation_deg = Vec3(10, 20, -130);
  settings.motion_scale = 3;
  const Mapping mapping(settings);
  const Vec3 point(0.01, -0.02, 0.03);
  // A handful of roundings of numbers below 1.
  CHECK((mapping.PointOnDevice(mapping.PointInWorld(point)) - point).norm() < 1e-15);
  CHECK((mapping.VelocityOnDevice(mapping.VelocityInWorld(point)) - point).norm() < 1e-15);
}

TEST_CASE("the default mapping leaves every bit alone, whatever comes") {
  Mapping mapping(MappingSettings{});
  const double values[] = {0.0,     -0.0,   1,        -1.0 / 3,      0.1,      1e-310,   -5e300,
                           1.7e308, 5e-324, -29.2e-6, std::nan("7"), INFINITY, -INFINITY};
  std::mt19937_64 random(1);
  const auto any = [&] { return values[random() % std::size(values)]; };
  for (int k = 0; k < 2000; ++k) {
    const Vec3 v(any(), any(), any());
    REQUIRE(SameBits(mapping.Follow(v, false), v));
    REQUIRE(SameBits(mapping.PointInWorld(v), v));
    REQUIRE(SameBits(mapping.VelocityInWorld(v), v));
    REQUIRE(SameBits(mapping.ForceInWorld(v), v));
    REQUIRE(SameBits(mapping.ForceOnDevice(v), v));
  }
  REQUIRE(mapping.force_in_world() == 1);
  REQUIRE(mapping.energy_on_device() == 1);
}

TEST_CASE("roll, pitch and yaw turn about the fixed axes, in that order") {
  // Roll 90: y -> z.  Pitch 90: z -> x.  Yaw 90: x -> y.
  Mapping roll({.rotation_deg = Vec3(90, 0, 0)});
  REQUIRE((roll.VelocityInWorld(Vec3::UnitY()) - Vec3::UnitZ()).norm() < 1e-15);
  Mapping all({.rotation_deg = Vec3(90, 90, 90)});
  REQUIRE((all.VelocityInWorld(Vec3::UnitY()) - Vec3::UnitY()).norm() < 1e-15);  // y -> z -> x -> y
  REQUIRE((all.VelocityInWorld(Vec3::UnitX()) + Vec3::UnitZ()).norm() < 1e-15);  // x, x -> -z, -z
}

TEST_CASE("the scaled and turned mapping is the written one") {
  Mapping mapping(Skew());
  REQUIRE((mapping.PointInWorld(Vec3::Zero()) - Vec3(0.1, -0.02, 0.03)).norm() < 1e-15);
  const Vec3 a(0.01, -0.02, 0.005);
  const Vec3 b(-0.03, 0.001, 0.02);
  const Vec3 apart = mapping.PointInWorld(b) - mapping.PointInWorld(a);
  REQUIRE(apart.norm() == Approx(5 * (b - a).norm()).epsilon(1e-14));
  REQUIRE((apart - mapping.VelocityInWorld(b - a)).norm() < 1e-15);

  const Vec3 f(1, -2, 0.5);
  REQUIRE(mapping.ForceOnDevice(f).norm() == Approx(0.2 * f.norm()).epsilon(1e-14));
  REQUIRE((mapping.ForceInWorld(mapping.ForceOnDevice(f)) - f).norm() < 1e-14);
  // Work at the device is s_f/s_x of that in the world: the hand feels s_f s_x k.
  REQUIRE(mapping.ForceOnDevice(f).dot(b - a) ==
          Approx(mapping.energy_on_device() * f.dot(apart)).epsilon(1e-12));
  const double k = 2000;
  const Vec3 felt = mapping.ForceOnDevice(-k * apart);
  REQUIRE((felt + 0.2 * 5 * k * (b - a)).norm() < 1e-10);
}

TEST_CASE("a clutched finger stays, and goes on from there when it is let in") {
  for (const MappingSettings& settings : {MappingSettings{}, Skew()}) {
    Mapping mapping(settings);
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> step(-0.003, 0.003);
    Vec3 hand(0.02, 0, 0.01);
    Vec3 finger = mapping.Follow(hand, false);
    bool clutched = false;
    for (int k = 0; k < 5000; ++k) {
      if (random() % 100 == 0) clutched = !clutched;
      const Vec3 move(step(random), step(random), step(random));
      hand += move;
      const Vec3 next = mapping.Follow(hand, clutched);
      if (clutched) {
        REQUIRE(SameBits(next, finger));
      } else {
        REQUIRE((next - finger - mapping.VelocityInWorld(move)).norm() < 1e-12);
      }
      finger = next;
    }
  }
}

TEST_CASE("a clutch that is engaged from the start holds the first place") {
  Mapping mapping(Skew());
  const Vec3 first = mapping.Follow(Vec3(0.01, 0, 0), true);
  REQUIRE((first - mapping.PointInWorld(Vec3(0.01, 0, 0))).norm() == 0);
  REQUIRE(SameBits(mapping.Follow(Vec3(0.05, 0.1, 0), true), first));
}

}  // namespace
}  // namespace rikiseki::haptic
