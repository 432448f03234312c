// SPDX-License-Identifier: MIT
#include "haptic_server/device/tension.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace rikiseki::haptic {
namespace {

using Directions = std::array<Vec3, kTensionStrings>;
using Matrix34 = Eigen::Matrix<double, 3, 4>;
using Vector4 = Eigen::Vector4d;

constexpr double kFlat = 1e-9;            // the strings span no volume
constexpr double kBoundRounding = 1e-12;  // relative, of tensions
constexpr double kSameError = 1e-12;      // relative, of force errors that count as equal
constexpr double kFarthestForce = 1e9;    // N, far beyond every motor: squares stay finite

double Clamp(double tension, const TensionBounds& bounds) {
  return std::clamp(tension, bounds.min_n, bounds.max_n);
}

// t_i = (-1)^i det of the other three: W t = 0.
Vector4 BalancedTensions(const Directions& d) {
  return {d[1].dot(d[2].cross(d[3])), -d[0].dot(d[2].cross(d[3])), d[0].dot(d[1].cross(d[3])),
          -d[0].dot(d[1].cross(d[2]))};
}

// The solutions are t + a * balanced; their bounds leave an interval of a. False if it is empty.
bool AllocateExactly(const Directions& directions, const Vec3& force, const TensionBounds& bounds,
                     FourStrings& tension) {
  Vector4 balanced = BalancedTensions(directions);
  const double size = balanced.norm();
  if (!(size > kFlat)) return false;
  balanced /= size;
  if (balanced.sum() < 0) balanced = -balanced;  // now a smaller a is a smaller sum

  Matrix34 strings;
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    strings.col(static_cast<Eigen::Index>(i)) = directions[i];
  }
  const Mat3 gram_inverse = (strings * strings.transpose()).inverse();
  Vector4 any = strings.transpose() * (gram_inverse * force);
  any += strings.transpose() * (gram_inverse * (force - strings * any));

  const double slack = kBoundRounding * (bounds.max_n + any.cwiseAbs().maxCoeff());
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  Eigen::Index touching = -1;  // the string that `low` puts at its bound
  for (Eigen::Index i = 0; i < 4; ++i) {
    if (std::abs(balanced[i]) < kFlat) {
      if (any[i] < bounds.min_n - slack || any[i] > bounds.max_n + slack) return false;
      continue;
    }
    const double at_min = (bounds.min_n - any[i]) / balanced[i];
    const double at_max = (bounds.max_n - any[i]) / balanced[i];
    if (std::min(at_min, at_max) > low) {
      low = std::min(at_min, at_max);
      touching = i;
    }
    high = std::min(high, std::max(at_min, at_max));
  }
  if (!(low <= high + slack)) return false;
  for (Eigen::Index i = 0; i < 4; ++i) {
    tension[static_cast<std::size_t>(i)] = Clamp(any[i] + low * balanced[i], bounds);
  }
  if (touching >= 0) {
    double& bound = tension[static_cast<std::size_t>(touching)];
    bound = bound - bounds.min_n < bounds.max_n - bound ? bounds.min_n : bounds.max_n;
  }
  return true;
}

// Keeps the best of the candidates that AllocateNearest tries. What it starts from is within the
// bounds: directions that are no numbers make no candidate better than another.
struct Best {
  FourStrings tension;
  double error = std::numeric_limits<double>::infinity();
  double sum = std::numeric_limits<double>::infinity();

  void Consider(const Directions& directions, const FourStrings& candidate, const Vec3& force) {
    const double candidate_error = (StringForce(directions, candidate) - force).norm();
    const double candidate_sum = candidate[0] + candidate[1] + candidate[2] + candidate[3];
    const double same = kSameError * (force.norm() + candidate_sum);
    if (candidate_error < error - same || (candidate_error < error + same && candidate_sum < sum)) {
      tension = candidate;
      error = candidate_error;
      sum = candidate_sum;
    }
  }
};

// The forces within the bounds form a zonotope. Its point nearest to a force outside lies on a
// face, where all strings but at most two are at a bound.
FourStrings AllocateNearest(const Directions& directions, const Vec3& force,
                            const TensionBounds& bounds) {
  Best best;
  best.tension.fill(bounds.min_n);
  for (unsigned at_max = 0; at_max < 16; ++at_max) {
    FourStrings corner;
    for (std::size_t i = 0; i < kTensionStrings; ++i) {
      corner[i] = (at_max >> i & 1U) != 0 ? bounds.max_n : bounds.min_n;
    }
    best.Consider(directions, corner, force);
    // Free strings are taken where the corner has them at the minimum, so that each face comes
    // once.
    for (std::size_t i = 0; i < kTensionStrings; ++i) {
      if ((at_max >> i & 1U) != 0) continue;
      FourStrings edge = corner;
      edge[i] = 0;
      const Vec3 missing = force - StringForce(directions, edge);
      const double along_i = directions[i].dot(missing);
      const double i_square = directions[i].squaredNorm();
      if (i_square > 0) {
        edge[i] = Clamp(along_i / i_square, bounds);
        best.Consider(directions, edge, force);
      }
      for (std::size_t j = i + 1; j < kTensionStrings; ++j) {
        if ((at_max >> j & 1U) != 0) continue;
        FourStrings face = corner;
        face[i] = face[j] = 0;
        const Vec3 rest = force - StringForce(directions, face);
        const double cosine = directions[i].dot(directions[j]);
        const double j_square = directions[j].squaredNorm();
        const double determinant = i_square * j_square - cosine * cosine;
        if (!(determinant > kFlat * kFlat)) continue;
        const double on_i = directions[i].dot(rest);
        const double on_j = directions[j].dot(rest);
        face[i] = Clamp((j_square * on_i - cosine * on_j) / determinant, bounds);
        face[j] = Clamp((i_square * on_j - cosine * on_i) / determinant, bounds);
        best.Consider(directions, face, force);
      }
    }
  }
  return best.tension;
}

}  // namespace

Vec3 StringForce(const Directions& directions, const FourStrings& tension) noexcept {
  return directions[0] * tension[0] + directions[1] * tension[1] + directions[2] * tension[2] +
         directions[3] * tension[3];
}

TensionAllocation AllocateTensions(const Directions& directions, const Vec3& force,
                                   const TensionBounds& bounds) noexcept {
  Vec3 wanted = force.allFinite() ? force : Vec3::Zero();
  const double size = wanted.stableNorm();
  if (size > kFarthestForce) wanted *= kFarthestForce / size;
  TensionAllocation result;
  result.feasible = AllocateExactly(directions, wanted, bounds, result.tension);
  if (!result.feasible) {
    result.tension = AllocateNearest(directions, wanted, bounds);
  }
  result.force = StringForce(directions, result.tension);
  const double rounding = 1e-9 * (1 + wanted.norm());
  result.feasible = (result.force - wanted).norm() <= rounding;
  return result;
}

}  // namespace rikiseki::haptic
