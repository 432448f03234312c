// SPDX-License-Identifier: MIT
#include "haptic_server/guided/calibration.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "haptic_server/device/tension.h"

namespace rikiseki::haptic {
namespace {

constexpr int kCoordinates = 3 * kTensionStrings;
constexpr int kTurns = 3;  // directions in which no length changes
constexpr int kIterations = 50;
constexpr double kEnough = 1e-10;         // m
constexpr double kModelDeviation = 0.01;  // m

using Coordinates = Eigen::Matrix<double, kCoordinates, 1>;
using Normal = Eigen::Matrix<double, kCoordinates, kCoordinates>;

// By how much the lengths contradict each other at one place, and how the motors change that.
struct Contradiction {
  double length_m = 0;
  Coordinates gradient;
};

Contradiction ContradictionAt(const SpidarKinematics& kinematics, const PerString& change) {
  PerString lengths{};
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    lengths[i] = kinematics.motor(i).norm() + change[i];
  }
  const Vec3 position = kinematics.Solve(lengths).position;
  std::array<Vec3, kTensionStrings> u;  // from the motors
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    u[i] = (position - kinematics.motor(i)).stableNormalized();
  }
  // The one combination of the lengths that does not depend on the position.
  Eigen::Vector4d weight(u[1].dot(u[2].cross(u[3])), -u[0].dot(u[2].cross(u[3])),
                         u[0].dot(u[1].cross(u[3])), -u[0].dot(u[1].cross(u[2])));
  weight.normalize();
  Contradiction result;
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    const Vec3& motor = kinematics.motor(i);
    const auto at = static_cast<Eigen::Index>(i);
    result.length_m += weight[at] * ((position - motor).norm() - lengths[i]);
    result.gradient.segment<3>(3 * at) = -weight[at] * (u[i] + motor.normalized());
  }
  return result;
}

struct Equations {
  Normal normal = Normal::Zero();
  Coordinates right = Coordinates::Zero();
  double rms_m = 0;
};

Equations Linearise(const std::vector<Vec3>& motors, const std::vector<PerString>& changes) {
  const SpidarKinematics kinematics(motors);
  Equations equations;
  for (const PerString& change : changes) {
    const Contradiction at = ContradictionAt(kinematics, change);
    if (!std::isfinite(at.length_m)) {
      throw std::invalid_argument("the lengths are those of no place between the motors");
    }
    equations.normal += at.gradient * at.gradient.transpose();
    equations.right -= at.gradient * at.length_m;
    equations.rms_m += at.length_m * at.length_m;
  }
  equations.rms_m = std::sqrt(equations.rms_m / static_cast<double>(changes.size()));
  return equations;
}

}  // namespace

Calibration CalibrateMotors(const std::vector<Vec3>& model, const std::vector<PerString>& changes,
                            double count_length_m) {
  if (model.size() != kTensionStrings || std::ssize(changes) < kCoordinates - kTurns) {
    throw std::invalid_argument("four motors need nine places at least");
  }
  Calibration result{.motors_m = model};
  // Rounding to counts is all that is wrong with a measured length.
  const double rounding_m = count_length_m / std::sqrt(12.0);
  const double model_weight = rounding_m * rounding_m / (kModelDeviation * kModelDeviation);
  result.contradiction_before_m = Linearise(model, changes).rms_m;
  Equations equations;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    equations = Linearise(result.motors_m, changes);
    Coordinates deviation;
    for (Eigen::Index i = 0; i < std::ssize(model); ++i) {
      const auto motor = static_cast<std::size_t>(i);
      deviation.segment<3>(3 * i) = result.motors_m[motor] - model[motor];
    }
    const Normal normal = equations.normal + model_weight * Normal::Identity();
    const Coordinates step = normal.ldlt().solve(equations.right - model_weight * deviation);
    if (!step.allFinite()) throw std::invalid_argument("the places do not fix the motors");
    for (Eigen::Index i = 0; i < std::ssize(model); ++i) {
      result.motors_m[static_cast<std::size_t>(i)] += step.segment<3>(3 * i);
    }
    if (step.cwiseAbs().maxCoeff() < kEnough) break;
  }
  equations = Linearise(result.motors_m, changes);
  result.contradiction_m = equations.rms_m;
  const Eigen::SelfAdjointEigenSolver<Normal> eigen(equations.normal, Eigen::EigenvaluesOnly);
  const double least = std::max(eigen.eigenvalues()[kTurns], std::numeric_limits<double>::min());
  result.uncertainty_m = std::max(result.contradiction_m, rounding_m) / std::sqrt(least);
  for (std::size_t i = 0; i < model.size(); ++i) {
    result.farthest_m = std::max(result.farthest_m, (result.motors_m[i] - model[i]).norm());
  }
  return result;
}

}  // namespace rikiseki::haptic
