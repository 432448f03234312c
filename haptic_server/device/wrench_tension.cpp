// SPDX-License-Identifier: MIT
#include "haptic_server/device/wrench_tension.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace rikiseki::haptic {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector8 = Eigen::Matrix<double, 8, 1>;
using Matrix68 = Eigen::Matrix<double, 6, 8>;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

// What the wish for rest weighs against the wrench: too little to cost a force that can be felt,
// enough to leave the two directions that display nothing well conditioned.
constexpr double kRestWeight = 1e-6;
constexpr double kSlope = 1e-12;    // relative: less does not call a string off its bound
constexpr double kFarthest = 1e9;   // N, far beyond every motor: squares stay finite
constexpr double kFeasible = 1e-6;  // of 1 N and the wrench
// Each pass lowers the objective, so no set of held strings comes twice. Should rounding ever make
// it circle, the tensions it ends with are within the bounds all the same.
constexpr int kMaxPasses = 40;

// Minimises |strings t - wanted|^2 + kRestWeight |t - rest|^2 within the bounds: an active set of
// held strings, each at a bound; the free ones are where the objective is least for them.
class BoxProgram {
 public:
  BoxProgram(const Matrix68& strings, const Vector6& wanted, const TensionBounds& bounds,
             double rest_n)
      : bounds_(bounds), rest_n_(rest_n) {
    hessian_.noalias() = strings.transpose() * strings;
    hessian_.diagonal().array() += kRestWeight;
    linear_.noalias() = strings.transpose() * wanted;
    linear_.array() += kRestWeight * rest_n;
    slope_ = kSlope * linear_.cwiseAbs().maxCoeff();
  }

  Vector8 Solve() {
    // Strings that end out of bounds if nothing holds them are the ones to hold first.
    tension_.setZero();
    const Vector8 unbounded = FreeStep(Downhill());
    tension_ = Clamped(unbounded);
    for (Eigen::Index i = 0; i < 8; ++i) held_[i] = tension_[i] != unbounded[i];
    Descend();
    // The wish for rest has drawn the wrench off by its weight. To stay where this is weighs the same
    // and draws by nothing: what is left of the slope is that weight times the way gone now.
    linear_ += kRestWeight * (tension_ - rest_n_ * Vector8::Ones());
    Descend();
    return tension_;
  }

 private:
  void Descend() {
    for (int pass = 0; pass < kMaxPasses; ++pass) {
      const bool arrived = Advance(FreeStep(Downhill()));
      if (arrived && !ReleaseOne()) return;
    }
  }

  Vector8 Clamped(const Vector8& tension) const {
    return tension.cwiseMax(bounds_.min_n).cwiseMin(bounds_.max_n);
  }

  Vector8 Downhill() const { return linear_ - hessian_ * tension_; }

  // From here to where the free strings find no slope. Held strings are rows of the identity, so
  // that the size never changes.
  Vector8 FreeStep(const Vector8& downhill) const {
    Matrix8 matrix = hessian_;
    Vector8 slope = downhill;
    for (Eigen::Index i = 0; i < 8; ++i) {
      if (!held_[i]) continue;
      matrix.row(i).setZero();
      matrix.col(i).setZero();
      matrix(i, i) = 1;
      slope[i] = 0;
    }
    return matrix.llt().solve(slope);
  }

  // Goes as far as the bounds let it; the string that comes to its bound first is held there.
  bool Advance(const Vector8& step) {
    double fraction = 1;
    Eigen::Index first = -1;
    for (Eigen::Index i = 0; i < 8; ++i) {
      if (held_[i]) continue;
      const double bound = step[i] < 0 ? bounds_.min_n : bounds_.max_n;
      const double room = bound - tension_[i];
      if (std::abs(step[i]) * fraction > std::abs(room)) {
        fraction = room / step[i];
        first = i;
      }
    }
    tension_ = Clamped(tension_ + fraction * step);
    if (first < 0) return true;
    tension_[first] = step[first] < 0 ? bounds_.min_n : bounds_.max_n;
    held_[first] = true;
    return false;
  }

  // Lets go of the held string that wants most to leave its bound. False if none does.
  bool ReleaseOne() {
    const Vector8 downhill = Downhill();
    Eigen::Index most = -1;
    double steepest = slope_;
    for (Eigen::Index i = 0; i < 8; ++i) {
      if (!held_[i]) continue;
      const double inward = tension_[i] > bounds_.min_n ? -downhill[i] : downhill[i];
      if (inward > steepest) {
        steepest = inward;
        most = i;
      }
    }
    if (most < 0) return false;
    held_[most] = false;
    return true;
  }

  TensionBounds bounds_;
  double rest_n_;
  Matrix8 hessian_;
  Vector8 linear_;
  double slope_;
  Vector8 tension_ = Vector8::Zero();
  Eigen::Array<bool, 8, 1> held_ = Eigen::Array<bool, 8, 1>::Constant(false);
};

// Rows: force, torque over the mean arm. The mean arm is that of the strings, whatever the pose.
Matrix68 ScaledStrings(const GripStrings& strings, double arm_m) {
  Matrix68 scaled;
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    scaled.col(column).head<3>() = strings.direction[i];
    scaled.col(column).tail<3>() = strings.arm[i].cross(strings.direction[i]) / arm_m;
  }
  return scaled;
}

double MeanArm(const GripStrings& strings) {
  double square = 0;
  for (const Vec3& arm : strings.arm) square += arm.squaredNorm() / kGripStrings;
  return std::max(std::sqrt(square), 1e-6);
}

}  // namespace

Wrench StringWrench(const GripStrings& strings, const EightStrings& tension) noexcept {
  Wrench wrench;
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    wrench.force += strings.direction[i] * tension[i];
    wrench.torque += strings.arm[i].cross(strings.direction[i]) * tension[i];
  }
  return wrench;
}

WrenchAllocation AllocateWrench(const GripStrings& strings, const Wrench& wrench,
                                const TensionBounds& bounds, double rest_n) noexcept {
  WrenchAllocation result;
  result.tension.fill(bounds.min_n);
  const double arm_m = MeanArm(strings);
  const Matrix68 scaled = ScaledStrings(strings, arm_m);
  if (!scaled.allFinite()) return result;  // a pose that is no number: let go
  Vector6 wanted;
  wanted << wrench.force, wrench.torque / arm_m;
  if (!wanted.allFinite()) wanted.setZero();
  const double size = wanted.stableNorm();
  if (size > kFarthest) wanted *= kFarthest / size;

  const Vector8 tension = BoxProgram(scaled, wanted, bounds, rest_n).Solve();
  for (std::size_t i = 0; i < kGripStrings; ++i) {
    result.tension[i] = tension[static_cast<Eigen::Index>(i)];
  }
  result.wrench = StringWrench(strings, result.tension);
  result.feasible = (scaled * tension - wanted).norm() <= kFeasible * (1 + wanted.norm());
  return result;
}

}  // namespace rikiseki::haptic
