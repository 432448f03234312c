// SPDX-License-Identifier: MIT
#include "haptic_server/device/wrench_tension.h"

#include <Eigen/SVD>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "tests/haptic_server/device/g6x3.h"

namespace rikiseki::haptic {
namespace {

constexpr double kArm = 0.0225;  // m
constexpr double kRest = 1;      // N

SpidarPose G6X3() {
  return {G6X3Motors(), G6X3Attachments()};
}

void RequireWithin(const EightStrings& tension, const TensionBounds& bounds) {
  for (const double t : tension) {
    REQUIRE(t >= bounds.min_n);
    REQUIRE(t <= bounds.max_n);
  }
}

double FromRest(const EightStrings& tension) {
  double square = 0;
  for (const double t : tension) square += (t - kRest) * (t - kRest);
  return std::sqrt(square);
}

// As one vector: a torque counts as a force at the arm.
Eigen::Matrix<double, 6, 1> Scaled(const Wrench& wrench) {
  Eigen::Matrix<double, 6, 1> scaled;
  scaled << wrench.force, wrench.torque / kArm;
  return scaled;
}

Eigen::Matrix<double, 6, 8> ScaledColumns(const GripStrings& strings) {
  Eigen::Matrix<double, 6, 8> columns;
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    columns.col(static_cast<Eigen::Index>(i)) =
        Scaled({strings.direction[i], Vec3(strings.arm[i].cross(strings.direction[i]))});
  }
  return columns;
}

TEST_CASE("at home 5 N are shown to 1 % and 50 mNm to 2 %, in every direction") {
  const GripStrings home = G6X3().StringsAt(Pose());
  std::mt19937_64 random(1);
  for (int i = 0; i < 2000; ++i) {
    Vec3 direction = i < 6 ? Vec3(Vec3::Unit(i / 2) * (i % 2 == 0 ? 1 : -1))
                           : RandomInBall(random, 1).normalized();
    for (const Wrench& wanted :
         {Wrench{5 * direction, Vec3::Zero()}, Wrench{Vec3::Zero(), 0.05 * direction}}) {
      const WrenchAllocation got = AllocateWrench(home, wanted, kG6X3Bounds, kRest);
      REQUIRE(got.feasible);
      RequireWithin(got.tension, kG6X3Bounds);
      REQUIRE((got.wrench.force - wanted.force).norm() <= 0.01 * 5);
      REQUIRE((got.wrench.torque - wanted.torque).norm() <= 0.02 * 0.05);
      // What is really reached is far better than the bar.
      REQUIRE((Scaled(got.wrench) - Scaled(wanted)).norm() <= 1e-6 * (1 + Scaled(wanted).norm()));
    }
  }
}

TEST_CASE("without a force every string of the grip carries the light internal tension") {
  const GripStrings home = G6X3().StringsAt(Pose());
  const WrenchAllocation got = AllocateWrench(home, {}, kG6X3Bounds, kRest);
  REQUIRE(Scaled(got.wrench).norm() < 1e-9);
  for (const double t : got.tension) REQUIRE(t == Approx(kRest).epsilon(0.02));
}

TEST_CASE("what tensions within the bounds can show is shown, no farther from rest than they are") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> tension(0.3, 20);
  int at_a_bound = 0;
  for (int i = 0; i < 20'000; ++i) {
    const GripStrings strings = kinematics.StringsAt(RandomPose(random, 0.03, 0.5));
    EightStrings known;
    for (double& t : known) t = tension(random);
    const Wrench wanted = StringWrench(strings, known);
    const WrenchAllocation got = AllocateWrench(strings, wanted, kG6X3Bounds, kRest);
    RequireWithin(got.tension, kG6X3Bounds);
    // The weight of rest, 1e-6, against strings that may hold a direction by a thousandth.
    REQUIRE((Scaled(got.wrench) - Scaled(wanted)).norm() <= 1e-3);
    REQUIRE(FromRest(got.tension) <= FromRest(known) + 1e-3);
    for (const double t : got.tension) at_a_bound += t == 0.3 || t == 20 ? 1 : 0;
  }
  REQUIRE(at_a_bound > 10'000);
}

TEST_CASE("of the tensions that show a wrench those nearest to rest are taken") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> small(-1e-2, 1e-2);
  int tried = 0;
  for (int i = 0; i < 5000; ++i) {
    const GripStrings strings = kinematics.StringsAt(RandomPose(random, 0.02, 0.3));
    const Wrench wanted{RandomInBall(random, 5), RandomInBall(random, 0.05)};
    const WrenchAllocation got = AllocateWrench(strings, wanted, kG6X3Bounds, kRest);
    if (!got.feasible) continue;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(Eigen::MatrixXd(ScaledColumns(strings)),
                                                Eigen::ComputeFullV);
    for (int k = 0; k < 20; ++k) {
      const Eigen::VectorXd move =
          svd.matrixV().rightCols<2>() * Eigen::Vector2d(small(random), small(random));
      EightStrings other = got.tension;
      bool within = true;
      for (std::size_t s = 0; s < kGripStrings; ++s) {
        other[s] += move[static_cast<Eigen::Index>(s)];
        within = within && other[s] >= kG6X3Bounds.min_n && other[s] <= kG6X3Bounds.max_n;
      }
      if (!within) continue;
      ++tried;
      REQUIRE(FromRest(other) >= FromRest(got.tension) - 1e-6);
    }
  }
  REQUIRE(tried > 20'000);
}

TEST_CASE("a wrench out of reach is missed least") {
  const SpidarPose kinematics = G6X3();
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> decades(-1, 3);
  int infeasible = 0;
  for (int i = 0; i < 50'000; ++i) {
    const GripStrings strings = kinematics.StringsAt(RandomPose(random, 0.03, 0.5));
    const double size = std::pow(10, decades(random));
    const Wrench wanted{RandomInBall(random, size), RandomInBall(random, kArm * size)};
    const TensionBounds bounds = i % 2 == 0 ? kG6X3Bounds : TensionBounds{0.5, 5};
    const WrenchAllocation got = AllocateWrench(strings, wanted, bounds, kRest);
    RequireWithin(got.tension, bounds);
    if (got.feasible) continue;
    ++infeasible;
    // The error falls along no string that may still give or take: exact up to the weight of rest,
    // 1e-6 of up to 20 N.
    const Eigen::Matrix<double, 8, 1> slope =
        ScaledColumns(strings).transpose() * (Scaled(wanted) - Scaled(got.wrench));
    for (std::size_t s = 0; s < kGripStrings; ++s) {
      const double t = got.tension[s];
      const double downhill =
          std::clamp(t + slope[static_cast<Eigen::Index>(s)], bounds.min_n, bounds.max_n);
      REQUIRE(std::abs(downhill - t) <= 1e-4);
    }
  }
  REQUIRE(infeasible > 10'000);
}

TEST_CASE("the displayed wrench never moves farther than the wanted one") {
  const GripStrings strings =
      G6X3().StringsAt({Vec3(0.01, -0.005, 0.008), Quat(Eigen::AngleAxisd(0.2, Vec3::UnitZ()))});
  const Eigen::Matrix<double, 6, 1> along =
      Scaled({Vec3(0.6, -0.64, 0.48), kArm * Vec3(0.3, 0.2, -0.5)}).normalized();
  const auto shown = [&](double size) {
    const Wrench wanted{size * along.head<3>(), kArm * size * along.tail<3>()};
    return Scaled(AllocateWrench(strings, wanted, kG6X3Bounds, kRest).wrench);
  };
  Eigen::Matrix<double, 6, 1> before = shown(0);
  for (int i = 1; i <= 40'000; ++i) {
    const Eigen::Matrix<double, 6, 1> now = shown(i * 1e-3);
    REQUIRE((now - before).norm() <= 1.02e-3);
    before = now;
  }
  REQUIRE(before.norm() < 39);  // the ramp has left what the motors can
}

TEST_CASE("damaged wrenches and poses leave the eight strings within their bounds") {
  const GripStrings home = G6X3().StringsAt(Pose());
  const double nan = std::nan("");
  for (const Wrench& wrench :
       {Wrench{Vec3(nan, 0, 0), Vec3::Zero()}, Wrench{Vec3::Zero(), Vec3(0, HUGE_VAL, 0)},
        Wrench{Vec3(1e308, -1e308, 1e308), Vec3(1e308, 0, 0)}, Wrench{Vec3(1e-310, 0, 0), {}}}) {
    const WrenchAllocation got = AllocateWrench(home, wrench, kG6X3Bounds, kRest);
    RequireWithin(got.tension, kG6X3Bounds);
    REQUIRE(Scaled(got.wrench).allFinite());
  }
  const WrenchAllocation nothing =
      AllocateWrench(home, {Vec3(nan, 0, 0), Vec3::Zero()}, kG6X3Bounds, kRest);
  REQUIRE(nothing.tension == AllocateWrench(home, {}, kG6X3Bounds, kRest).tension);

  GripStrings lost = home;
  lost.direction[4].x() = nan;
  const WrenchAllocation least = AllocateWrench(lost, {}, kG6X3Bounds, kRest);
  for (const double t : least.tension) REQUIRE(t == kG6X3Bounds.min_n);
  REQUIRE_FALSE(least.feasible);

  GripStrings one_point = home;  // no torque, and all strings along one line
  one_point.arm.fill(Vec3::Zero());
  one_point.direction.fill(Vec3::UnitX());
  RequireWithin(
      AllocateWrench(one_point, {Vec3(3, 1, 0), Vec3(1, 0, 0)}, kG6X3Bounds, kRest).tension,
      kG6X3Bounds);
  RequireWithin(AllocateWrench(home, {Vec3(3, 1, 0), {}}, {2, 2}, kRest).tension, {2, 2});
}

}  // namespace
}  // namespace rikiseki::haptic
