// SPDX-License-Identifier: MIT
// What must hold of the contact points of any convex shape with any box.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <random>
#include <vector>

#include "world_server/physics/box_faces.h"
#include "world_server/physics/contact_point.h"

namespace rikiseki::world::test {

inline double LeastGap(const std::vector<ContactPoint>& points) {
  double least = std::numeric_limits<double>::infinity();
  for (const ContactPoint& point : points) least = std::min(least, point.gap);
  return least;
}

/// `find(pose, box, pose of the box, reach)` gives contacts; `support(pose, direction)` the shape's
/// furthest point along a direction. Deeper than `deepest_m` another axis may be better.
template <typename Find, typename Support>
void CheckRandomContacts(double smallest, const Find& find, const Support& support,
                         double deepest_m = 1) {
  std::mt19937 random(31);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto turn = [&] {
    return Quat(any(random), any(random), any(random), any(random)).normalized();
  };
  const auto vector = [&] { return Vec3(any(random), any(random), any(random)); };
  constexpr double kReach = 0.02;
  int apart = 0;
  int overlapping = 0;
  int at_edges = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const Box box{Vec3::Constant(0.03) + 0.02 * vector()};
    const Pose pose_B{0.02 * vector(), turn()};
    const Pose pose{0.1 * vector(), turn()};
    const PlacedBox placed(box, pose_B);
    const auto separation = [&](const Vec3& out) {
      return out.dot(support(pose, -out) - placed.Corner(out));
    };
    // The best of many directions: less than the truth, and near it.
    double best = -std::numeric_limits<double>::infinity();
    Vec3 direction = pose.position - pose_B.position;
    for (double spread = 2; spread > 1e-7; spread *= 0.97) {
      const Vec3 tried = (direction.normalized() + spread * vector()).normalized();
      if (separation(tried) <= best) continue;
      best = separation(tried);
      direction = tried;
    }
    const std::vector<ContactPoint> points = find(pose, box, pose_B, kReach);
    CAPTURE(trial, best);
    REQUIRE(points.size() <= kMostContactPoints);
    // What two corners part is told by a face or an edge, which see at least 1 / sqrt(3) of the way.
    if (best > 2 * kReach) REQUIRE(points.empty());
    if (best < 0) {
      ++overlapping;
      REQUIRE_FALSE(points.empty());
    }
    if (points.empty()) continue;
    apart += best > 0 ? 1 : 0;
    at_edges += points.size() == 1 ? 1 : 0;
    for (const ContactPoint& point : points) {
      REQUIRE(point.gap <= kReach);
      REQUIRE(std::abs(point.normal_W.norm() - 1) < 1e-12);
      const double along = separation(point.normal_W);
      // No point is deeper than the two shapes are along its normal ...
      REQUIRE(point.gap > along - 1e-9);
      // ... and no axis is much worse than the best: a face is preferred by 1e-3 of the size.
      if (best < 0 && best > -deepest_m) REQUIRE(along > best - 2 * kEdgeMargin * smallest - 1e-6);
    }
  }
  CHECK(apart > 100);
  CHECK(overlapping > 300);
  CHECK(at_edges > 50);
}

}  // namespace rikiseki::world::test
