// SPDX-License-Identifier: MIT
#include "world_server/physics/gjk.h"

namespace rikiseki::world {
namespace {

using Weights = std::array<double, 4>;

// The weights of the corners in the point of their plane, line or place that is nearest to 0; false
// where that lies outside of them, or they are degenerate.
bool Inner(const std::array<Vec3, 4>& corners, std::size_t count, Weights& weights) {
  weights = {1, 0, 0, 0};
  if (count == 1) return true;
  const Vec3& origin = corners[0];
  const Vec3 a = corners[1] - origin;
  if (count == 2) {
    const double t = -origin.dot(a) / a.squaredNorm();
    weights = {1 - t, t, 0, 0};
    return t > 0 && t < 1;
  }
  const Vec3 b = corners[2] - origin;
  if (count == 3) {
    const Vec3 normal = a.cross(b);
    const double area = normal.squaredNorm();
    const double u = -origin.cross(b).dot(normal) / area;
    const double v = -a.cross(origin).dot(normal) / area;
    weights = {1 - u - v, u, v, 0};
    return u > 0 && v > 0 && u + v < 1;
  }
  const Vec3 c = corners[3] - origin;
  const double volume = a.dot(b.cross(c));
  const double u = -origin.dot(b.cross(c)) / volume;
  const double v = -a.dot(origin.cross(c)) / volume;
  const double w = -a.dot(b.cross(origin)) / volume;
  weights = {1 - u - v - w, u, v, w};
  return u > 0 && v > 0 && w > 0 && u + v + w < 1;
}

}  // namespace

bool Simplex::Has(const Vec3& difference) const {
  for (std::size_t i = 0; i < count_; ++i) {
    if (pairs_[i].difference() == difference) return true;
  }
  return false;
}

// Every face of the simplex whose inside has a point nearest to 0 is tried, the newest corner in it
// or not; the nearest of these points is the simplex's.
void Simplex::Add(const Pair& pair) {
  pairs_[count_++] = pair;
  double least = std::numeric_limits<double>::infinity();
  std::array<std::size_t, 4> best{};
  std::size_t best_count = 0;
  Weights best_weights{};
  for (unsigned subset = 1; subset < 1U << count_; ++subset) {
    std::array<std::size_t, 4> members{};
    std::array<Vec3, 4> corners;
    corners.fill(Vec3::Zero());
    std::size_t size = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      if ((subset >> i & 1U) == 0) continue;
      members[size] = i;
      corners[size++] = pairs_[i].difference();
    }
    Weights weights;
    if (!Inner(corners, size, weights)) continue;
    Vec3 point = Vec3::Zero();
    if (size < 4) {
      for (std::size_t i = 0; i < size; ++i) point += weights[i] * corners[i];
    }
    const double squared = point.squaredNorm();
    if (!(squared < least)) continue;
    least = squared;
    nearest_ = point;
    best = members;
    best_count = size;
    best_weights = weights;
  }
  std::array<Pair, 4> kept;
  for (std::size_t i = 0; i < best_count; ++i) kept[i] = pairs_[best[i]];
  pairs_ = kept;
  weights_ = best_weights;
  count_ = best_count;
}

Vec3 Simplex::OnFirst() const {
  Vec3 point = Vec3::Zero();
  for (std::size_t i = 0; i < count_; ++i) point += weights_[i] * pairs_[i].first;
  return point;
}

Vec3 Simplex::OnSecond() const {
  Vec3 point = Vec3::Zero();
  for (std::size_t i = 0; i < count_; ++i) point += weights_[i] * pairs_[i].second;
  return point;
}

}  // namespace rikiseki::world
