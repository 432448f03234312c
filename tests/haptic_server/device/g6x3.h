// SPDX-License-Identifier: MIT
// The geometry of a SPIDAR-G6 (X3): eight motors at the corners of a box, a grip of four crossed
// arms with two strings each. Half-extents and arms as published (Springhead, HISpidar.cpp; before
// its turn by -45 degrees, which is none of the strings' business); which corner pulls at which arm
// follows from the published stiffness at home, which only this assignment and its mirror image have.
#pragma once

#include <cmath>
#include <random>

#include "haptic_server/device/spidar_pose.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

inline std::array<Vec3, kGripStrings> G6X3Motors() {
  const double x = 0.060, y = 0.076, z = 0.060;
  return {Vec3(-x, -y, -z), Vec3(x, -y, -z), Vec3(x, -y, z), Vec3(-x, -y, z),
          Vec3(-x, y, -z),  Vec3(x, y, -z),  Vec3(x, y, z),  Vec3(-x, y, z)};
}

inline std::array<Vec3, kGripStrings> G6X3Attachments() {
  const double g = 0.0225;
  return {Vec3(-g, 0, 0), Vec3(g, 0, 0), Vec3(0, -g, 0), Vec3(0, -g, 0),
          Vec3(-g, 0, 0), Vec3(g, 0, 0), Vec3(0, g, 0),  Vec3(0, g, 0)};
}

inline constexpr double kG6X3CountLength = 1.66555e-5;  // m
inline constexpr TensionBounds kG6X3Bounds{0.3, 20};

/// As a device file says it, with 1 N on every string at rest.
inline SpidarSettings G6X3Settings() {
  SpidarSettings spidar;
  for (std::size_t string = 0; string < kGripStrings; ++string) {
    spidar.motors_m.push_back(G6X3Motors()[string]);
    spidar.attachments_mm.push_back(1e3 * G6X3Attachments()[string]);
  }
  spidar.count_length_m = kG6X3CountLength;
  spidar.tension_min_n = kG6X3Bounds.min_n;
  spidar.tension_max_n = kG6X3Bounds.max_n;
  spidar.rest_tension_n = 1;
  return spidar;
}

inline Vec3 RandomInBall(std::mt19937_64& random, double radius) {
  std::uniform_real_distribution<double> uniform(-radius, radius);
  Vec3 p;
  do {
    p = Vec3(uniform(random), uniform(random), uniform(random));
  } while (p.norm() > radius);
  return p;
}

/// Within `radius` [m] and `angle` [rad] of home.
inline Pose RandomPose(std::mt19937_64& random, double radius, double angle) {
  const Vec3 position = RandomInBall(random, radius);
  const Vec3 turn = RandomInBall(random, angle);
  return {position, Quat(Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()))};
}

}  // namespace rikiseki::haptic
