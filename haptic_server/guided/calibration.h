// SPDX-License-Identifier: MIT
// Where the motors really are, from string lengths alone. Four lengths for three unknowns contradict each
// other where a motor is not where the model has it: one equation for each place that the grip visits.
// Turning the whole frame changes no length, so three of the twelve coordinates cannot be known: the
// motors are turned to where they are nearest to the model's.
#pragma once

#include <vector>

#include "common/geometry.h"
#include "haptic_server/device/spidar_kinematics.h"

namespace rikiseki::haptic {

/// How far motors may be from the model's before it is another device, or strings are exchanged.
inline constexpr double kFarthestMotor = 0.05;  // m, and no more than a quarter of its distance

struct Calibration {
  std::vector<Vec3> motors_m;  // device axes; the origin is where the grip was held in the middle
  // How much the four lengths contradict each other, root mean square over all places [m].
  double contradiction_before_m = 0;
  double contradiction_m = 0;
  double uncertainty_m = 0;  // standard deviation of the motors in the least known direction
  double farthest_m = 0;     // from the model's, of any motor
};

/// `model`: four motors [m]. `changes`: for each place, by how much each string is longer [m] than in the
/// middle. `count_length_m`: what lengths are rounded to. Least squares, in which the model counts as
/// known to kModelDeviation. Throws std::invalid_argument if the places do not fix the motors.
Calibration CalibrateMotors(const std::vector<Vec3>& model, const std::vector<PerString>& changes,
                            double count_length_m);

}  // namespace rikiseki::haptic
