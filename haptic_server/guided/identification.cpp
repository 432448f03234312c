// SPDX-License-Identifier: MIT
#include "haptic_server/guided/identification.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

constexpr double kWindowS = 0.12;
constexpr double kHopS = 0.03;
constexpr int kIterations = 5;        // of the delay, which enters linearised
constexpr double kSlopeSpanS = 3e-3;  // for the direction of motion, to either side
constexpr double kLeastSpeed = 5e-3;  // m/s, below which rounding hides the direction
constexpr double kWorstCondition = 1e10;

enum Unknown : Eigen::Index {
  kMass,
  kDamping,
  kFriction,
  kDelay,
  kWeight,
  kUnknowns = kWeight + 3
};
using Row = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

// sin^4 over a window [s], with what integration by parts needs. 0 outside.
class Bump {
 public:
  explicit Bump(double begin_s) : begin_s_(begin_s) {}

  double Value(double t) const {
    const double s = std::sin(Angle(t));
    return s * s * s * s;
  }
  double Slope(double t) const {
    const double a = Angle(t);
    return kRate * (std::sin(2 * a) - std::sin(4 * a) / 2);
  }
  double Curvature(double t) const {
    const double a = Angle(t);
    return kRate * kRate * 2 * (std::cos(2 * a) - std::cos(4 * a));
  }
  // The integral up to t.
  double Sum(double t) const {
    const double a = Angle(t);
    return (3 * a / 8 - std::sin(2 * a) / 4 + std::sin(4 * a) / 32) / kRate;
  }

 private:
  static constexpr double kRate = std::numbers::pi / kWindowS;
  double Angle(double t) const { return kRate * std::clamp(t - begin_s_, 0.0, kWindowS); }
  double begin_s_;
};

class Regression {
 public:
  explicit Regression(const std::vector<MotionRecord>& records) : records_(records) {
    for (const MotionRecord& record : records) {
      time_s_.push_back(Seconds(record.time_ns - records.front().time_ns));
    }
    for (std::size_t i = 0; i < records.size(); ++i) directions_.push_back(Direction(i));
  }

  Identification Solve() const {
    Identification result;
    double delay_s = 0;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      Fit(delay_s, result);
      delay_s = result.latency_s.value;
    }
    return result;
  }

 private:
  // Along the motion, shorter where it is too slow to tell.
  Vec3 Direction(std::size_t i) const {
    std::size_t before = i;
    std::size_t after = i;
    while (before > 0 && time_s_[i] - time_s_[before] < kSlopeSpanS) --before;
    while (after + 1 < time_s_.size() && time_s_[after] - time_s_[i] < kSlopeSpanS) ++after;
    const double span = time_s_[after] - time_s_[before];
    if (!(span > 0)) return Vec3::Zero();
    const Vec3 velocity = (records_[after].position - records_[before].position) / span;
    return velocity / std::max(velocity.norm(), kLeastSpeed);
  }

  // The equations of one window, `delay_s` being known so far: x, y and z.
  void AddWindow(double begin_s, double delay_s, std::array<Row, 3>& rows, Vec3& right) const {
    const Bump bump(begin_s);
    for (Row& row : rows) row.setZero();
    right.setZero();
    const auto from = std::lower_bound(time_s_.begin(), time_s_.end(),
                                       begin_s - std::max(delay_s, 0.0) - kSlopeSpanS);
    auto i = static_cast<std::size_t>(from - time_s_.begin());
    i = i > 0 ? i - 1 : i;
    for (; i + 1 < records_.size() && time_s_[i] < begin_s + kWindowS + std::abs(delay_s); ++i) {
      const double t = time_s_[i];
      const double next = time_s_[i + 1];
      const double width = (next - t) / 2;  // trapezoids
      const double sum = bump.Sum(next + delay_s) - bump.Sum(t + delay_s);
      const double rise = bump.Value(next + delay_s) - bump.Value(t + delay_s);
      right += records_[i].force * sum;
      for (int axis = 0; axis < 3; ++axis) {
        Row& row = rows[static_cast<std::size_t>(axis)];
        const auto trapezoid = [&](auto&& value) {
          return width * (value(i, t) + value(i + 1, next));
        };
        row[kMass] += trapezoid([&](std::size_t k, double at) {
          return records_[k].position[axis] * bump.Curvature(at);
        });
        row[kDamping] -= trapezoid(
            [&](std::size_t k, double at) { return records_[k].position[axis] * bump.Slope(at); });
        row[kFriction] += trapezoid(
            [&](std::size_t k, double at) { return directions_[k][axis] * bump.Value(at); });
        row[kDelay] -= records_[i].force[axis] * rise;
        row[kWeight + axis] += trapezoid([&](std::size_t, double at) { return bump.Value(at); });
      }
    }
  }

  void Fit(double delay_s, Identification& result) const {
    Normal normal = Normal::Zero();
    Row sums = Row::Zero();
    double squares = 0;
    int equations = 0;
    const double end_s = time_s_.back() - kWindowS - kSlopeSpanS - std::abs(delay_s);
    for (double begin_s = kWindowS; begin_s < end_s; begin_s += kHopS) {
      std::array<Row, 3> rows;
      Vec3 right;
      AddWindow(begin_s, delay_s, rows, right);
      for (int axis = 0; axis < 3; ++axis) {
        const Row& row = rows[static_cast<std::size_t>(axis)];
        normal += row * row.transpose();
        sums += row * right[axis];
        squares += right[axis] * right[axis];
        ++equations;
      }
    }
    // Unknowns of different units are made comparable before it is judged whether they can be told apart.
    const Row scale = normal.diagonal().cwiseSqrt();
    if (equations < 3 * kUnknowns || !scale.allFinite() || !(scale.minCoeff() > 0)) {
      throw std::invalid_argument("too little motion was recorded");
    }
    const Normal scaled =
        scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
    const Eigen::LDLT<Normal> factors(scaled);
    const Row pivots = factors.vectorD();
    if (!(pivots.minCoeff() * kWorstCondition > 1)) {
      throw std::invalid_argument(
          "the recorded motion does not tell mass, damping and friction apart");
    }
    const Row solution = (factors.solve(sums.cwiseQuotient(scale))).cwiseQuotient(scale);
    const Normal inverse = scale.cwiseInverse().asDiagonal() * factors.solve(Normal::Identity()) *
                           scale.cwiseInverse().asDiagonal();
    const double left = std::max(squares - solution.dot(sums), 0.0);
    const double variance = left / (equations - static_cast<int>(kUnknowns));
    // Windows overlap: each equation is there kWindowS/kHopS times.
    const Row deviation = (kWindowS / kHopS * variance * inverse.diagonal()).cwiseSqrt();
    result.mass_kg = {solution[kMass], deviation[kMass]};
    result.damping_ns_per_m = {solution[kDamping], deviation[kDamping]};
    result.friction_n = {solution[kFriction], deviation[kFriction]};
    result.latency_s = {std::clamp(delay_s + solution[kDelay], -kWindowS / 4, kWindowS / 4),
                        deviation[kDelay]};
    result.explained = squares > 0 ? 1 - left / squares : 0;
  }

  const std::vector<MotionRecord>& records_;
  std::vector<double> time_s_;
  std::vector<Vec3> directions_;
};

}  // namespace

Identification IdentifyDevice(const std::vector<MotionRecord>& records) {
  if (records.size() < 2) throw std::invalid_argument("too little motion was recorded");
  return Regression(records).Solve();
}

}  // namespace rikiseki::haptic
