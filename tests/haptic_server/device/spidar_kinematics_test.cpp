// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar_kinematics.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace rikiseki::haptic {
namespace {

const std::vector<Vec3> kCube = {Vec3(-0.265, 0.265, 0.265), Vec3(0.265, 0.265, -0.265),
                                 Vec3(-0.265, -0.265, -0.265), Vec3(0.265, -0.265, 0.265)};

Vec3 InBall(std::mt19937_64& random, double radius) {
  std::uniform_real_distribution<double> uniform(-radius, radius);
  Vec3 p;
  do {
    p = Vec3(uniform(random), uniform(random), uniform(random));
  } while (p.norm() > radius);
  return p;
}

TEST_CASE("positions come back to 1e-12 m within three iterations") {
  const SpidarKinematics kinematics(kCube);
  std::mt19937_64 random(1);
  for (int i = 0; i < 20'000; ++i) {
    const Vec3 position = InBall(random, 0.24);
    const auto fix = kinematics.Solve(kinematics.Lengths(position));
    REQUIRE((fix.position - position).norm() <= 1e-12);
    REQUIRE(fix.iterations <= 3);
    REQUIRE(fix.residual_m <= 1e-12);
  }
}

TEST_CASE("lengths rounded to counts leave at most 27 um within 0.15 m of the centre") {
  const double count_length = 2.92e-5;
  const SpidarKinematics kinematics(kCube);
  std::mt19937_64 random(2);
  double worst = 0;
  double worst_residual = 0;
  for (int i = 0; i < 50'000; ++i) {
    const Vec3 position = InBall(random, 0.15);
    PerString lengths = kinematics.Lengths(position);
    for (double& length : lengths) length = std::round(length / count_length) * count_length;
    const auto fix = kinematics.Solve(lengths);
    worst = std::max(worst, (fix.position - position).norm());
    worst_residual = std::max(worst_residual, fix.residual_m);
  }
  REQUIRE(worst <= 27e-6);
  REQUIRE(worst > 5e-6);  // it was rounded at all
  REQUIRE(worst_residual <= count_length);
}

TEST_CASE("no rounding to counts leaves more than 27 um within 0.15 m of the centre") {
  // To first order the error is linear in the four rounding errors: it is largest where each is half
  // a count, of either sign.
  const double half_count = 0.5 * 2.92e-5;
  const SpidarKinematics kinematics(kCube);
  double worst = 0;
  for (int i = 0; i < 4000; ++i) {
    const double z = 1 - 2 * (i + 0.5) / 4000;  // spread evenly, by the golden angle
    const double across = std::sqrt(1 - z * z);
    const Vec3 direction(across * std::cos(2.399963 * i), across * std::sin(2.399963 * i), z);
    for (const double radius : {0.0, 0.075, 0.15}) {
      const PerString exact = kinematics.Lengths(radius * direction);
      for (unsigned signs = 0; signs < 8; ++signs) {  // all signs reversed reverse the error
        PerString lengths = exact;
        for (std::size_t string = 0; string < 4; ++string) {
          lengths[string] += (signs >> string & 1U) != 0 ? half_count : -half_count;
        }
        worst = std::max(worst, (kinematics.Solve(lengths).position - radius * direction).norm());
      }
    }
  }
  CAPTURE(worst);
  REQUIRE(worst <= 27e-6);
  REQUIRE(worst >= 25.2e-6);  // at the centre: 3/4 of |d0 + d1 - d2 - d3| = 4/sqrt(3) half counts
}

TEST_CASE("more strings than four are used, the best fit is stationary") {
  std::vector<Vec3> motors = kCube;
  motors.push_back(Vec3(0.3, 0.1, 0.2));
  motors.push_back(Vec3(-0.1, 0.3, -0.2));
  const SpidarKinematics kinematics(motors);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> noise(-1e-4, 1e-4);
  for (int i = 0; i < 1000; ++i) {
    PerString lengths = kinematics.Lengths(InBall(random, 0.15));
    for (std::size_t string = 0; string < motors.size(); ++string) lengths[string] += noise(random);
    const auto fix = kinematics.Solve(lengths);
    Vec3 gradient = Vec3::Zero();
    for (std::size_t string = 0; string < motors.size(); ++string) {
      const Vec3 d = fix.position - motors[string];
      gradient += d.normalized() * (d.norm() - lengths[string]);
    }
    REQUIRE(gradient.norm() < 1e-10);
  }
}

TEST_CASE("a slipped string shows in the residual") {
  const SpidarKinematics kinematics(kCube);
  PerString lengths = kinematics.Lengths(Vec3(0.02, -0.03, 0.05));
  lengths[2] += 0.01;
  REQUIRE(kinematics.Solve(lengths).residual_m > 1e-3);
}

TEST_CASE("a string that slips or hangs slack is named, with its sign") {
  const SpidarKinematics kinematics(kCube);
  std::mt19937_64 random(4);
  for (int i = 0; i < 5000; ++i) {
    const Vec3 position = InBall(random, 0.15);
    const Vec3 expected = position + InBall(random, 1e-3);
    PerString lengths = kinematics.Lengths(position);
    const std::size_t wrong = static_cast<std::size_t>(i) % 4;
    const double excess = i % 8 < 4 ? 5e-3 : -5e-3;
    lengths[wrong] += excess;
    const SuspectString suspect = kinematics.Suspect(lengths, expected);
    REQUIRE(suspect.string == wrong);
    REQUIRE(std::abs(suspect.excess_m - excess) < 1e-9);  // the three others fix the grip
  }
}

TEST_CASE("nothing but where the grip was tells which of four strings is wrong") {
  const SpidarKinematics kinematics(kCube);
  const Vec3 position(0.02, -0.03, 0.05);
  PerString lengths = kinematics.Lengths(position);
  lengths[2] += 5e-3;
  // A grip at which three strings are right and the first one is wrong explains them as well.
  const Vec3 other = position + 3.75e-3 * ((kCube[0] - position).normalized() -
                                           (kCube[2] - position).normalized());
  REQUIRE(kinematics.Suspect(lengths, other).string == 0);
  REQUIRE(kinematics.Suspect(lengths, position).string == 2);
}

TEST_CASE("nonsense lengths give a bounded answer in bounded time") {
  const SpidarKinematics kinematics(kCube);
  for (const double length : {0.0, -1.0, 1e6, 1e-310}) {
    PerString lengths{};
    lengths.fill(length);
    REQUIRE(kinematics.Solve(lengths).iterations <= 3);
  }
  PerString lengths{};
  lengths = kinematics.Lengths(Vec3::Zero());
  lengths[1] = std::nan("");
  REQUIRE(kinematics.Solve(lengths).residual_m > 1);
  lengths.fill(std::nan(""));
  REQUIRE(kinematics.Solve(lengths).iterations <= 3);
  REQUIRE(kinematics.Suspect(lengths, Vec3::Zero()).string < 4);
}

TEST_CASE("motors in a plane, too few or too many are refused") {
  REQUIRE_THROWS_AS(SpidarKinematics({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(1, 1, 0)}),
                    std::invalid_argument);
  REQUIRE_THROWS_AS(SpidarKinematics({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}),
                    std::invalid_argument);
  REQUIRE_THROWS_AS(SpidarKinematics(std::vector<Vec3>(9, Vec3::Zero())), std::invalid_argument);
}

}  // namespace
}  // namespace rikiseki::haptic
