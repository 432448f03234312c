// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar_kinematics.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace rikiseki::haptic {
namespace {

constexpr int kMaxIterations = 3;
constexpr double kConverged = 1e-13;        // m
constexpr std::size_t kNone = kMaxStrings;  // leaves out no string

}  // namespace

SpidarKinematics::SpidarKinematics(const std::vector<Vec3>& motors) : count_(motors.size()) {
  if (count_ < 4 || count_ > kMaxStrings) {
    throw std::invalid_argument("a SPIDAR has 4 to 8 strings here");
  }
  mean_motor_.setZero();
  for (std::size_t i = 0; i < count_; ++i) {
    motors_[i] = motors[i];
    mean_motor_ += motors[i] / static_cast<double>(count_);
  }
  Mat3 spread = Mat3::Zero();
  for (std::size_t i = 0; i < count_; ++i) {
    const Vec3 a = 2 * (mean_motor_ - motors_[i]);
    spread += a * a.transpose();
    mean_motor_square_ += motors_[i].squaredNorm() / static_cast<double>(count_);
  }
  const double size = spread.trace();
  if (!(spread.determinant() > 1e-9 * size * size * size)) {
    throw std::invalid_argument("the motors of a SPIDAR must not lie in one plane");
  }
  for (std::size_t i = 0; i < count_; ++i) {
    linear_[i] = spread.ldlt().solve(2 * (mean_motor_ - motors_[i]));
  }
}

PerString SpidarKinematics::Lengths(const Vec3& position) const noexcept {
  PerString lengths{};
  for (std::size_t i = 0; i < count_; ++i) lengths[i] = (motors_[i] - position).norm();
  return lengths;
}

SpidarKinematics::Fix SpidarKinematics::Solve(const PerString& lengths) const noexcept {
  // l_i^2 = |p|^2 - 2 m_i p + |m_i|^2; minus its mean over the strings: a_i p = right side.
  double mean_square = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    mean_square += lengths[i] * lengths[i] / static_cast<double>(count_);
  }
  Vec3 start = Vec3::Zero();
  for (std::size_t i = 0; i < count_; ++i) {
    start += linear_[i] * (lengths[i] * lengths[i] - mean_square - motors_[i].squaredNorm() +
                           mean_motor_square_);
  }
  return Refine(lengths, start, kNone);
}

SuspectString SpidarKinematics::Suspect(const PerString& lengths,
                                        const Vec3& expected) const noexcept {
  SuspectString suspect;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    const Vec3 position = Refine(lengths, expected, i).position;
    const double way = (position - expected).norm();
    if (!(way < nearest)) continue;
    nearest = way;
    suspect = {i, lengths[i] - (motors_[i] - position).norm()};
  }
  return suspect;
}

SpidarKinematics::Fix SpidarKinematics::Refine(const PerString& lengths, const Vec3& start,
                                               std::size_t left_out) const noexcept {
  Fix fix;
  fix.position = start;
  for (;;) {
    Mat3 normal_matrix = Mat3::Zero();
    Vec3 gradient = Vec3::Zero();
    fix.residual_m = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      if (i == left_out) continue;
      const Vec3 string = fix.position - motors_[i];
      const double length = std::max(string.norm(), 1e-9);
      const Vec3 direction = string / length;
      const double miss = length - lengths[i];
      normal_matrix += direction * direction.transpose();
      gradient += direction * miss;
      fix.residual_m = std::max(fix.residual_m, std::abs(miss));
    }
    if (fix.iterations == kMaxIterations) return fix;
    const Vec3 step = normal_matrix.inverse() * gradient;
    if (!step.allFinite()) {  // a length is no number, which no maximum shows
      fix.residual_m = std::numeric_limits<double>::infinity();
      return fix;
    }
    if (step.norm() < kConverged) return fix;
    fix.position -= step;
    ++fix.iterations;
  }
}

}  // namespace rikiseki::haptic
