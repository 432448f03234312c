// SPDX-License-Identifier: MIT
// String lengths -> pose of a grip whose eight strings end at different places of it: the G6
// family.
#pragma once

#include <array>
#include <cstddef>

#include "common/geometry.h"
#include "haptic_server/device/strings.h"
#include "haptic_server/device/wrench_tension.h"

namespace rikiseki::haptic {

class SpidarPose {
 public:
  struct Fix {
    Pose pose;              // of the grip, device axes
    double residual_m = 0;  // largest length that this pose leaves unexplained, to 2e-9 m
    int iterations = 0;
  };

  /// `motors` [m, device axes]: where strings leave; `attachments` [m, grip axes]: where they end.
  /// Throws std::invalid_argument if they do not fix the grip in all six directions at home, the
  /// identity pose.
  SpidarPose(const std::array<Vec3, kGripStrings>& motors,
             const std::array<Vec3, kGripStrings>& attachments);

  /// The string lengths [m] of a pose. // RT:
  EightStrings Lengths(const Pose& pose) const noexcept;

  /// The pose near `start` that explains the lengths best (least squares): at most five
  /// Gauss-Newton steps, in which a rotation counts as a way at the mean arm of the grip, so that
  /// metres and radians weigh alike. `start` is the pose of the tick before, or home; other poses,
  /// far away, may explain the same lengths. // RT:
  Fix Solve(const EightStrings& lengths, const Pose& start) const noexcept;

  /// The string that, if it alone is wrong, leaves the others in the best agreement. Eight lengths
  /// for six unknowns single it out where the residual is above rounding; in few poses a pose that
  /// is wrong explains a string that is wrong by millimetres. // RT:
  SuspectString Suspect(const EightStrings& lengths, const Pose& start) const noexcept;

  /// How the strings hold the grip. // RT:
  GripStrings StringsAt(const Pose& pose) const noexcept;

 private:
  Fix SolveWithout(std::size_t left_out, const EightStrings& lengths,
                   const Pose& start) const noexcept;

  std::array<Vec3, kGripStrings> motors_;
  std::array<Vec3, kGripStrings> attachments_;
  double mean_arm_m_;
};

}  // namespace rikiseki::haptic
