// SPDX-License-Identifier: MIT
// The nearest points of two convex sets that do not meet, each known by its furthest point along a
// direction. After E. Gilbert, D. Johnson and S. Keerthi (1988).
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "common/geometry.h"

namespace rikiseki::world {

/// Up to four pairs of points, and the point of their differences' hull that is nearest to 0.
class Simplex {
 public:
  struct Pair {
    Vec3 first, second;
    Vec3 difference() const { return first - second; }
  };

  bool Has(const Vec3& difference) const;

  /// Adds a pair, and forgets those that the nearest point does not need.
  void Add(const Pair& pair);

  const Vec3& nearest() const { return nearest_; }
  bool surrounds() const { return count_ == 4; }  // 0 is inside
  Vec3 OnFirst() const;
  Vec3 OnSecond() const;

 private:
  std::array<Pair, 4> pairs_;
  std::array<double, 4> weights_{};
  std::size_t count_ = 0;
  Vec3 nearest_ = Vec3::Zero();
};

struct Closest {
  bool apart = false;
  Vec3 on_first = Vec3::Zero(), on_second = Vec3::Zero();
};

/// `support(direction)` gives the pair of the first set's furthest point along `direction` and the
/// second's furthest against it. `start` is any direction but 0. To 1e-15 of the squared distance;
/// not apart where they meet.
template <typename Support>
Closest FindClosest(const Support& support, const Vec3& start) {
  constexpr int kMostSteps = 100;
  constexpr double kTight = 1e-15;
  Simplex simplex;
  simplex.Add(support(-start));
  double least = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kMostSteps; ++step) {
    const Vec3 nearest = simplex.nearest();
    const double squared = nearest.squaredNorm();
    if (simplex.surrounds() || !(squared > 0)) return {};
    if (!(squared < least)) break;  // rounding ends the way
    least = squared;
    const Simplex::Pair pair = support(-nearest);
    if (squared - nearest.dot(pair.difference()) <= kTight * squared) break;
    if (simplex.Has(pair.difference())) break;
    simplex.Add(pair);
  }
  return {.apart = true, .on_first = simplex.OnFirst(), .on_second = simplex.OnSecond()};
}

}  // namespace rikiseki::world
