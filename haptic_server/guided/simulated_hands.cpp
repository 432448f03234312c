// SPDX-License-Identifier: MIT
#include "haptic_server/guided/simulated_hands.h"

#include "haptic_server/device/simulated_board.h"

namespace rikiseki::haptic {
namespace {

constexpr double kStayS = 2;
constexpr double kStrokeS = 0.8;
constexpr double kShare = 0.5;  // of the way to the motors, along each axis
constexpr int kStrokes = 500;
constexpr std::uint64_t kSeed = 1;

}  // namespace

Hand AbsentHand(const Settings& settings) {
  const SpidarSettings& spidar = settings.spidar;
  return {[](double) { return Vec3(Vec3::Zero()); },
          {.mass_kg = spidar.moving_mass_kg,
           .damping_ns_per_m = spidar.friction_damping_ns_per_m,
           .stiffness_n_per_m = 0,
           .friction_n = spidar.friction_n}};
}

Hand LeadingHand(const Settings& settings) {
  Vec3 corner = Vec3::Zero();
  for (const Vec3& motor : settings.spidar.motors_m) corner = corner.cwiseMax(motor.cwiseAbs());
  corner *= kShare;
  MotorProgram::Script script;
  script.strokes = StirringStrokes(-corner, corner, kStrokeS, 0, kSeed, kStrokes);
  script.strokes.insert(script.strokes.begin(), {Vec3::Zero(), kStayS});
  return {MotorProgram(script), ImpedanceOf(settings)};
}

}  // namespace rikiseki::haptic
