// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar_pose.h"

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/haptic_server/device/g6x3.h"

namespace rikiseki::haptic {
namespace {

constexpr double kDegree = M_PI / 180;

// rad; the sine of the half angle stays exact where its cosine is 1 to rounding.
double AngleBetween(const Quat& a, const Quat& b) {
  return 2 * std::asin(std::min(1.0, (a * b.conjugate()).vec().norm()));
}

SpidarPose G6X3() {
  return {G6X3Motors(), G6X3Attachments()};
}

TEST_CASE("the G6X3 has the published stiffness at home") {
  const GripStrings home = G6X3().StringsAt(Pose());
  Eigen::Matrix<double, 6, 6> stiffness = Eigen::Matrix<double, 6, 6>::Zero();
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    Eigen::Matrix<double, 6, 1> row;
    row << home.direction[i], home.arm[i].cross(home.direction[i]);
    stiffness += row * row.transpose();
  }
  const auto values =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(stiffness)).eigenvalues();
  const double published[] = {0.00047, 0.00050, 0.0018, 1.95, 2.77, 3.28};
  for (int i = 0; i < 6; ++i) REQUIRE(values[i] == Approx(published[i]).epsilon(0.011));
}

TEST_CASE("poses within 30 mm and 30 degrees of home come back from there in five steps") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(1);
  for (int i = 0; i < 20'000; ++i) {
    const Pose pose = RandomPose(random, 0.03, 30 * kDegree);
    const auto fix = kinematics.Solve(kinematics.Lengths(pose), Pose());
    REQUIRE((fix.pose.position - pose.position).norm() <= 1e-10);
    REQUIRE(AngleBetween(fix.pose.orientation, pose.orientation) <= 1e-10);
    REQUIRE(fix.iterations <= 5);
    REQUIRE(fix.residual_m <= 2e-9);
  }
}

TEST_CASE("from the tick before four steps suffice, as far as the grip goes") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(2);
  int most = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Pose pose = RandomPose(random, 0.04, 60 * kDegree);
    // 1 m/s and 20 rad/s.
    const Pose step = RandomPose(random, 1e-3, 0.02);
    const Pose before{pose.position + step.position, step.orientation * pose.orientation};
    const auto fix = kinematics.Solve(kinematics.Lengths(pose), before);
    REQUIRE((fix.pose.position - pose.position).norm() <= 1e-10);
    REQUIRE(AngleBetween(fix.pose.orientation, pose.orientation) <= 1e-10);
    most = std::max(most, fix.iterations);
  }
  REQUIRE(most <= 4);
}

TEST_CASE("of lengths in counts the pose found is the best fit, less than counts away") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(3);
  double worst_m = 0;
  double worst_rad = 0;
  double worst_residual_m = 0;
  for (int i = 0; i < 5000; ++i) {
    const Pose pose = RandomPose(random, 0.02, 20 * kDegree);
    EightStrings lengths = kinematics.Lengths(pose);
    for (double& length : lengths) {
      length = std::round(length / kG6X3CountLength) * kG6X3CountLength;
    }
    const auto fix = kinematics.Solve(lengths, Pose());
    const GripStrings strings = kinematics.StringsAt(fix.pose);
    const EightStrings fitted = kinematics.Lengths(fix.pose);
    Vec3 force = Vec3::Zero();
    Vec3 torque = Vec3::Zero();
    for (std::size_t s = 0; s < kGripStrings; ++s) {
      force += strings.direction[s] * (fitted[s] - lengths[s]);
      torque += strings.arm[s].cross(strings.direction[s]) * (fitted[s] - lengths[s]);
    }
    REQUIRE(force.norm() <= 1e-11);
    REQUIRE(torque.norm() / 0.0225 <= 1e-11);
    worst_m = std::max(worst_m, (fix.pose.position - pose.position).norm());
    worst_residual_m = std::max(worst_residual_m, fix.residual_m);
    worst_rad = std::max(worst_rad, AngleBetween(fix.pose.orientation, pose.orientation));
  }
  REQUIRE(worst_m <= kG6X3CountLength);
  REQUIRE(worst_rad <= 2 * kG6X3CountLength / 0.0225);
  REQUIRE(worst_residual_m <= kG6X3CountLength);
  REQUIRE(worst_m > 0.1 * kG6X3CountLength);  // it was rounded at all
}

TEST_CASE("a string of eight that slips or hangs slack is named by the others alone") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(4);
  int shown = 0;
  int named = 0;
  for (int i = 0; i < 4000; ++i) {
    const Pose pose = RandomPose(random, 0.03, 30 * kDegree);
    const Pose step = RandomPose(random, 1e-3, 0.02);
    const Pose before{pose.position + step.position, step.orientation * pose.orientation};
    EightStrings lengths = kinematics.Lengths(pose);
    const std::size_t wrong = static_cast<std::size_t>(i) % kGripStrings;
    const double excess = i % 16 < 8 ? 5e-3 : -5e-3;
    lengths[wrong] += excess;
    const SuspectString suspect = kinematics.Suspect(lengths, before);
    REQUIRE(suspect.string == wrong);
    REQUIRE(std::abs(suspect.excess_m - excess) < 1e-6);

    // In counts there are poses in which the six unknowns swallow what one string is wrong.
    for (double& length : lengths) {
      length = std::round(length / kG6X3CountLength) * kG6X3CountLength;
    }
    if (kinematics.Solve(lengths, before).residual_m <= 2 * kG6X3CountLength) continue;
    ++shown;
    named += kinematics.Suspect(lengths, before).string == wrong ? 1 : 0;
  }
  CAPTURE(shown, named);
  REQUIRE(shown >= 0.97 * 4000);
  REQUIRE(named >= 0.99 * shown);
}

TEST_CASE("nonsense lengths of eight strings end in bounded time and do not pass for sound") {
  const SpidarPose kinematics = G6X3();
  for (const double length : {0.0, -1.0, 1e6, 1e300, 1e-310, std::nan(""), HUGE_VAL}) {
    EightStrings lengths{};
    lengths.fill(length);
    REQUIRE(kinematics.Solve(lengths, Pose()).iterations <= 5);
    REQUIRE(kinematics.Suspect(lengths, Pose()).string < kGripStrings);
  }
  EightStrings lengths = kinematics.Lengths(Pose());
  lengths[3] = std::nan("");
  REQUIRE(kinematics.Solve(lengths, Pose()).residual_m > 1);
  REQUIRE(kinematics.Suspect(lengths, Pose()).string == 3);
}

TEST_CASE("strings that do not hold the grip in all directions are refused") {
  std::array<Vec3, kGripStrings> point;
  point.fill(Vec3::Zero());  // no torque
  REQUIRE_THROWS_AS(SpidarPose(G6X3Motors(), point), std::invalid_argument);
  std::array<Vec3, kGripStrings> needle = G6X3Attachments();
  for (Vec3& attachment : needle) attachment = Vec3(attachment.sum(), 0, 0);  // turns about x
  REQUIRE_THROWS_AS(SpidarPose(G6X3Motors(), needle), std::invalid_argument);
  std::array<Vec3, kGripStrings> lost = G6X3Motors();
  lost[5].x() = std::nan("");
  REQUIRE_THROWS_AS(SpidarPose(lost, G6X3Attachments()), std::invalid_argument);
}

}  // namespace
}  // namespace rikiseki::haptic
