// SPDX-License-Identifier: MIT
// String lengths -> position of the grip, for strings that meet in one point.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/geometry.h"
#include "haptic_server/device/strings.h"

namespace rikiseki::haptic {

class SpidarKinematics {
 public:
  struct Fix {
    Vec3 position = Vec3::Zero();  // m, device axes
    double residual_m = 0;  // largest length that this position leaves unexplained: slack or slip
    int iterations = 0;
  };

  /// `motors` [m, device axes]: 4 to 8 string exits, not all in one plane. Throws
  /// std::invalid_argument.
  explicit SpidarKinematics(const std::vector<Vec3>& motors);

  std::size_t StringCount() const noexcept { return count_; }
  const Vec3& motor(std::size_t string) const noexcept { return motors_[string]; }

  /// The string lengths [m] of a grip position. // RT:
  PerString Lengths(const Vec3& position) const noexcept;

  /// The position that explains the lengths best (least squares). The differences of squared
  /// lengths are linear in the position, which gives a start from anywhere that is exact for
  /// consistent lengths; at most 3 Gauss-Newton steps then spread what quantisation left. Has no
  /// memory. // RT:
  Fix Solve(const PerString& lengths) const noexcept;

  /// The string that, if it alone is wrong, leaves the grip nearest to `expected` [m]. Four lengths
  /// for three unknowns tell that one is wrong, never which one: leave out any, and the others
  /// agree. So it is named by where the grip was before: rightly if it moved less since then than
  /// the string is wrong. // RT:
  SuspectString Suspect(const PerString& lengths, const Vec3& expected) const noexcept;

 private:
  Fix Refine(const PerString& lengths, const Vec3& start, std::size_t left_out) const noexcept;

  std::size_t count_;
  std::array<Vec3, kMaxStrings> motors_;
  Vec3 mean_motor_;
  double mean_motor_square_ = 0;
  // (sum of a a^T)^-1 a_i with a_i = 2 (mean - motor_i): the linear start.
  std::array<Vec3, kMaxStrings> linear_;
};

}  // namespace rikiseki::haptic
